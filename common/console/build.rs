//! Gives the programs the commit of their build: from the variable `COFIX_COMMIT`, from git, or, in an archive of the repository,
//! from `commit.txt`. Debug builds do not ask git, so that a commit does not rebuild them.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Number of digits of the shown commit.
const SHOWN: usize = 12;
/// Sources of the programs, relative to this package; if one of them is changed, the commit is marked as modified.
const SOURCES: [&str; 6] =
    ["../../Cargo.lock", "../src", "../../agent/src", "src", "../../fusion-hub/src", "../../viewer/src"];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=commit.txt");
    println!("cargo::rerun-if-env-changed=COFIX_COMMIT");
    let is_release = std::env::var("PROFILE").as_deref() == Ok("release");
    let told = std::env::var("COFIX_COMMIT").ok().filter(|commit| is_word(commit));
    let known = told.or_else(|| if is_release { by_git().or_else(by_archive) } else { None });
    if let Some(commit) = &known {
        println!("cargo::rustc-env=COFIX_KNOWN_COMMIT={commit}");
    }
    let unknown = if is_release { "commit unknown" } else { "debug build" };
    println!("cargo::rustc-env=COFIX_BUILD={}", known.as_deref().unwrap_or(unknown));
}

/// Commit of the repository whose root is this workspace, with a mark if tracked files differ from it.
fn by_git() -> Option<String> {
    let folder = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR")?);
    let workspace = folder.parent()?.parent()?;
    let top = git(workspace, &["rev-parse", "--show-toplevel"])?;
    // If the workspace was unpacked inside another repository, git returns the commit of that repository.
    if Path::new(&top).canonicalize().ok()? != workspace.canonicalize().ok()? {
        return None;
    }
    let commit = git(workspace, &["rev-parse", "HEAD"])?;
    watch(workspace);
    let changed = git(workspace, &["status", "--porcelain", "--untracked-files=no"])?;
    let mark = if changed.is_empty() { "" } else { ", modified" };
    Some(format!("{}{mark}", commit.get(..SHOWN)?))
}

/// Registers the files that change with the commit, and the sources.
fn watch(workspace: &Path) {
    let branch = git(workspace, &["symbolic-ref", "--quiet", "HEAD"]);
    let names = [Some("HEAD".to_owned()), branch, Some("packed-refs".to_owned())];
    for name in names.into_iter().flatten() {
        if let Some(path) = git(workspace, &["rev-parse", "--git-path", &name]) {
            let path = workspace.join(path);
            // A missing file would trigger a rebuild every time.
            if path.exists() {
                println!("cargo::rerun-if-changed={}", path.display());
            }
        }
    }
    for source in SOURCES {
        println!("cargo::rerun-if-changed={source}");
    }
}

fn git(folder: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").arg("-C").arg(folder).args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// Commit that `git archive` wrote in place of its mark.
fn by_archive() -> Option<String> {
    let text = std::fs::read_to_string("commit.txt").ok()?;
    text.trim().get(..SHOWN).filter(|commit| is_word(commit)).map(str::to_owned)
}

fn is_word(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_.+".contains(&byte))
}
