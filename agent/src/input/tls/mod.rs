//! TLS around a connection (versions 1.3 and 1.2: RFC 8446, RFC 5246). Nothing is sent before the server's certificate has been verified.

mod trust;

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use rustls::pki_types::ServerName;
use rustls::{CertificateError, ClientConfig, ClientConnection};

use super::connection::{DialError, is_no_news};
use super::tcp;
use crate::Stop;

pub use trust::{Trust, TrustError};

/// Longest wait for the end of the handshake.
const HANDSHAKE: Duration = Duration::from_secs(10);
/// Advice for a server that does not seem to speak TLS.
const PERHAPS_PLAIN: &str = "is this its port for TLS? one without is written ntrip://";

/// Connects to a host and verifies its name. Reads return within [`super::LOOK`].
pub(super) fn open(host: &str, port: u16, trust: &Trust, stop: &Stop) -> Result<Secured, DialError> {
    let config = trust.client_config().map_err(DialError::Refused)?;
    let name = ServerName::try_from(host.trim_matches(['[', ']']).to_owned())
        .map_err(|_| DialError::Refused("its name is none that a certificate can have".to_owned()))?;
    let tcp = tcp::open(&format!("{host}:{port}"))?;
    Secured::over(tcp, config, name, stop)
}

/// A connection to a server whose name has been verified.
pub(super) struct Secured {
    tcp: TcpStream,
    session: ClientConnection,
}

impl Secured {
    fn over(
        tcp: TcpStream,
        config: Arc<ClientConfig>,
        name: ServerName<'static>,
        stop: &Stop,
    ) -> Result<Self, DialError> {
        let session = ClientConnection::new(config, name).map_err(|error| failed(&error.to_string()))?;
        let mut secured = Self { tcp, session };
        let began = Instant::now();
        while secured.session.is_handshaking() || secured.session.wants_write() {
            if stop.is_requested() {
                return Err(failed("stopped"));
            }
            if began.elapsed() > HANDSHAKE {
                let waited_s = HANDSHAKE.as_secs();
                return Err(failed(&format!("no TLS handshake within {waited_s} s: {PERHAPS_PLAIN}")));
            }
            match secured.turn() {
                Err(error) if !is_no_news(&error) => return Err(explained(&error)),
                _ => {}
            }
        }
        Ok(secured)
    }

    /// Writes pending bytes, or else reads once.
    fn turn(&mut self) -> io::Result<()> {
        if self.session.wants_write() {
            return self.session.write_tls(&mut self.tcp).map(drop);
        }
        if self.session.read_tls(&mut self.tcp)? == 0 && self.session.is_handshaking() {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        self.session.process_new_packets().map(drop).map_err(|error| {
            // The other end may hear why, if it still listens.
            let _ = self.session.write_tls(&mut self.tcp);
            io::Error::new(io::ErrorKind::InvalidData, error)
        })
    }

    /// Takes decrypted bytes that wait.
    fn waiting(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.session.reader().read(buffer) {
            // A stream has no end of its own: it does not matter whether the server took its leave.
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(0),
            outcome => outcome,
        }
    }
}

impl Read for Secured {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.waiting(buffer) {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            outcome => return outcome,
        }
        self.turn()?;
        self.waiting(buffer)
    }
}

impl Write for Secured {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.session.writer().write(bytes)?;
        self.flush()?;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        while self.session.wants_write() {
            self.session.write_tls(&mut self.tcp)?;
        }
        self.tcp.flush()
    }
}

fn failed(reason: &str) -> DialError {
    DialError::Failed(reason.to_owned())
}

/// The reason why the handshake failed, with advice.
fn explained(error: &io::Error) -> DialError {
    if matches!(error.kind(), io::ErrorKind::UnexpectedEof | io::ErrorKind::ConnectionReset) {
        return failed(&format!(
            "the caster closed the connection during the TLS handshake: {PERHAPS_PLAIN}"
        ));
    }
    match error.get_ref().and_then(|inner| inner.downcast_ref()) {
        Some(rustls::Error::InvalidCertificate(fault)) => distrusted(fault),
        Some(rustls::Error::InvalidMessage(_)) => {
            DialError::Refused(format!("the caster does not answer in TLS: {PERHAPS_PLAIN}"))
        }
        Some(rustls::Error::AlertReceived(alert)) => {
            failed(&format!("the caster ends the TLS handshake: {alert:?}"))
        }
        _ => failed(&format!("TLS: {error}")),
    }
}

/// Advice for a refused certificate.
fn distrusted(fault: &CertificateError) -> DialError {
    use CertificateError as Fault;
    match fault {
        // The latter: of an authority that was made anew under its old name.
        Fault::UnknownIssuer | Fault::BadSignature => DialError::Refused(
            "nobody who is trusted here vouches for the caster's certificate: if it is from an authority of your own, name that one's \
             certificate with --caster-ca FILE"
                .to_owned(),
        ),
        Fault::NotValidForName | Fault::NotValidForNameContext { .. } => {
            DialError::Refused(format!("the caster's certificate is for another name ({fault}): write the host as the certificate has it"))
        }
        // The clock of a computer without a battery may be put right later.
        Fault::Expired
        | Fault::ExpiredContext { .. }
        | Fault::NotValidYet
        | Fault::NotValidYetContext { .. } => failed(&format!(
            "the caster's certificate is not valid now ({fault}): is this computer's clock right?"
        )),
        _ => DialError::Refused(format!(
            "the caster's certificate is not accepted ({fault}): if it made that itself, name it with --caster-ca FILE"
        )),
    }
}
