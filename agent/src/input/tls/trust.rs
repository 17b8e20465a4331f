//! Trusted certificates.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustls::client::WebPkiServerVerifier;
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::crypto::{CryptoProvider, ring};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::{ClientConfig, DigitallySignedStruct, Error, RootCertStore, SignatureScheme};

/// Authorities of the system (or, where it has none, those that Mozilla lists), and certificates given by the user. Each of the latter is
/// trusted as an authority, and as the certificate of a server itself, whatever its name and dates: a self-signed certificate needs no
/// authority.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Trust {
    given: Vec<CertificateDer<'static>>,
}

/// A file of certificates that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TrustError {
    /// It cannot be read.
    #[error("{}: cannot read the certificates: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// It has no certificate.
    #[error("{}: no certificate in it; write them as PEM (-----BEGIN CERTIFICATE-----)", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// It has a damaged certificate.
    #[error("{}: certificate {number} in it is damaged: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Its number, from 1 on.
        number: usize,
        /// The defect.
        reason: String,
    },
}

impl Trust {
    /// The system's authorities and the certificates of a file in PEM.
    ///
    /// # Errors
    /// When the file cannot be read, has no certificate, or a damaged one.
    pub fn with_file(path: &Path) -> Result<Self, TrustError> {
        let text = std::fs::read(path).map_err(|cause| TrustError::Read { path: path.to_owned(), cause })?;
        let mut given = Vec::new();
        for (number, certificate) in (1..).zip(CertificateDer::pem_slice_iter(&text)) {
            let damaged = |reason| TrustError::Damaged { path: path.to_owned(), number, reason };
            let certificate = certificate.map_err(|error| damaged(error.to_string()))?;
            RootCertStore::empty().add(certificate.clone()).map_err(|error| damaged(error.to_string()))?;
            given.push(certificate);
        }
        if given.is_empty() {
            return Err(TrustError::Empty { path: path.to_owned() });
        }
        Ok(Self { given })
    }

    /// The configuration of connections with this trust.
    ///
    /// # Errors
    /// When there is no trusted certificate.
    pub(super) fn client_config(&self) -> Result<Arc<ClientConfig>, String> {
        let provider = Arc::new(ring::default_provider());
        let authorities =
            WebPkiServerVerifier::builder_with_provider(self.authorities().into(), provider.clone());
        let authorities = authorities.build().map_err(|error| error.to_string())?;
        let verifier = Arc::new(Verifier { given: self.given.clone(), authorities });
        let config = ClientConfig::builder_with_provider(provider as Arc<CryptoProvider>)
            .with_safe_default_protocol_versions()
            .map_err(|error| error.to_string())?;
        let config = config.dangerous().with_custom_certificate_verifier(verifier).with_no_client_auth();
        Ok(Arc::new(config))
    }

    fn authorities(&self) -> RootCertStore {
        let mut store = RootCertStore::empty();
        // What of the system's cannot be read vouches for nobody.
        store.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
        if store.is_empty() {
            store.extend(webpki_roots::TLS_SERVER_ROOTS.iter().cloned());
        }
        store.add_parsable_certificates(self.given.iter().cloned());
        store
    }
}

/// Accepts the given certificates themselves, and those that the authorities have signed.
#[derive(Debug)]
struct Verifier {
    given: Vec<CertificateDer<'static>>,
    authorities: Arc<WebPkiServerVerifier>,
}

impl ServerCertVerifier for Verifier {
    fn verify_server_cert(
        &self,
        shown: &CertificateDer<'_>,
        intermediates: &[CertificateDer<'_>],
        name: &ServerName<'_>,
        ocsp_response: &[u8],
        now: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        if self.given.contains(shown) {
            return Ok(ServerCertVerified::assertion());
        }
        self.authorities.verify_server_cert(shown, intermediates, name, ocsp_response, now)
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        self.authorities.verify_tls12_signature(message, certificate, signature)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        self.authorities.verify_tls13_signature(message, certificate, signature)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.authorities.supported_verify_schemes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_without_good_certificates_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ca.pem");
        let good = rcgen::generate_simple_self_signed(["host".to_owned()]).unwrap().cert.pem();
        let damaged = "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n";
        for (text, said) in [
            (String::new(), "no certificate in it"),
            (damaged.to_owned(), "certificate 1 in it is damaged"),
            (format!("{good}{damaged}"), "certificate 2 in it is damaged"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = Trust::with_file(&path).unwrap_err().to_string();
            assert!(error.contains(said) && error.contains("ca.pem"), "{error}");
        }
        std::fs::write(&path, format!("a remark\n{good}{good}")).unwrap();
        assert_eq!(Trust::with_file(&path).unwrap().given.len(), 2);
        let missing = Trust::with_file(&folder.path().join("missing.pem")).unwrap_err().to_string();
        assert!(missing.contains("missing.pem: cannot read"), "{missing}");
    }
}
