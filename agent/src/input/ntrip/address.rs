//! `ntrip://USER:PASSWORD@HOST:PORT/MOUNT`, and the same with `ntrips://` for TLS.

use std::fmt;
use std::str::FromStr;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;

use crate::input::tls::Trust;

/// The default port.
const USUAL_PORT: u16 = 2_101;
/// The default port with TLS: that of HTTPS, which most casters use.
const USUAL_TLS_PORT: u16 = 443;
const SCHEME: &str = "ntrip://";
const TLS_SCHEME: &str = "ntrips://";
/// Longest name of a host or mount point.
const LONGEST_NAME: usize = 255;

/// Invalid address of a caster or a stream.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{shown}': {reason}; write ntrip://USER:PASSWORD@HOST:PORT/MOUNT, with %40 for @, %3A for : and %2F for / in user and password"
)]
pub struct CasterError {
    shown: String,
    reason: &'static str,
}

/// A caster and an account there.
#[derive(Clone, PartialEq, Eq)]
pub struct Caster {
    /// Name or address; an IPv6 address in brackets.
    pub host: String,
    /// Its port.
    pub port: u16,
    account: Option<Account>,
    /// Trusted certificates, when the connection is in TLS.
    trust: Option<Trust>,
}

/// User and password.
#[derive(Clone, PartialEq, Eq)]
struct Account {
    user: String,
    password: String,
}

/// One stream of a caster.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mount {
    /// The caster.
    pub caster: Caster,
    /// The mount point's name.
    pub mount: String,
}

/// An address with an ellipsis in place of a password.
pub fn without_password(text: &str) -> String {
    let (scheme, rest) = text.split_at(text.find("://").map_or(0, |at| at + 3));
    match rest.rsplit_once('@') {
        Some((account, place)) => {
            let (user, password) = account.split_once(':').unwrap_or((account, ""));
            let hidden = if password.is_empty() { "" } else { ":…" };
            format!("{scheme}{user}{hidden}@{place}")
        }
        None => text.to_owned(),
    }
}

impl Caster {
    /// `HOST:PORT`.
    pub fn address(&self) -> String {
        format!("{}:{}", self.host, self.port)
    }

    /// The user's name, if there is an account.
    pub fn user(&self) -> Option<&str> {
        self.account.as_ref().map(|account| account.user.as_str())
    }

    /// Trusted certificates; `None` for a connection without TLS.
    pub const fn trust(&self) -> Option<&Trust> {
        self.trust.as_ref()
    }

    /// The same caster with other trusted certificates; of effect in TLS only.
    #[must_use]
    pub fn trusting(self, trust: &Trust) -> Self {
        Self { trust: self.trust.map(|_| trust.clone()), ..self }
    }

    /// The scheme of its addresses.
    pub(super) const fn scheme(&self) -> &'static str {
        if self.trust.is_some() { TLS_SCHEME } else { SCHEME }
    }

    /// The value of the header `Authorization`, if there is an account (RFC 7617).
    pub(super) fn authorization(&self) -> Option<String> {
        let Account { user, password } = self.account.as_ref()?;
        Some(format!("Basic {}", BASE64_STANDARD.encode(format!("{user}:{password}"))))
    }

    /// Reads an address with or without a mount point.
    fn with_mount(text: &str) -> Result<(Self, &str), CasterError> {
        let wrong = |reason| CasterError { shown: without_password(text), reason };
        let (rest, trust) = match (text.strip_prefix(SCHEME), text.strip_prefix(TLS_SCHEME)) {
            (Some(rest), _) => (rest, None),
            (_, Some(rest)) => (rest, Some(Trust::default())),
            (None, None) => return Err(wrong("the address does not begin with ntrip:// or ntrips://")),
        };
        // A password may hold what should have been escaped: the last @ counts.
        let (account, place) = match rest.rsplit_once('@') {
            Some((account, place)) => (Some(account), place),
            None => (None, rest),
        };
        let (server, mount) = place.split_once('/').unwrap_or((place, ""));
        let usual_port = if trust.is_some() { USUAL_TLS_PORT } else { USUAL_PORT };
        let (host, port) = host_and_port(server, usual_port).ok_or_else(|| wrong("host or port is none"))?;
        let account = match account {
            None => None,
            Some(text) => Some(Account::read(text).ok_or_else(|| wrong("a % in it begins no escape"))?),
        };
        Ok((Self { host, port, account, trust }, mount))
    }
}

fn host_and_port(server: &str, usual_port: u16) -> Option<(String, u16)> {
    // Colons of an IPv6 address are within brackets.
    let colon = server.rfind(':').filter(|at| !server.get(*at..).is_some_and(|rest| rest.contains(']')));
    let (host, port) = match colon {
        Some(at) => (server.get(..at)?, server.get(at + 1..)?.parse().ok().filter(|port| *port > 0)?),
        None => (server, usual_port),
    };
    is_name(host).then(|| (host.to_owned(), port))
}

