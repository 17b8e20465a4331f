//! [`Join`] as one line for a QR code: `cofix1:` and base64url of postcard, with certificates and key as DER.

use base64::Engine;
use base64::engine::general_purpose::{STANDARD, URL_SAFE_NO_PAD};
use cofix_common::time::GpsTime;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivatePkcs8KeyDer};
use serde::{Deserialize, Serialize};

use super::Join;
use crate::publication::secured::Credentials;

/// Beginning of the line, with its version.
const BEGINNING: &str = "cofix1:";
/// Characters of a line of PEM.
const PEM_COLUMNS: usize = 64;
const CERTIFICATE: &str = "CERTIFICATE";
const KEY: &str = "PRIVATE KEY";

#[derive(Deserialize, Serialize)]
struct Line {
    group: String,
    phone: String,
    hub: Vec<String>,
    expires: GpsTime,
    certificate: Vec<u8>,
    key: Vec<u8>,
    authority: Vec<u8>,
}

/// Whether a text begins as a line does.
pub(super) fn is_begun_by(text: &str) -> bool {
    text.trim_start().starts_with(BEGINNING)
}

/// The line.
///
/// # Errors
/// When a certificate or the key is no PEM.
pub fn line(join: &Join) -> Result<String, String> {
    let Credentials { certificate, key, authority } = &join.credentials;
    let der = |pem: &str| {
        CertificateDer::from_pem_slice(pem.as_bytes())
            .map(|der| der.to_vec())
            .map_err(|error| format!("a certificate is no PEM: {error}"))
    };
    let key = PrivatePkcs8KeyDer::from_pem_slice(key.as_bytes())
        .map_err(|error| format!("the key is no PEM: {error}"))?;
    let line = Line {
        group: join.group.clone(),
        phone: join.phone.clone(),
        hub: join.hub.clone(),
        expires: join.expires,
        certificate: der(certificate)?,
        key: key.secret_pkcs8_der().to_vec(),
        authority: der(authority)?,
    };
    let bytes = postcard::to_allocvec(&line).map_err(|error| error.to_string())?;
    Ok(BEGINNING.to_owned() + &URL_SAFE_NO_PAD.encode(bytes))
}

/// Reads the line.
pub(super) fn parse(text: &str) -> Result<Join, String> {
    let coded = text.trim().strip_prefix(BEGINNING).unwrap_or_default();
    let bytes = URL_SAFE_NO_PAD.decode(coded).map_err(|error| format!("the line is damaged: {error}"))?;
    let (line, rest): (Line, _) =
        postcard::take_from_bytes(&bytes).map_err(|error| format!("the line is damaged: {error}"))?;
    if !rest.is_empty() {
        return Err(format!("the line is damaged: {} bytes are left over", rest.len()));
    }
    let credentials = Credentials {
        certificate: pem(CERTIFICATE, &line.certificate),
        key: pem(KEY, &line.key),
        authority: pem(CERTIFICATE, &line.authority),
    };
    Ok(Join { group: line.group, phone: line.phone, hub: line.hub, expires: line.expires, credentials })
}

fn pem(what: &str, der: &[u8]) -> String {
    let coded = STANDARD.encode(der);
    let lines = coded.as_bytes().chunks(PEM_COLUMNS).map(String::from_utf8_lossy);
    let body: String = lines.flat_map(|line| [line, "\n".into()]).collect();
    format!("-----BEGIN {what}-----\n{body}-----END {what}-----\n")
}
