use rcgen::{CertificateParams, KeyPair};

use super::*;

fn join() -> Join {
    let key = KeyPair::generate().unwrap();
    let certificate = CertificateParams::new(Vec::new()).unwrap().self_signed(&key).unwrap().pem();
    let credentials =
        Credentials { certificate: certificate.clone(), key: key.serialize_pem(), authority: certificate };
    Join {
        group: "my-drive".to_owned(),
        phone: "pixel".to_owned(),
        hub: vec!["192.168.1.5:7447".to_owned(), "[fe80::1]:7447".to_owned()],
        expires: "2027-01-31T12:00:00".parse().unwrap(),
        credentials,
    }
}

#[test]
fn the_file_and_the_line_are_read_back() {
    let join = join();
    let text = join.text().unwrap();
    assert_eq!(Join::parse(&text), Ok(join.clone()));
    let line = compact::line(&join).unwrap();
    assert!(line.starts_with("cofix1:") && !line.contains(char::is_whitespace), "{line}");
    let read = Join::parse(&format!("  {line}\n")).unwrap();
    let der = |pem: &str| pem.replace("\r\n", "\n");
    assert_eq!(der(&read.credentials.certificate), der(&join.credentials.certificate));
    assert_eq!(der(&read.credentials.key), der(&join.credentials.key));
    assert_eq!((read.hub, read.expires), (join.hub, join.expires));
    assert_eq!(read.group + "/" + &read.phone, "my-drive/pixel");
}

#[test]
fn what_is_no_such_file_is_refused_without_showing_its_key() {
    let good = join().text().unwrap();
    let line = compact::line(&join()).unwrap();
    for (text, said) in [
        (String::new(), "not a file for --join"),
        (good.replace("version = 1", "version = 9"), "version 9"),
        (good.replace("my-drive", "my/drive"), "'/'"),
        (good.replace("192.168.1.5:7447", "192.168.1.5"), "there is no port"),
        (good.replace("2027-01-31", "soon"), "no time"),
        (good.replace("[\n", "[] # "), "not a file"),
        (good.replace("key = ", "keys = "), "unknown field"),
        (line[..line.len() - 10].to_owned(), "the line is damaged"),
        (format!("{line}AAAA"), "the line is damaged"),
        ("cofix1:!".to_owned(), "the line is damaged"),
    ] {
        let error = Join::parse(&text).unwrap_err();
        assert!(error.contains(said) && !error.contains("PRIVATE"), "{error}");
    }
}

#[test]
fn the_end_of_a_certificate_is_told_two_weeks_before() {
    let end: GpsTime = "2027-01-31T12:00:00".parse().unwrap();
    let said = |days: f64| about_expiry(end, end + days * SECONDS_PER_DAY);
    assert_eq!(said(-14.5), None);
    assert_eq!(said(-13.5).unwrap(), "the certificate ends on 2027-01-31, in 13.5 days");
    assert_eq!(said(0.5).unwrap(), "the certificate ended on 2027-01-31");
}
