//! Common parts of the programs on a terminal: version, verbosity, errors, output.

mod completions;
mod json;

use std::fmt::{self, Display};
use std::io::{self, IsTerminal, Write};
use std::process::ExitCode;
use std::sync::OnceLock;

use tracing::{Event, Level, Subscriber};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::registry::LookupSpan;

pub use completions::Completions;
pub use tracing::level_filters::LevelFilter;

use json::JsonLines;

/// Build of the program: [`COMMIT`], else "debug build" or "commit unknown".
pub const BUILD: &str = env!("COFIX_BUILD");
/// Commit of the build, with ", modified" if tracked files differed from it; `None` if unknown.
pub const COMMIT: Option<&str> = option_env!("COFIX_KNOWN_COMMIT");
/// Version and build, as printed by `--version`.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("COFIX_BUILD"), ")");

/// How much is said on the standard error, and in which format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::Args)]
pub struct Verbosity {
    /// Say more; twice for yet more
    #[arg(short, long, global = true, action = clap::ArgAction::Count, display_order = 900)]
    verbose: u8,
    /// Say less; twice for yet less (why a program fails is always said)
    #[arg(short, long, global = true, action = clap::ArgAction::Count, conflicts_with = "verbose", display_order = 901)]
    quiet: u8,
    /// Format of the log and of the error at the end: text, or one JSON object a line (time, level, target, message)
    #[arg(long, global = true, value_enum, value_name = "FORMAT", default_value_t, display_order = 902)]
    log_format: LogFormat,
}

/// Format of the entries of the log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum LogFormat {
    /// Lines for people
    #[default]
    Text,
    /// One JSON object a line
    Json,
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
    /// Log level, relative to the usual level of the program.
    fn level(self, usual: LevelFilter) -> LevelFilter {
        let usual = LEVELS.iter().position(|level| *level == usual).unwrap_or_default();
        let level = (usual + usize::from(self.verbose)).saturating_sub(usize::from(self.quiet));
        LEVELS.get(level).copied().unwrap_or(LevelFilter::TRACE)
    }

    fn is_told(self) -> bool {
        self.verbose > 0 || self.quiet > 0
    }
}

/// Format of the log's lines of text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lines {
    /// With date and time, UTC, for programs that run for hours.
    Timed,
    /// Like errors: "warning: …".
    Plain,
}

/// Starts the log on the standard error: for the crates of the workspace from the level `usual` on, or as set by the user (`-v`, `-q`, else
/// `RUST_LOG`); for other crates only errors.
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
    FORMAT.get_or_init(|| verbosity.log_format);
    match (verbosity.log_format, lines) {
        (LogFormat::Json, _) => log.with_ansi(false).event_format(JsonLines).init(),
        (LogFormat::Text, Lines::Timed) => log.init(),
        (LogFormat::Text, Lines::Plain) => log.event_format(Plain).init(),
    }
}

/// Format of the log that was started.
static FORMAT: OnceLock<LogFormat> = OnceLock::new();

/// Writer of the log in place of the standard error.
static WRITE: OnceLock<WriteLog> = OnceLock::new();

/// Function that writes a part of the log and returns the number of bytes written.
pub type WriteLog = fn(&[u8]) -> io::Result<usize>;

/// Redirects the log to `write`, for a program that draws on the terminal; only the first call counts.
pub fn write_log_through(write: WriteLog) {
    WRITE.get_or_init(|| write);
}

struct Log;

impl Write for Log {
    /// Takes an entry as a whole, as it comes.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let entry = one_entry(bytes);
        let mut rest = entry.as_bytes();
        while !rest.is_empty() {
            let written = WRITE.get().map_or_else(|| io::stderr().write(rest), |write| write(rest))?;
            rest = rest.get(written.max(1)..).unwrap_or_default();
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

/// Most bytes of an entry of the log.
const MAXIMUM_ENTRY_BYTES: usize = 4_096;

/// An entry of the log as one line, whatever texts from elsewhere are in it. (Escape sequences in them are made visible before.)
fn one_entry(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let (body, end) = text.strip_suffix('\n').map_or((text.as_ref(), ""), |body| (body, "\n"));
    let mut entry: String =
        body.get(..body.floor_char_boundary(MAXIMUM_ENTRY_BYTES)).unwrap_or(body).to_owned();
    if entry.len() < body.len() {
        let cut = format!("… ({} bytes)", body.len());
        entry.push_str(&cut);
    }
    for (breaking, visible) in
        [('\n', "\\n"), ('\r', "\\r"), ('\u{2028}', "\\u{2028}"), ('\u{2029}', "\\u{2029}")]
    {
        entry = entry.replace(breaking, visible);
    }
    entry + end
}

/// Format with level and message only.
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

/// Exit code of a program; prints the error, if there is one.
pub fn conclude(outcome: anyhow::Result<()>) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            say_error(&one_line(&error));
            ExitCode::FAILURE
        }
    }
}

/// Prints an error on the standard error, regardless of the log level.
pub fn say_error(error: &dyn Display) {
    let line = match FORMAT.get() {
        Some(LogFormat::Json) => json::error(&error.to_string()),
        _ => format!("error: {error}"),
    };
    // An error that cannot be printed is ignored.
    let _ = writeln!(io::stderr(), "{line}");
}

/// An error with its causes in one line; causes contained in the message of an error are not repeated.
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

/// Prints to the standard output. A closed pipe (`| head`) is no error.
///
/// # Errors
/// If the output cannot be written.
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
    fn an_entry_of_the_log_is_one_line_of_limited_length() {
        assert_eq!(one_entry(b"hub: listens\n"), "hub: listens\n");
        assert_eq!(one_entry(b"ok\n2026 INFO all is well\r\n"), "ok\\n2026 INFO all is well\\r\n");
        let long = one_entry("ä".repeat(100_000).as_bytes());
        assert!(long.len() < 4_200 && long.ends_with("ä… (200000 bytes)"), "{}", long.len());
    }

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
        let level =
            |verbose, quiet| Verbosity { verbose, quiet, ..Verbosity::default() }.level(LevelFilter::INFO);
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
