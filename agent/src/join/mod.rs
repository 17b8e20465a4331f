//! What a phone needs to join a group: where the hub is, who the phone is, and whom it believes.
//!
//! `cofix-hub enroll` writes it as a file of text (`NAME.cofix`, TOML) and, for a QR code, in one line (see [`compact`]); both are read. Whoever has it
//! is that phone.

pub mod compact;

use std::path::{Path, PathBuf};

use cofix_common::time::{GpsTime, SECONDS_PER_DAY};
use cofix_common::wire::{KeyNameError, check_name};
use serde::{Deserialize, Serialize};

use crate::publication::endpoint::{host_and_port, secured_endpoints};
use crate::publication::secured::Credentials;

/// Version of the file and of the line.
const VERSION: u32 = 1;
/// Longest file that is read, bytes.
const MAXIMUM_BYTES: u64 = 64 * 1024;
/// How long before its end it is said that a certificate ends, days.
pub const WARNING_DAYS: f64 = 14.0;

/// What a phone needs to join a group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Join {
    /// The group.
    pub group: String,
    /// The phone's name in it.
    pub phone: String,
    /// Where the hub is, `HOST:PORT`: the first that answers is taken.
    pub hub: Vec<String>,
    /// When the certificate ends.
    pub expires: GpsTime,
    /// The phone's certificate and key, and the group's authority.
    pub credentials: Credentials,
}

/// Why a file cannot be joined with.
#[derive(Debug, thiserror::Error)]
pub enum JoinError {
    /// It cannot be read.
    #[error("{}: cannot be read: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        cause: std::io::Error,
    },
    /// It is not what `cofix-hub enroll` writes.
    #[error("{}: {reason}; write it anew with 'cofix-hub enroll'", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

/// The file.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Text {
    version: u32,
    group: String,
    phone: String,
    hub: Vec<String>,
    expires: String,
    certificate: String,
    key: String,
    authority: String,
}

impl Join {
    /// Reads what `cofix-hub enroll` has written, or a file with the line of its QR code.
    ///
    /// # Errors
    /// [`JoinError`].
    pub fn read(path: &Path) -> Result<Self, JoinError> {
        let read = |cause| JoinError::Read { path: path.to_owned(), cause };
        let invalid = |reason| JoinError::Invalid { path: path.to_owned(), reason };
        let bytes = std::fs::metadata(path).map_err(read)?.len();
        if bytes > MAXIMUM_BYTES {
            return Err(invalid(format!("it has {bytes} bytes, more than {MAXIMUM_BYTES}")));
        }
        let text = std::fs::read_to_string(path).map_err(read)?;
        Self::parse(&text).map_err(invalid)
    }

    /// Reads the text of a file, or of a QR code.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        let join = if compact::is_begun_by(text) { compact::parse(text)? } else { parse_text(text)? };
        let name = |error: KeyNameError| error.to_string();
        check_name(&join.group).map_err(name)?;
        check_name(&join.phone).map_err(name)?;
        if join.hub.is_empty() {
            return Err("it names no address of the hub".to_owned());
        }
        for address in &join.hub {
            host_and_port(address).map_err(|reason| format!("the hub's address '{address}': {reason}"))?;
        }
        Ok(join)
    }

    /// The text of the file.
    ///
    /// # Errors
    /// When it cannot be written as TOML.
    pub fn text(&self) -> Result<String, toml::ser::Error> {
        let Credentials { certificate, key, authority } = self.credentials.clone();
        let body = toml::to_string_pretty(&Text {
            version: VERSION,
            group: self.group.clone(),
            phone: self.phone.clone(),
            hub: self.hub.clone(),
            expires: self.expires.iso(),
            certificate,
            key,
            authority,
        })?;
        Ok(format!(
            "# For cofix-agent --join. Whoever has this file is the phone '{}': keep it from others.\n{body}",
            self.phone
        ))
    }

    /// Zenoh's endpoints of the hub.
    pub fn endpoints(&self) -> Vec<String> {
        secured_endpoints(&self.hub)
    }
}

fn parse_text(text: &str) -> Result<Join, String> {
    let read: Text = toml::from_str(text).map_err(|error| {
        // The text itself, which the error would show, holds a key.
        format!("not a file for --join: {}", error.message())
    })?;
    if read.version != VERSION {
        return Err(format!("version {}, and this program reads {VERSION}", read.version));
    }
    let expires = read.expires.parse().map_err(|_| format!("no time: '{}'", read.expires))?;
    let Text { group, phone, hub, certificate, key, authority, .. } = read;
    Ok(Join { group, phone, hub, expires, credentials: Credentials { certificate, key, authority } })
}

/// `YYYY-MM-DD`, GPS time.
pub fn day(time_gps: GpsTime) -> String {
    time_gps.iso().chars().take(10).collect()
}

/// What to say of a certificate that ends at `expires`, if it has ended or ends within [`WARNING_DAYS`].
pub fn about_expiry(expires: GpsTime, now: GpsTime) -> Option<String> {
    let days = (expires - now) / SECONDS_PER_DAY;
    let day = day(expires);
    if days <= 0.0 {
        Some(format!("the certificate ended on {day}"))
    } else if days <= WARNING_DAYS {
        Some(format!("the certificate ends on {day}, in {days:.1} days"))
    } else {
        None
    }
}

#[cfg(test)]
mod tests;
