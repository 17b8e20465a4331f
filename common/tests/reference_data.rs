//! Tests against recordings and reference vectors are skipped where those are not beside the repository. Where they must not be,
//! `COFIX_REQUIRE_DATA=1` makes their absence a failure.
#![allow(clippy::panic)]

use std::path::Path;

const FOLDERS: [&str; 2] = [
    concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data"),
    concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/oracle"),
];

#[test]
fn reference_data_is_here_where_it_is_required() {
    let required = std::env::var("COFIX_REQUIRE_DATA").is_ok_and(|value| value == "1");
    for folder in FOLDERS.into_iter().filter(|folder| !Path::new(folder).is_dir()) {
        assert!(!required, "{folder} is missing, so tests against it would be skipped");
        println!("skipped: {folder} is not here");
    }
}
