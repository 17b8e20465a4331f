//! Every target on its seeds, on their beginnings and on seeded mutations of them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stderr)] // helpers of tests

use std::panic::catch_unwind;
use std::path::Path;

use cofix_fuzz::mutation::mutate;
use cofix_fuzz::{TARGETS, Target};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Mutations of each target's seeds. `COFIX_MUTATIONS` asks for more.
const MUTATIONS: u64 = 2_000;

fn seeds(name: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("seeds").join(name);
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(!paths.is_empty(), "{name} has no seeds");
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

/// Runs a target; a panic leaves its input behind and names it.
fn run((name, target): Target, bytes: &[u8], what: &str) {
    if catch_unwind(|| target(bytes)).is_err() {
        let path = std::env::temp_dir().join(format!("cofix-fuzz-{name}"));
        std::fs::write(&path, bytes).unwrap();
        panic!("{name}: {what}; the input is {}", path.display());
    }
}

#[test]
fn seeds_and_their_beginnings() {
    for target in TARGETS {
        for seed in seeds(target.0) {
            run(*target, &seed, "a seed");
            for part in 1..40 {
                run(*target, &seed[..seed.len() * part / 40], "the beginning of a seed");
            }
        }
    }
}

#[test]
fn mutations_of_seeds() {
    let count = std::env::var("COFIX_MUTATIONS").map_or(MUTATIONS, |text| text.parse().unwrap());
    std::thread::scope(|scope| {
        for target in TARGETS {
            scope.spawn(move || {
                let seeds = seeds(target.0);
                let mut random = ChaCha8Rng::seed_from_u64(20_200_813);
                for number in 0..count {
                    run(*target, &mutate(&seeds, &mut random), &format!("mutation {number}"));
                }
            });
        }
    });
}
