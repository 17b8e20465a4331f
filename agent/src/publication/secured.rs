//! Who a side of a TLS connection is, and whom it believes.

use std::fmt;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// The certificate and key of one side, and the authority that the other side's certificate must be of; PEM.
#[derive(Clone, PartialEq, Eq)]
pub struct Credentials {
    /// The side's certificate.
    pub certificate: String,
    /// Its private key.
    pub key: String,
    /// The certificate of the authority.
    pub authority: String,
}

/// Without the key.
impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Credentials")
            .field("certificate", &self.certificate)
            .field("authority", &self.authority)
            .finish_non_exhaustive()
    }
}

/// What a listener asks of those who connect.
#[derive(Clone, Debug)]
pub struct Guard {
    /// The listener's own credentials; whoever connects needs a certificate of the same authority.
    pub credentials: Credentials,
    /// Zenoh's access control: what holders of certificates may do.
    pub access_control: serde_json::Value,
}

impl Credentials {
    /// Zenoh's settings of the side that connects.
    pub(super) fn to_connect(&self) -> Vec<(&'static str, String)> {
        let own = [
            ("transport/link/tls/connect_certificate_base64", json(&self.certificate)),
            ("transport/link/tls/connect_private_key_base64", json(&self.key)),
        ];
        self.with_authority(own)
    }

    /// Zenoh's settings of the side that listens.
    pub(super) fn to_listen(&self) -> Vec<(&'static str, String)> {
        let own = [
            ("transport/link/tls/listen_certificate_base64", json(&self.certificate)),
            ("transport/link/tls/listen_private_key_base64", json(&self.key)),
        ];
        self.with_authority(own)
    }

    fn with_authority(&self, own: [(&'static str, String); 2]) -> Vec<(&'static str, String)> {
        let both = [
            ("transport/link/tls/enable_mtls", "true".to_owned()),
            ("transport/link/tls/verify_name_on_connect", "true".to_owned()),
            ("transport/link/tls/close_link_on_expiration", "true".to_owned()),
            ("transport/link/tls/root_ca_certificate_base64", json(&self.authority)),
        ];
        own.into_iter().chain(both).collect()
    }
}

fn json(pem: &str) -> String {
    serde_json::json!(STANDARD.encode(pem)).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_never_shown() {
        let [certificate, key, authority] = ["shown", "secret", "shown"].map(str::to_owned);
        let text = format!("{:?}", Credentials { certificate, key, authority });
        assert!(text.contains("shown") && !text.contains("secret"), "{text}");
    }
}
