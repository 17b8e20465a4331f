//! What the programs have in common on a terminal: version, verbosity, errors, output.

use std::fmt::{self, Display};
use std::io::{self, IsTerminal, Write};
use std::process::ExitCode;
use std::sync::OnceLock;

use tracing::{Event, Level, Subscriber};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::registry::LookupSpan;

pub use tracing::level_filters::LevelFilter;

/// What a program is built from: [`COMMIT`], else "debug build" or "commit unknown".
pub const BUILD: &str = env!("COFIX_BUILD");
/// The commit that a program is built from, with ", modified" when tracked files differed from it; `None` when it is not known.
pub const COMMIT: Option<&str> = option_env!("COFIX_KNOWN_COMMIT");
/// Version and build, as `--version` says them.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("COFIX_BUILD"), ")");

/// How much is said on the standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::Args)]
pub struct Verbosity {
    /// Say more; twice for yet more
    #[arg(short, long, global = true, action = clap::ArgAction::Count, display_order = 900)]
    verbose: u8,
    /// Say less; twice for yet less (why a program fails is always said)
    #[arg(short, long, global = true, action = clap::ArgAction::Count, conflicts_with = "verbose", display_order = 901)]
    quiet: u8,
}

const LEVELS: [LevelFilter; 6] = [
    LevelFilter::OFF,
    LevelFilter::ERROR,
    LevelFilter::WARN,
    LevelFilter::INFO,
    LevelFilter::DEBUG,
    LevelFilter::TRACE,
];

impl Verbosity {
    /// The level of what is said, from that of a program that is told nothing.
    fn level(self, usual: LevelFilter) -> LevelFilter {
        let usual = LEVELS.iter().position(|level| *level == usual).unwrap_or_default();
        let level = (usual + usize::from(self.verbose)).saturating_sub(usize::from(self.quiet));
        LEVELS.get(level).copied().unwrap_or(LevelFilter::TRACE)
    }

    fn is_told(self) -> bool {
        self != Self::default()
    }
}

/// How lines of the log look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lines {
    /// With date and time, UTC: of programs that run for hours.
    Timed,
    /// As errors look: "warning: …".
    Plain,
}

/// Starts the log on the standard error: of the workspace's crates from the level `usual` on, or as told by the user (`-v`, `-q`, else
/// `RUST_LOG`); of others errors only.
pub fn start_log(verbosity: Verbosity, usual: LevelFilter, lines: Lines) {
    let level = verbosity.level(usual);
    let own = ["common", "agent", "hub", "viewer", "console"].map(|name| format!("cofix_{name}={level}"));
    let by_level = || EnvFilter::new(format!("error,{}", own.join(",")));
    let filter = match EnvFilter::try_from_default_env() {
        Ok(filter) if !verbosity.is_told() => filter,
        _ => by_level(),
    };
    let log = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(|| Log)
        .with_ansi(io::stderr().is_terminal());
    match lines {
        Lines::Timed => log.init(),
        Lines::Plain => log.event_format(Plain).init(),
    }
}

/// What writes the log in place of the standard error.
static WRITE: OnceLock<WriteLog> = OnceLock::new();

/// Writes a part of the log; returns how many bytes it took.
pub type WriteLog = fn(&[u8]) -> io::Result<usize>;

/// Lets the log go through `write`, for one who draws on the terminal; the first call counts.
pub fn write_log_through(write: WriteLog) {
    WRITE.get_or_init(|| write);
}

struct Log;

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        WRITE.get().map_or_else(|| io::stderr().write(bytes), |write| write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

/// Level and message, and nothing else.
struct Plain;

impl<S, N> FormatEvent<S, N> for Plain
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(
        &self,
        context: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        let level = *event.metadata().level();
        if level == Level::ERROR {
            writer.write_str("error: ")?;
        } else if level == Level::WARN {
            writer.write_str("warning: ")?;
        }
        context.field_format().format_fields(writer.by_ref(), event)?;
        writeln!(writer)
    }
}

/// The exit code of a program's work, after saying why it failed.
pub fn conclude(outcome: anyhow::Result<()>) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            say_error(&one_line(&error));
            ExitCode::FAILURE
        }
    }
}

/// Says on the standard error what is wrong, as loud as the log may be.
pub fn say_error(error: &dyn Display) {
    // Nothing is left to be done when this cannot be said.
    let _ = writeln!(io::stderr(), "error: {error}");
}

/// An error with its causes, each said once: many messages carry their cause already.
fn one_line(error: &anyhow::Error) -> String {
    let mut line = error.to_string();
    for cause in error.chain().skip(1) {
        let cause = cause.to_string();
        if !line.contains(&cause) {
            line = format!("{line}: {cause}");
        }
    }
    line
}

/// Prints to the standard output. A reader that has had enough (`| head`) is no failure.
///
/// # Errors
/// When it cannot be written.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => Ok(result?),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_are_said_once() {
        let inner = io::Error::other("disk full");
        let doubled = anyhow::Error::new(inner).context("a.rrd: cannot write: disk full");
        assert_eq!(one_line(&doubled), "a.rrd: cannot write: disk full");
        let chained =
            anyhow::Error::new(io::Error::other("disk full")).context("cannot write").context("a.rrd");
        assert_eq!(one_line(&chained), "a.rrd: cannot write: disk full");
    }

    #[test]
    fn levels_go_up_and_down_and_end_somewhere() {
        let level = |verbose, quiet| Verbosity { verbose, quiet }.level(LevelFilter::INFO);
        assert_eq!(level(0, 0), LevelFilter::INFO);
        assert_eq!((level(1, 0), level(9, 0)), (LevelFilter::DEBUG, LevelFilter::TRACE));
        assert_eq!((level(0, 1), level(0, 9)), (LevelFilter::WARN, LevelFilter::OFF));
    }

    #[test]
    fn the_version_names_the_build() {
        assert!(VERSION.starts_with(env!("CARGO_PKG_VERSION")) && VERSION.contains(BUILD));
        assert!(!BUILD.is_empty() && !BUILD.contains("$Format"), "{BUILD}");
    }
}
