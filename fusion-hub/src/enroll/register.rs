//! The register of a group: which certificates are valid.

use anyhow::{Context, bail};
use cofix_agent::join::about_expiry;
use cofix_common::time::GpsTime;
use cofix_common::wire::check_name;
use serde::{Deserialize, Serialize};

const VERSION: u32 = 1;

/// Which certificates of a group are valid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Register {
    /// The group.
    pub group: String,
    /// The hub's addresses, `HOST:PORT`.
    pub hub: Vec<String>,
    /// The name in the hub's certificate; `None`: of a hub that was enrolled before its certificate could ask.
    pub hub_certificate: Option<String>,
    /// When the hub's certificate ends.
    pub expires: Option<GpsTime>,
    /// When the authority ends.
    pub authority_expires: Option<GpsTime>,
    /// The phones.
    pub phones: Vec<Member>,
}

/// A phone that may speak.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Member {
    /// The phone.
    pub name: String,
    /// The name in its present certificate.
    pub certificate: String,
    /// When that ends, `YYYY-MM-DDThh:mm:ss` in GPS time.
    pub expires: String,
}

/// The file.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Text {
    version: u32,
    group: String,
    hub: Vec<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    hub_certificate: Option<String>,
    expires: String,
    authority_expires: String,
    #[serde(default, rename = "phone", skip_serializing_if = "Vec::is_empty")]
    phones: Vec<Member>,
}

impl Register {
    /// Of a group in which nobody may speak yet.
    pub(super) fn new(group: &str) -> Self {
        Self {
            group: group.to_owned(),
            hub: Vec::new(),
            hub_certificate: None,
            expires: None,
            authority_expires: None,
            phones: Vec::new(),
        }
    }

    pub(super) fn parse(text: &str) -> anyhow::Result<Self> {
        let Text { version, group, hub, hub_certificate, expires, authority_expires, phones } =
            toml::from_str(text)?;
        if version != VERSION {
            bail!("version {version}, and this program reads {VERSION}");
        }
        for name in [&group].into_iter().chain(phones.iter().map(|member| &member.name)) {
            check_name(name)?;
        }
        for member in &phones {
            member.end()?;
        }
        let [expires, authority_expires] = [Some(expires.parse()?), Some(authority_expires.parse()?)];
        Ok(Self { group, hub, hub_certificate, expires, authority_expires, phones })
    }

    pub(super) fn text(&self) -> anyhow::Result<String> {
        let expires = self.expires.context("the hub has no certificate")?.iso();
        let authority_expires = self.authority_expires.context("the authority has no end")?.iso();
        let Self { group, hub, hub_certificate, phones, .. } = self.clone();
        Ok(toml::to_string_pretty(&Text {
            version: VERSION,
            group,
            hub,
            hub_certificate,
            expires,
            authority_expires,
            phones,
        })?)
    }

    /// Admits a phone, in place of what was valid for it.
    pub(super) fn admit(&mut self, member: Member) {
        self.phones.retain(|old| old.name != member.name);
        self.phones.push(member);
    }

    /// Admits a phone no more.
    pub(super) fn revoke(&mut self, phone: &str) -> anyhow::Result<()> {
        let before = self.phones.len();
        self.phones.retain(|member| member.name != phone);
        if self.phones.len() == before {
            let names: Vec<&str> = self.phones.iter().map(|member| member.name.as_str()).collect();
            bail!("--revoke '{phone}': is not enrolled; there are {}", names.join(", "));
        }
        Ok(())
    }

    /// What to say of certificates that have ended or soon will.
    pub fn expiries(&self, now: GpsTime) -> Vec<String> {
        let hub =
            self.expires.and_then(|expires| about_expiry(expires, now)).map(|said| format!("hub: {said}"));
        let phones = self.phones.iter().filter_map(|member| {
            let said = about_expiry(member.end().ok()?, now)?;
            Some(format!("{}: {said}", member.name))
        });
        hub.into_iter().chain(phones).collect()
    }
}

impl Member {
    fn end(&self) -> anyhow::Result<GpsTime> {
        self.expires.parse().with_context(|| format!("phone '{}'", self.name))
    }
}
