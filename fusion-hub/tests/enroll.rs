//! `cofix-hub enroll`, and where `cofix-hub run` listens with and without certificates.

#![allow(clippy::unwrap_used, missing_docs)] // helpers of tests

#[path = "../../agent/tests/limits/mod.rs"]
mod limits;

use std::path::Path;

use assert_cmd::Command;

const SESSION: &str = "group = 'g'\n[[phone]]\nname = 'a'\n";

/// What a command of the hub says in a folder, and whether it succeeds.
fn hub(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let mut command = Command::cargo_bin("cofix-hub").unwrap();
    let output = command.current_dir(folder).args(arguments).timeout(limits::LIMIT).output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8_lossy(&text).into_owned())
}

#[test]
fn a_folder_is_written_and_needed() {
    let folder = tempfile::tempdir().unwrap();
    let (done, said) =
        hub(folder.path(), &["enroll", "g", "--hub-address", "127.0.0.1:7447", "--phone", "a", "b", "--qr"]);
    assert!(done && said.contains("a, b may speak") && said.contains('\u{2588}'), "{said}");
    let (done, said) = hub(folder.path(), &["enroll", "g", "--revoke", "b", "c"]);
    assert!(!done && said.contains("--revoke 'c': is not enrolled; there are a"), "{said}");
    assert!(folder.path().join("g.enrolled/b.cofix").exists(), "nothing is done when a part cannot be");

    std::fs::write(folder.path().join("s.toml"), SESSION.replace("'g'", "'h'")).unwrap();
    let (done, said) = hub(folder.path(), &["run", "s.toml", "--enrolled", "g.enrolled"]);
    assert!(!done && said.contains("is of group 'g', and the session of 'h'"), "{said}");
    std::fs::write(folder.path().join("s.toml"), SESSION).unwrap();
    let (done, said) = hub(folder.path(), &["run", "s.toml", "--enrolled", "nowhere"]);
    assert!(!done && said.contains("'cofix-hub enroll' makes such a folder"), "{said}");
    let plain = ["run", "s.toml", "--enrolled", "g.enrolled", "--listen", "tcp/127.0.0.1:0"];
    let (done, said) = hub(folder.path(), &plain);
    assert!(!done && said.contains("does not begin with tls/"), "{said}");
}

#[test]
fn beyond_this_computer_a_hub_listens_with_certificates_or_when_told_to() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.toml"), SESSION).unwrap();
    for endpoint in ["tcp/0.0.0.0:0", "tcp/[::]:0", "tcp/192.0.2.1:7447", "tcp/hub.example:7447"] {
        let (done, said) = hub(folder.path(), &["run", "s.toml", "--listen", endpoint]);
        assert!(!done, "{endpoint}");
        for part in [endpoint, "speak for every phone", "cofix-hub enroll", "--enrolled", "--insecure"] {
            assert!(said.contains(part), "{said}");
        }
    }
    // Told to, it tries: this address is nobody's.
    let told = ["run", "s.toml", "--listen", "tcp/192.0.2.1:7447", "--insecure"];
    let (done, said) = hub(folder.path(), &told);
    assert!(!done && said.contains("cannot listen on tcp/192.0.2.1:7447"), "{said}");
    let (done, said) = hub(folder.path(), &["run", "s.toml", "--insecure", "--enrolled", "x"]);
    assert!(!done && said.contains("cannot be used with"), "{said}");
}
