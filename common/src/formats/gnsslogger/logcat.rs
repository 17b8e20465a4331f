//! Lines of Android's system log (`adb logcat`) in front of what an app wrote.
//!
//! Read are the formats `brief`, `time` and `threadtime` of `logcat -v`:
//!
//! ```text
//! D/GpsOutputMeasure( 4321): Raw,…
//! 11-28 14:10:40.123 D/GpsOutputMeasure( 4321): Raw,…
//! 11-28 14:10:40.123  4321  4340 D GpsOutputMeasure: Raw,…
//! ```

/// Letters of priorities.
const PRIORITIES: &[u8] = b"VDIWEFA";
/// Tags under which GPSTest writes measurements and navigation messages begin with this.
const GPSTEST: &[u8] = b"GpsOutput";

/// A line of the system log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Logged<'a> {
    tag: &'a [u8],
    /// What the app wrote.
    pub(super) message: &'a [u8],
}

impl<'a> Logged<'a> {
    /// Reads a line; `None` if it is none of the system log.
    pub(super) fn of(line: &'a [u8]) -> Option<Self> {
        match after_date(line) {
            Some(rest) => brief(rest).or_else(|| thread(rest)),
            None => brief(line).or_else(|| mark(line)),
        }
    }

    /// Whether GPSTest wrote it.
    pub(super) fn is_of_gpstest(self) -> bool {
        self.tag.starts_with(GPSTEST)
    }

    /// Whether it begins a measurement as Android's own `GnssMeasurement.toString` writes it, which lacks the receiver's clock.
    pub(super) fn is_without_clock(self) -> bool {
        self.message.starts_with(b"GnssMeasurement")
    }
}

/// `--------- beginning of main`.
fn mark(line: &[u8]) -> Option<Logged<'_>> {
    line.starts_with(b"--------- beginning of ").then_some(Logged { tag: b"", message: line })
}

/// What follows a date and a time of day.
fn after_date(line: &[u8]) -> Option<&[u8]> {
    let (date, rest) = word(line)?;
    let (time, rest) = word(rest)?;
    let is_date = date.iter().all(|byte| byte.is_ascii_digit() || *byte == b'-');
    let is_time = time.iter().all(|byte| byte.is_ascii_digit() || matches!(byte, b':' | b'.'));
    (is_date && is_time && date.contains(&b'-') && time.contains(&b':')).then_some(rest)
}

/// `D/Tag( 4321): message`.
fn brief(line: &[u8]) -> Option<Logged<'_>> {
    let (priority, rest) = line.split_first()?;
    let rest = rest.strip_prefix(b"/").filter(|_| PRIORITIES.contains(priority))?;
    let (head, message) = split(rest, b"):")?;
    let open = head.iter().rposition(|byte| *byte == b'(')?;
    let (tag, process) = head.split_at_checked(open)?;
    let is_process = process.iter().skip(1).all(|byte| byte.is_ascii_digit() || *byte == b' ');
    is_process.then_some(Logged { tag: tag.trim_ascii(), message: message.trim_ascii_start() })
}

/// `4321  4340 D Tag: message`, with the user in front where it was asked for.
fn thread(line: &[u8]) -> Option<Logged<'_>> {
    let mut rest = line;
    for _ in 0..4 {
        let (next, after) = word(rest)?;
        if let [priority] = next
            && PRIORITIES.contains(priority)
        {
            let (tag, message) = split(after, b":")?;
            return Some(Logged { tag: tag.trim_ascii(), message: message.trim_ascii_start() });
        }
        rest = after;
    }
    None
}

/// The next word, and what follows the blanks after it.
fn word(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let (word, rest) = split(text, b" ")?;
    Some((word, rest.trim_ascii_start()))
}

/// What stands before and after a mark.
fn split<'a>(text: &'a [u8], mark: &[u8]) -> Option<(&'a [u8], &'a [u8])> {
    let at = memchr::memmem::find(text, mark)?;
    Some((text.get(..at)?, text.get(at + mark.len()..)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_every_format_are_read() {
        for line in [
            "D/GpsOutputMeasure( 4321): Raw,1,2",
            "11-28 14:10:40.123 D/GpsOutputMeasure( 4321): Raw,1,2",
            "11-28 14:10:40.123  4321  4340 D GpsOutputMeasure: Raw,1,2",
            "2026-11-28 14:10:40.123 u0_a99  4321  4340 D GpsOutputMeasure: Raw,1,2",
        ] {
            let logged = Logged::of(line.as_bytes()).unwrap();
            assert_eq!((logged.tag, logged.message), (&b"GpsOutputMeasure"[..], &b"Raw,1,2"[..]), "{line}");
            assert!(logged.is_of_gpstest());
        }
        assert!(Logged::of(b"--------- beginning of main").is_some());
        for line in
            ["", "Raw,1,2,3", "Fix,gps,1", "# Raw,a", "D/Tag: no process", "11-28 14:10:40.123 a b c d e f"]
        {
            assert_eq!(Logged::of(line.as_bytes()), None, "{line}");
        }
    }
}
