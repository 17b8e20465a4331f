//! The files of an enrolled group. Keys are readable by their owner only.

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use cofix_agent::join::Join;
use cofix_agent::publication::secured::Credentials;
use tempfile::NamedTempFile;

use super::certificates::{Authority, Issued};
use super::register::Register;

const REGISTER: &str = "register.toml";
const AUTHORITY: &str = "authority.pem";
const AUTHORITY_KEY: &str = "authority.key";
const HUB: &str = "hub.pem";
const HUB_KEY: &str = "hub.key";

/// The folder of an enrolled group.
pub(super) struct Folder {
    path: PathBuf,
}

impl Folder {
    /// One that is there, or a new one.
    pub(super) fn create(path: &Path) -> anyhow::Result<Self> {
        let mut builder = std::fs::DirBuilder::new();
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        match builder.create(path) {
            Err(error) if error.kind() != ErrorKind::AlreadyExists => {
                Err(error).with_context(|| format!("{}: cannot be created", path.display()))
            }
            _ => Ok(Self::at(path)),
        }
    }

    /// One that should be there.
    pub(super) fn at(path: &Path) -> Self {
        Self { path: path.to_owned() }
    }

    /// The register, if there is one.
    pub(super) fn register(&self) -> anyhow::Result<Option<Register>> {
        let Some(text) = self.read(REGISTER)? else { return Ok(None) };
        Register::parse(&text).with_context(|| self.path.join(REGISTER).display().to_string()).map(Some)
    }

    /// The authority, if there is one.
    pub(super) fn authority(&self, group: &str) -> anyhow::Result<Option<Authority>> {
        match (self.read(AUTHORITY)?, self.read(AUTHORITY_KEY)?) {
            (Some(certificate), Some(key)) => Authority::of(group, certificate, key).map(Some),
            _ => Ok(None),
        }
    }

    /// What the hub shows in TLS, and whom it believes.
    pub(super) fn hub(&self) -> anyhow::Result<Credentials> {
        let needed = |name: &str| {
            let missing =
                || format!("{}: is missing; 'cofix-hub enroll' writes it", self.path.join(name).display());
            self.read(name)?.with_context(missing)
        };
        Ok(Credentials { certificate: needed(HUB)?, key: needed(HUB_KEY)?, authority: needed(AUTHORITY)? })
    }

    pub(super) fn write_authority(&self, authority: &Authority) -> anyhow::Result<()> {
        self.write(AUTHORITY_KEY, &authority.key)?;
        self.write(AUTHORITY, &authority.certificate).map(drop)
    }

    pub(super) fn write_hub(&self, hub: &Issued) -> anyhow::Result<()> {
        self.write(HUB_KEY, &hub.key)?;
        self.write(HUB, &hub.certificate).map(drop)
    }

    pub(super) fn write_register(&self, register: &Register) -> anyhow::Result<()> {
        self.write(REGISTER, &register.text()?).map(drop)
    }

    /// Writes the file for a phone. Returns where.
    pub(super) fn write_phone(&self, join: &Join) -> anyhow::Result<PathBuf> {
        self.write(&phone_file(&join.phone), &join.text()?)
    }

    /// Removes the file of a phone, if it is there still.
    pub(super) fn remove_phone(&self, phone: &str) -> anyhow::Result<()> {
        let path = self.path.join(phone_file(phone));
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(error).with_context(|| format!("{}: cannot be removed", path.display()))
            }
            _ => Ok(()),
        }
    }

    fn read(&self, name: &str) -> anyhow::Result<Option<String>> {
        let path = self.path.join(name);
        match std::fs::read_to_string(&path) {
            Ok(text) => Ok(Some(text)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error).with_context(|| format!("{}: cannot be read", path.display())),
        }
    }

    /// Replaces a file as a whole. Nobody but its owner may read it: so are the files made of which this becomes one.
    fn write(&self, name: &str, text: &str) -> anyhow::Result<PathBuf> {
        let path = self.path.join(name);
        let put = || -> std::io::Result<()> {
            let mut file = NamedTempFile::new_in(&self.path)?;
            file.write_all(text.as_bytes())?;
            file.as_file().sync_all()?;
            file.persist(&path).map_err(|error| error.error).map(drop)
        };
        put().with_context(|| format!("{}: cannot be written", path.display()))?;
        Ok(path)
    }
}

fn phone_file(phone: &str) -> String {
    format!("{phone}.cofix")
}

/// The register and the hub's credentials of a folder that `cofix-hub enroll` has written.
///
/// # Errors
/// When a file is missing or cannot be used.
pub fn open(path: &Path) -> anyhow::Result<(Register, Credentials)> {
    let folder = Folder::at(path);
    let Some(register) = folder.register()? else {
        bail!("{}: has no {REGISTER}; 'cofix-hub enroll' makes such a folder", path.display());
    };
    Ok((register, folder.hub()?))
}
