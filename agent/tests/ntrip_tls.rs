//! NTRIP in TLS against casters of our own on loopback: who is believed, who is not, and what is said then.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod caster;
mod limits;
mod recordings;

use std::io::Write;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use cofix_agent::Stop;
use cofix_agent::input::Trust;
use cofix_agent::input::ntrip::{Caster, RoverPosition, sourcetable};
use cofix_common::skips::Reason;
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair};
use rustls::ServerConfig;
use rustls::crypto::ring;
use rustls::pki_types::{PrivateKeyDer, PrivatePkcs8KeyDer};

use caster::{CHUNKED, NOT_READ, TestCaster, chunked, exhaust, frames, head, in_portions};

/// An authority, and the file that its certificate is in.
struct Authority {
    folder: tempfile::TempDir,
    issuer: CertifiedIssuer<'static, KeyPair>,
}

impl Authority {
    fn new() -> Self {
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let issuer = CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap();
        let authority = Self { folder: tempfile::tempdir().unwrap(), issuer };
        std::fs::write(authority.path(), authority.issuer.pem()).unwrap();
        authority
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("ca.pem")
    }

    fn trust(&self) -> Trust {
        Trust::with_file(&self.path()).unwrap()
    }

    /// A caster's configuration with a certificate for a name, valid in the given years.
    fn vouches_for(&self, name: &str, years: std::ops::Range<i32>) -> Arc<ServerConfig> {
        let mut params = CertificateParams::new([name.to_owned()]).unwrap();
        params.not_before = rcgen::date_time_ymd(years.start, 1, 1);
        params.not_after = rcgen::date_time_ymd(years.end, 1, 1);
        let key = KeyPair::generate().unwrap();
        let certificate = params.signed_by(&key, &self.issuer).unwrap();
        server(certificate.der().clone(), &key)
    }
}

fn server(certificate: rustls::pki_types::CertificateDer<'static>, key: &KeyPair) -> Arc<ServerConfig> {
    let key = PrivateKeyDer::Pkcs8(PrivatePkcs8KeyDer::from(key.serialize_der()));
    let config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(vec![certificate], key)
        .unwrap();
    Arc::new(config)
}

const NOW: std::ops::Range<i32> = 2020..4000;

/// What is said in the end of a stream that gives nothing; never the password.
fn failure(records: &mut cofix_agent::source::records::Records) -> String {
    let error = exhaust(records).unwrap_err().to_string();
    assert!(!error.contains("cret"), "{error}");
    error
}

#[test]
fn a_caster_with_a_trusted_certificate_is_read_in_either_revision_and_again_after_a_cut() {
    let authority = Authority::new();
    let config = authority.vouches_for("127.0.0.1", NOW);
    let second = [head(CHUNKED), chunked(&frames(300), 7)].concat();
    let cut = second.len() - 200;
    let caster = TestCaster::start_secured(
        vec![
            in_portions(&second[..cut], 97),
            vec![head("HTTP/1.1 505 HTTP Version not supported")],
            vec![[head("ICY 200 OK"), frames(2)].concat()],
        ],
        &config,
    );
    let mut records = caster.secured_records(&authority.trust(), 3);
    exhaust(&mut records).unwrap();
    let skips = records.skips();
    let all = (300 + 2) as u64;
    assert!((all - 20..all).contains(&skips.count(NOT_READ)), "{skips}");
    assert_eq!(skips.count(Reason::ConnectionOpenedAgain), 1, "{skips}");
    let requests = caster.requests();
    assert!(requests[0].contains("Authorization: Basic bWU6c2U6Y3JldA=="), "{}", requests[0]);
    assert!(requests[2].starts_with("GET /BASE HTTP/1.0\r\n"), "{}", requests[2]);
}

/// Such as `openssl req -x509` makes: an authority's certificate for no name, shown by the caster itself.
#[test]
fn a_caster_with_a_certificate_of_its_own_is_believed_when_that_is_given() {
    let authority = Authority::new();
    let config = server(authority.issuer.der().clone(), authority.issuer.key());
    let caster = TestCaster::start_secured(vec![vec![[head("ICY 200 OK"), frames(2)].concat()]], &config);
    let mut records = caster.secured_records(&authority.trust(), 1);
    exhaust(&mut records).unwrap();
    assert_eq!(records.skips().count(NOT_READ), 2);
    caster.requests();
    // Another one of the same kind is not.
    let other = Authority::new();
    let config = server(other.issuer.der().clone(), other.issuer.key());
    let caster = TestCaster::start_secured(vec![vec![head("ICY 200 OK")]], &config);
    let said = failure(&mut caster.secured_records(&authority.trust(), 1_000_000));
    assert!(said.contains("certificate is not accepted") && said.contains("--caster-ca FILE"), "{said}");
    assert_eq!(caster.requests(), [""]);
}

#[test]
fn a_caster_that_is_not_believed_hears_nothing_and_the_user_what_to_do() {
    let (authority, other) = (Authority::new(), Authority::new());
    for (trust, config, said) in [
        (Trust::default(), authority.vouches_for("127.0.0.1", NOW), "--caster-ca FILE"),
        (other.trust(), authority.vouches_for("127.0.0.1", NOW), "--caster-ca FILE"),
        (authority.trust(), authority.vouches_for("caster.example", NOW), "for another name"),
    ] {
        let caster = TestCaster::start_secured(vec![vec![head("ICY 200 OK")]], &config);
        // A second attempt would wait for a caster that is gone for ever.
        let error = failure(&mut caster.secured_records(&trust, 1_000_000));
        assert!(
            error.contains(said) && error.contains("ntrips://127.0.0.1:"),
            "expected '{said}' in: {error}"
        );
        assert_eq!(caster.requests(), [""]);
    }
    for years in [2010..2020, 3990..4000] {
        let config = authority.vouches_for("127.0.0.1", years);
        let caster = TestCaster::start_secured(vec![vec![], vec![]], &config);
        let error = failure(&mut caster.secured_records(&authority.trust(), 2));
        assert!(error.contains("clock right?") && error.contains("2 attempts"), "{error}");
        assert_eq!(caster.requests(), ["", ""]);
    }
}

