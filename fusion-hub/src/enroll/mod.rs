//! Who may speak to a hub: an authority of the group's own, and a certificate for the hub and for each phone.
//!
//! A folder holds all of it. The hub needs the authority's certificate, its own with its key, and the register; a phone needs its file alone; the authority's key is for
//! enrolling only.
//!
//! | file | what it is |
//! |:--|:--|
//! | `authority.pem`, `authority.key` | the authority |
//! | `hub.pem`, `hub.key` | the hub's certificate, for its addresses |
//! | `register.toml` | the phones, each with the name of its present certificate |
//! | `NAME.cofix` | a phone's certificate and key, and all that it needs to know ([`cofix_agent::join`]) |

mod certificates;
mod folder;
mod qr;
mod register;

use std::path::PathBuf;

use anyhow::{Context, bail};
use cofix_agent::clock;
use cofix_agent::join::{Join, compact, day};
use cofix_agent::publication::endpoint::host_and_port;
use cofix_common::time::{GpsTime, SECONDS_PER_DAY};
use cofix_common::wire::check_name;

use certificates::{Authority, Issued};
use folder::Folder;
pub use folder::open;
pub use register::{Member, Register};

/// How long an authority lasts, days. Its certificates end when it does.
const AUTHORITY_DAYS: u32 = 3_650;

/// What is asked of `cofix-hub enroll`.
#[derive(Clone, Debug, clap::Args)]
pub struct Arguments {
    /// Group, as the session file names it
    pub group: String,
    /// Address under which phones reach the hub; may be repeated. Needed the first time
    #[arg(long, value_name = "HOST:PORT")]
    pub hub_address: Vec<String>,
    /// Phone that may speak, by its name in the session file; several may follow. One that is enrolled gets a new certificate in place of its old one
    #[arg(long, value_name = "NAME", num_args = 1..)]
    pub phone: Vec<String>,
    /// Phone that may speak no more; several may follow
    #[arg(long, value_name = "NAME", num_args = 1..)]
    pub revoke: Vec<String>,
    /// Folder of keys and certificates [default: GROUP.enrolled]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// How long the certificates written now are valid, days
    #[arg(long, default_value_t = 365, value_parser = clap::value_parser!(u32).range(1..=3_650))]
    pub days: u32,
    /// Show each new phone's file as a QR code too, for 'cofix-agent --join' on the phone
    #[arg(long)]
    pub qr: bool,
}

/// Does what is asked. Returns what to say about it.
///
/// # Errors
/// When a name or address cannot be used, a phone to revoke is not enrolled, the folder is of another group, or a file cannot be read or written.
pub fn enroll(arguments: &Arguments) -> anyhow::Result<String> {
    check(arguments)?;
    let path = arguments.out.clone().unwrap_or_else(|| format!("{}.enrolled", arguments.group).into());
    let now = clock::now();
    let folder = Folder::create(&path)?;
    let mut register = folder.register()?.unwrap_or_else(|| Register::new(&arguments.group));
    if register.group != arguments.group {
        bail!("{}: is of group '{}', not of '{}'", path.display(), register.group, arguments.group);
    }
    if !arguments.hub_address.is_empty() {
        register.hub.clone_from(&arguments.hub_address);
    }
    if register.hub.is_empty() {
        bail!("--hub-address HOST:PORT is missing: where do phones reach the hub?");
    }
    // Before anything is done: a name that is not there is an error.
    arguments.revoke.iter().try_for_each(|phone| register.revoke(phone))?;
    let authority = authority(&folder, &mut register, now)?;
    let last = register.authority_expires;
    let expires = last.unwrap_or(now).min(now + f64::from(arguments.days) * SECONDS_PER_DAY);
    let hub = authority.hub(&register.hub, now, expires)?;
    folder.write_hub(&hub)?;
    register.hub_certificate = Some(hub.name);
    register.expires = Some(expires);
    folder.write_register(&register)?;
    let mut said = Vec::new();
    for phone in &arguments.revoke {
        folder.remove_phone(phone)?;
        said.push(format!("{phone}: may speak no more"));
    }
    for phone in &arguments.phone {
        let issued = authority.phone(phone, now, expires)?;
        let member = Member { name: phone.clone(), certificate: issued.name.clone(), expires: expires.iso() };
        let join = join(&register, phone, expires, issued, &authority);
        // Whoever may speak is known before there is a key for it.
        register.admit(member);
        folder.write_register(&register)?;
        said.push(format!("{phone}: {}", folder.write_phone(&join)?.display()));
        if arguments.qr {
            said.push(qr::text(&compact::line(&join).map_err(anyhow::Error::msg)?)?);
        }
    }
    said.push(summary(&register, &path, expires));
    Ok(said.join("\n") + "\n")
}

fn check(arguments: &Arguments) -> anyhow::Result<()> {
    check_name(&arguments.group).context("group")?;
    for phone in &arguments.phone {
        check_name(phone).context("--phone")?;
        if arguments.revoke.contains(phone) {
            bail!(
                "'{phone}' is named to be enrolled and to be revoked; an enrolled phone's old certificate ends by itself"
            );
        }
    }
    for address in &arguments.hub_address {
        let (_, port) = host_and_port(address)
            .map_err(|reason| anyhow::anyhow!("--hub-address '{address}': {reason}; write HOST:PORT"))?;
        if port == 0 {
            bail!("--hub-address '{address}': nothing answers on port 0");
        }
    }
    Ok(())
}

/// The folder's authority, or a new one.
fn authority(folder: &Folder, register: &mut Register, now: GpsTime) -> anyhow::Result<Authority> {
    if let Some(authority) = folder.authority(&register.group)? {
        return Ok(authority);
    }
    if !register.phones.is_empty() {
        bail!(
            "the authority's key is not there, and without it nobody can be enrolled; put it back, or begin with a new folder"
        );
    }
    let expires = now + f64::from(AUTHORITY_DAYS) * SECONDS_PER_DAY;
    let authority = Authority::new(&register.group, now, expires)?;
    register.authority_expires = Some(expires);
    folder.write_authority(&authority)?;
    Ok(authority)
}

fn join(register: &Register, phone: &str, expires: GpsTime, issued: Issued, authority: &Authority) -> Join {
    Join {
        group: register.group.clone(),
        phone: phone.to_owned(),
        hub: register.hub.clone(),
        expires,
        credentials: issued.credentials(authority),
    }
}

fn summary(register: &Register, path: &std::path::Path, expires: GpsTime) -> String {
    let names: Vec<&str> = register.phones.iter().map(|member| member.name.as_str()).collect();
    let day = day(expires);
    format!(
        "Group '{}' at {}: {} (certificates of today end on {day}).\n\
         Hub: cofix-hub run SESSION --enrolled {}; one that runs already takes the change when it is started again.",
        register.group,
        register.hub.join(", "),
        if names.is_empty() {
            "no phone may speak".to_owned()
        } else {
            format!("{} may speak", names.join(", "))
        },
        path.display()
    )
}

#[cfg(test)]
mod tests;