/// Whether a name can be put into a request unchanged.
fn is_name(text: &str) -> bool {
    (1..=LONGEST_NAME).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_graphic())
}

impl Account {
    fn read(text: &str) -> Option<Self> {
        let (user, password) = text.split_once(':').unwrap_or((text, ""));
        Some(Self { user: unescape(user)?, password: unescape(password)? })
    }
}

/// Undoes the escapes of RFC 3986.
fn unescape(text: &str) -> Option<String> {
    let mut bytes = text.bytes();
    let mut plain = Vec::with_capacity(text.len());
    while let Some(byte) = bytes.next() {
        if byte != b'%' {
            plain.push(byte);
            continue;
        }
        let digits = [bytes.next()?, bytes.next()?];
        if !digits.iter().all(u8::is_ascii_hexdigit) {
            return None;
        }
        plain.push(u8::from_str_radix(std::str::from_utf8(&digits).ok()?, 16).ok()?);
    }
    String::from_utf8(plain).ok().filter(|text| !text.chars().any(char::is_control))
}

impl FromStr for Caster {
    type Err = CasterError;

    /// Reads `ntrip://USER:PASSWORD@HOST:PORT` or `ntrips://…`; a mount point after it is ignored.
    fn from_str(text: &str) -> Result<Self, CasterError> {
        Self::with_mount(text).map(|(caster, _)| caster)
    }
}

impl FromStr for Mount {
    type Err = CasterError;

    fn from_str(text: &str) -> Result<Self, CasterError> {
        let (caster, mount) = Caster::with_mount(text)?;
        let reason = match mount {
            "" => "there is no mount point ('cofix-agent sourcetable ntrip://HOST:PORT' lists them)",
            name if !is_name(name) => "the mount point has blanks or other characters that cannot be",
            name => return Ok(Self { caster, mount: name.to_owned() }),
        };
        Err(CasterError { shown: without_password(text), reason })
    }
}

impl fmt::Display for Caster {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.scheme(), self.address())
    }
}

impl fmt::Debug for Caster {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl fmt::Display for Mount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.caster, self.mount)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mount(text: &str) -> Mount {
        text.parse().unwrap()
    }

    #[test]
    fn addresses_are_read() {
        let full = mount("ntrip://me:s%40c%3Aret%25@caster.example:8080/MOUNT0");
        assert_eq!((full.caster.address().as_str(), full.mount.as_str()), ("caster.example:8080", "MOUNT0"));
        assert_eq!(full.caster.user(), Some("me"));
        assert_eq!(full.caster.authorization().unwrap(), "Basic bWU6c0BjOnJldCU=");
        let bare = mount("ntrip://caster.example/M");
        assert_eq!((bare.caster.port, bare.caster.authorization()), (2101, None));
        assert_eq!(mount("ntrip://[::1]/M").caster.address(), "[::1]:2101");
        assert_eq!(mount("ntrip://[::1]:99/M").caster.address(), "[::1]:99");
        let careless = mount("ntrip://me:p@ss/word@host:1/M");
        assert_eq!(careless.caster.account.unwrap().password, "p@ss/word");
        assert_eq!("ntrip://host".parse::<Caster>().unwrap().to_string(), "ntrip://host:2101");
        assert!(full.caster.trust().is_none() && bare.caster.trusting(&Trust::default()).trust().is_none());
        let secured = mount("ntrips://me:x@[::1]/M");
        assert_eq!(secured.to_string(), "ntrips://[::1]:443/M");
        assert_eq!(secured.caster.trust(), Some(&Trust::default()));
        assert_eq!("ntrips://host:2102".parse::<Caster>().unwrap().to_string(), "ntrips://host:2102");
    }

    #[test]
    fn a_password_is_never_shown() {
        let full = mount("ntrip://me:secret@host:1/M");
        for shown in [format!("{full}"), format!("{full:?}"), format!("{:?}", full.caster)] {
            assert!(shown.contains("host:1") && !shown.contains("secret"), "{shown}");
        }
        for text in [
            "ntrip://me:secret@host",
            "ntrip://me:secret@host:1/",
            "ntrip://me:secret@host:99999/M",
            "ntrip://me:secret@:1/M",
            "ntrip://me:secret@host/M 1",
            "ntrip://me:secret%4@host/M",
            "ntrip://me:secret%0A@host/M",
            "ntrips://me:secret@host",
            "ntrips://me:secret@host:0/M",
            "ntripss://me:secret@host/M",
            "ntriq://me:secret@host/M",
        ] {
            let said = text.parse::<Mount>().unwrap_err().to_string();
            assert!(!said.contains("secret") && said.contains("ntrip://USER"), "{said}");
        }
        assert_eq!(without_password("tcp://a:b:c@d"), "tcp://a:…@d");
        assert_eq!(without_password("nothing"), "nothing");
    }
}