#[test]
fn a_caster_in_the_clear_behind_ntrips_is_noticed() {
    let authority = Authority::new();
    // Answers, closes, or waits for the end of a request that never comes.
    for (answer, said) in [
        (Some(b"HTTP/1.1 400 Bad Request\r\n\r\n".to_vec()), "does not answer in TLS"),
        (Some(Vec::new()), "closed the connection during the TLS handshake"),
        (None, "no TLS handshake within 10 s"),
    ] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let thread = limits::spawn(move || {
            let (mut connection, _) = listener.accept().unwrap();
            let mut first = [0; 5];
            std::io::Read::read_exact(&mut connection, &mut first).unwrap();
            assert_eq!(first[..2], [22, 3], "nothing but a handshake");
            match answer {
                Some(answer) => connection.write_all(&answer).unwrap(),
                None => drop(std::io::copy(&mut connection, &mut std::io::sink())),
            }
            Vec::new()
        });
        let caster = TestCaster { address, thread };
        let error = failure(&mut caster.secured_records(&authority.trust(), 1));
        assert!(error.contains(said) && error.contains("ntrip://"), "expected '{said}' in: {error}");
        caster.requests();
    }
}

#[test]
fn a_caster_in_tls_behind_ntrip_is_noticed() {
    let config = Authority::new().vouches_for("127.0.0.1", NOW);
    let caster = TestCaster::start_secured(vec![vec![]], &config);
    let error = failure(&mut caster.records(&RoverPosition::default(), 1));
    assert!(error.contains("ntrips://"), "{error}");
    caster.requests();
    let alert = vec![21, 3, 3, 0, 2, 2, 70];
    let caster = TestCaster::start(vec![vec![alert]]);
    let error = failure(&mut caster.records(&RoverPosition::default(), 1_000_000));
    assert!(error.contains("speaks TLS at this port: write ntrips://"), "{error}");
    caster.requests();
}

#[test]
fn a_request_to_stop_ends_a_handshake() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let caster = TestCaster { address, thread: limits::spawn(Vec::new) };
    let stop = Stop::default();
    let asked = stop.clone();
    let asking = limits::spawn(move || {
        let connection = listener.accept().unwrap();
        asked.request();
        connection
    });
    let began = Instant::now();
    let mut records = caster.secured_records(&Trust::default(), 1);
    assert!(records.next(&stop).unwrap().is_none());
    assert!(began.elapsed() < Duration::from_secs(5));
    asking.join().unwrap();
}

const TABLE: &str = "SOURCETABLE 200 OK\r\n\r\nSTR;BASE;Here;RTCM 3.3;1005(1);2;GPS;n;DEU;49.1;12.9;0;0;x;none;B;N;9600;\r\nENDSOURCETABLE\r\n";

#[test]
fn sourcetables_come_in_tls_too() {
    let authority = Authority::new();
    let config = authority.vouches_for("127.0.0.1", NOW);
    let caster = TestCaster::start_secured(vec![in_portions(TABLE.as_bytes(), 11)], &config);
    let address: Caster = format!("ntrips://{}", caster.address).parse().unwrap();
    let table = sourcetable(&address.trusting(&authority.trust()), &Stop::default()).unwrap();
    assert_eq!(table.streams[0].mount, "BASE");
    caster.requests();
}

fn command(arguments: &[&str]) -> assert_cmd::assert::Assert {
    assert_cmd::Command::new(env!("CARGO_BIN_EXE_cofix-agent"))
        .args(arguments)
        .timeout(limits::LIMIT)
        .assert()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn the_command_takes_an_authority_for_casters_in_tls() {
    let authority = Authority::new();
    let config = authority.vouches_for("127.0.0.1", NOW);
    let caster = TestCaster::start_secured(vec![vec![TABLE.as_bytes().to_vec()]], &config);
    let (address, ca) = (format!("ntrips://me:secret@{}", caster.address), authority.path());
    let listed = command(&["sourcetable", &address, "--caster-ca", text(&ca)]).success();
    let listed = String::from_utf8(listed.get_output().stdout.clone()).unwrap();
    assert!(listed.contains("BASE"), "{listed}");
    caster.requests();

    let caster = TestCaster::start_secured(vec![vec![]], &config);
    let address = format!("ntrips://me:secret@{}", caster.address);
    let missing = authority.folder.path().join("missing.pem");
    let agent = ["--group", "g", "--phone", "p", "--observations"];
    for (arguments, said) in [
        (vec!["sourcetable", &address], "--caster-ca FILE"),
        (vec!["sourcetable", &address, "--caster-ca", text(&missing)], "missing.pem: cannot read"),
        (vec!["sourcetable", "ntrip://127.0.0.1:9", "--caster-ca", text(&ca)], "no ntrips:// is named"),
        ([&agent[..], &["-", "--caster-ca", text(&ca)]].concat(), "no ntrips:// is named"),
        (
            [&agent[..], &["-", "--corrections", "ntrips://me:secret@h/M", "--caster-ca", text(&missing)]]
                .concat(),
            "missing.pem: cannot read",
        ),
    ] {
        let failed = command(&arguments).code(1);
        let error = String::from_utf8(failed.get_output().stderr.clone()).unwrap();
        assert!(error.contains(said) && !error.contains("secret"), "expected '{said}' in: {error}");
    }
    caster.requests();
}
