//! Keys and certificates: an authority, the hub, the phones. Elliptic curve P-256.

use std::time::Duration;

use anyhow::Context;
use cofix_agent::publication::endpoint::host_and_port;
use cofix_agent::publication::secured::Credentials;
use cofix_common::time::GpsTime;
use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer,
    KeyPair, KeyUsagePurpose, date_time_ymd,
};
use sha2::{Digest, Sha256};

/// By how much a clock of a phone may be behind the one that enrolled it, s.
const SLOW_CLOCK_S: f64 = 86_400.0;

/// An authority that signs certificates.
pub(super) struct Authority {
    /// Its certificate, PEM.
    pub(super) certificate: String,
    /// Its private key, PEM.
    pub(super) key: String,
    issuer: Issuer<'static, KeyPair>,
}

/// A certificate with its private key, PEM.
pub(super) struct Issued {
    /// The name in the certificate, which is different for every one.
    pub(super) name: String,
    pub(super) certificate: String,
    pub(super) key: String,
}

impl Issued {
    /// With the authority that vouches for the other side.
    pub(super) fn credentials(self, authority: &Authority) -> Credentials {
        let Self { certificate, key, .. } = self;
        Credentials { certificate, key, authority: authority.certificate.clone() }
    }
}

impl Authority {
    /// A new one for a group.
    pub(super) fn new(group: &str, now: GpsTime, expires: GpsTime) -> anyhow::Result<Self> {
        let key = KeyPair::generate().context("a key")?;
        let mut params = authority_params(group);
        set_validity(&mut params, now, expires);
        let certificate = params.self_signed(&key).context("the authority's certificate")?.pem();
        Self::of(group, certificate, key.serialize_pem())
    }

    /// One that there is already.
    pub(super) fn of(group: &str, certificate: String, key: String) -> anyhow::Result<Self> {
        let pair = KeyPair::from_pem(&key).context("the authority's key is no key in PEM")?;
        let issuer = Issuer::new(authority_params(group), pair);
        Ok(Self { certificate, key, issuer })
    }

    /// A certificate for a hub with these addresses, `HOST:PORT`. Whoever holds it may ask the hub for its status too, so it is one of a client as well.
    pub(super) fn hub(&self, addresses: &[String], now: GpsTime, expires: GpsTime) -> anyhow::Result<Issued> {
        let hosts = addresses.iter().filter_map(|address| host_and_port(address).ok());
        let hosts: Vec<String> = hosts.map(|(host, _)| host.to_owned()).collect();
        let params = CertificateParams::new(hosts).context("an address of the hub")?;
        let usages = vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth];
        self.issue("hub", params, usages, [now, expires])
    }

    /// A certificate for a phone. Its name holds a number of its own: one that is revoked does not become valid with the phone's next.
    pub(super) fn phone(&self, phone: &str, now: GpsTime, expires: GpsTime) -> anyhow::Result<Issued> {
        let params = CertificateParams::default();
        self.issue(phone, params, vec![ExtendedKeyUsagePurpose::ClientAuth], [now, expires])
    }

    fn issue(
        &self,
        whose: &str,
        mut params: CertificateParams,
        usages: Vec<ExtendedKeyUsagePurpose>,
        [now, expires]: [GpsTime; 2],
    ) -> anyhow::Result<Issued> {
        let key = KeyPair::generate().context("a key")?;
        let digest = Sha256::digest(key.public_key_raw());
        let number = digest.first_chunk().map_or(0, |bytes| u64::from_be_bytes(*bytes));
        // No name of a phone has a '#'.
        let name = format!("{whose}#{number:016x}");
        params.distinguished_name = named(&name);
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = usages;
        set_validity(&mut params, now, expires);
        let certificate =
            params.signed_by(&key, &self.issuer).with_context(|| format!("a certificate for {whose}"))?;
        Ok(Issued { name, certificate: certificate.pem(), key: key.serialize_pem() })
    }
}

fn authority_params(group: &str) -> CertificateParams {
    let mut params = CertificateParams::default();
    params.distinguished_name = named(&format!("cofix authority of {group}"));
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign];
    params
}

fn named(name: &str) -> DistinguishedName {
    let mut named = DistinguishedName::new();
    named.push(DnType::CommonName, name);
    named
}

/// Sets from when until when a certificate is valid. GPS time is some seconds ahead of UTC.
fn set_validity(params: &mut CertificateParams, from: GpsTime, to: GpsTime) {
    let unix =
        |time: GpsTime| Duration::from_nanos(u64::try_from(time.as_unix_calendar_nanos()).unwrap_or(0));
    let start = date_time_ymd(1970, 1, 1);
    (params.not_before, params.not_after) = (start + unix(from + -SLOW_CLOCK_S), start + unix(to));
}
