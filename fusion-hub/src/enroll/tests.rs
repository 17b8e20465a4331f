use std::path::Path;

use super::*;

fn arguments(out: &Path) -> Arguments {
    Arguments {
        group: "g".to_owned(),
        hub_address: vec!["192.168.1.5:7447".to_owned(), "hub.example:7448".to_owned()],
        phone: vec!["a".to_owned(), "b".to_owned()],
        revoke: Vec::new(),
        out: Some(out.to_owned()),
        days: 365,
        qr: false,
    }
}

fn names(folder: &Path) -> Vec<String> {
    open(folder).unwrap().0.phones.into_iter().map(|member| member.name).collect()
}

fn certificate_of(folder: &Path, phone: &str) -> String {
    let members = open(folder).unwrap().0.phones;
    members.into_iter().find(|member| member.name == phone).unwrap().certificate
}

#[test]
fn every_phone_gets_a_file_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("g.enrolled");
    let said = enroll(&arguments(&path)).unwrap();
    assert!(said.contains("a, b may speak") && said.contains("--enrolled"), "{said}");
    let (register, hub) = open(&path).unwrap();
    assert_eq!(register.hub, ["192.168.1.5:7447", "hub.example:7448"]);
    for phone in ["a", "b"] {
        let join = Join::read(&path.join(format!("{phone}.cofix"))).unwrap();
        assert_eq!((join.group.as_str(), join.phone.as_str()), ("g", phone));
        assert_eq!(join.endpoints(), ["tls/192.168.1.5:7447", "tls/hub.example:7448"]);
        assert_eq!(join.credentials.authority, hub.authority);
        assert_ne!(join.credentials.key, hub.key);
        let text = std::fs::read_to_string(path.join(format!("{phone}.cofix"))).unwrap();
        let authority_key = std::fs::read_to_string(path.join("authority.key")).unwrap();
        assert!(!text.contains(authority_key.lines().nth(1).unwrap()), "the authority's key is in it");
    }
}

#[cfg(unix)]
#[test]
fn keys_are_readable_by_their_owner_alone() {
    use std::os::unix::fs::PermissionsExt;

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("g.enrolled");
    enroll(&arguments(&path)).unwrap();
    let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&path), 0o700);
    for name in ["authority.key", "hub.key", "a.cofix", "b.cofix"] {
        assert_eq!(mode(&path.join(name)), 0o600, "{name}");
    }
}

#[test]
fn phones_are_added_and_revoked_later() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("g.enrolled");
    enroll(&arguments(&path)).unwrap();
    let authority = std::fs::read_to_string(path.join("authority.key")).unwrap();
    let later = |phone: &[&str], revoke: &[&str]| {
        let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
        let (phone, revoke) = (owned(phone), owned(revoke));
        enroll(&Arguments { hub_address: Vec::new(), phone, revoke, ..arguments(&path) })
    };
    let first = certificate_of(&path, "a");
    let other = certificate_of(&path, "b");
    later(&["c"], &["a"]).unwrap();
    assert_eq!(names(&path), ["b", "c"]);
    assert!(!path.join("a.cofix").exists() && path.join("c.cofix").exists());
    assert_eq!(certificate_of(&path, "b"), other, "who is not named keeps its certificate");
    assert!(later(&[], &["a"]).unwrap_err().to_string().contains("is not enrolled; there are b, c"));
    later(&["a"], &[]).unwrap();
    assert_ne!(certificate_of(&path, "a"), first, "a revoked certificate does not come back");
    let second = certificate_of(&path, "a");
    later(&["a"], &[]).unwrap();
    assert_ne!(certificate_of(&path, "a"), second);
    assert_eq!(names(&path), ["b", "c", "a"]);
    assert_eq!(std::fs::read_to_string(path.join("authority.key")).unwrap(), authority);
    assert!(later(&["b"], &["b"]).is_err());
}

#[test]
fn what_cannot_be_enrolled_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("g.enrolled");
    let refused = |arguments: Arguments| enroll(&arguments).unwrap_err().to_string();
    let none = Arguments { hub_address: Vec::new(), ..arguments(&path) };
    assert!(refused(none).contains("--hub-address HOST:PORT is missing"));
    for address in ["hub.example", "hub.example:0", ":1", "::1:5"] {
        let error = refused(Arguments { hub_address: vec![address.to_owned()], ..arguments(&path) });
        assert!(error.contains(address), "{error}");
    }
    assert!(refused(Arguments { phone: vec!["a/b".to_owned()], ..arguments(&path) }).contains("--phone"));
    enroll(&arguments(&path)).unwrap();
    let error = refused(Arguments { group: "other".to_owned(), ..arguments(&path) });
    assert!(error.contains("is of group 'g', not of 'other'"), "{error}");
    std::fs::remove_file(path.join("authority.key")).unwrap();
    assert!(refused(arguments(&path)).contains("authority's key is not there"));
    let error = open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("has no register.toml"), "{error}");
}

#[test]
fn certificates_that_end_soon_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("g.enrolled");
    enroll(&Arguments { days: 10, ..arguments(&path) }).unwrap();
    let one = Arguments { phone: vec!["c".to_owned()], ..arguments(&path) };
    enroll(&one).unwrap();
    let register = open(&path).unwrap().0;
    let now = clock::now();
    let said = register.expiries(now);
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(said[0].starts_with("a: the certificate ends on ") && said[1].starts_with("b: "), "{said:?}");
    let ended = register.expiries(now + 11.0 * SECONDS_PER_DAY);
    assert!(ended[0].starts_with("a: the certificate ended on "), "{ended:?}");
    assert_eq!(register.expiries(now + -SECONDS_PER_DAY).len(), 2);
    // No certificate outlives its authority.
    enroll(&Arguments { days: 3_650, ..one }).unwrap();
    let register = open(&path).unwrap().0;
    assert!(register.expires <= register.authority_expires);
}

#[test]
fn a_file_fits_a_qr_code() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("g.enrolled");
    let said = enroll(&Arguments { qr: true, phone: vec!["a".to_owned()], ..arguments(&path) }).unwrap();
    let join = Join::read(&path.join("a.cofix")).unwrap();
    let line = compact::line(&join).unwrap();
    assert!(line.len() < 1_600, "{} characters", line.len());
    // As wide as a terminal of usual fonts on a large screen.
    let width = said.lines().map(|line| line.chars().count()).filter(|&width| width > 100).max().unwrap();
    assert!(said.contains('\u{2588}') && width <= 160, "{width} columns");
    // The longest names and two addresses fit too.
    let long =
        Join { group: "g".repeat(64), phone: "p".repeat(64), hub: vec!["h".repeat(64) + ":7447"; 2], ..join };
    qr::text(&compact::line(&long).unwrap()).unwrap();
}
