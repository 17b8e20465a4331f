//! Live sources: a file that grows in odd portions, a server that drops the connection, garbage in between.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod limits;
mod recordings;

use std::io::{Cursor, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::time::Duration;

use cofix_agent::Stop;
use cofix_agent::input::{Backoff, Bytes, Connected, Followed, Piped};
use cofix_agent::source::records::{Records, RecordsError};
use cofix_common::formats::decode::Record;
use cofix_common::formats::format::Format;
use cofix_common::gnss::ObservationEpoch;
use cofix_common::time::GpsTime;

use recordings::{ONE_SATELLITE_HEADER, one_satellite_epoch};

fn file(seconds: std::ops::Range<u32>) -> String {
    ONE_SATELLITE_HEADER.to_owned() + &seconds.map(one_satellite_epoch).collect::<String>()
}

fn time(second: u32) -> GpsTime {
    format!("2020-08-13T14:19:{second:02}").parse().unwrap()
}

fn next(records: &mut Records, stop: &Stop) -> Option<ObservationEpoch> {
    match records.next(stop).unwrap()? {
        Record::Epoch(epoch) => Some(epoch),
        other => panic!("{other:?}"),
    }
}

/// All epochs to the end.
fn all(records: &mut Records) -> Vec<GpsTime> {
    let stop = Stop::default();
    std::iter::from_fn(|| next(records, &stop)).map(|epoch| epoch.time_gps).collect()
}

fn records(bytes: impl Bytes + 'static) -> Records {
    Records::new(Box::new(bytes), time(0))
}

fn append(path: &Path, bytes: &[u8]) {
    let mut file = std::fs::OpenOptions::new().append(true).open(path).unwrap();
    file.write_all(bytes).unwrap();
}

#[test]
fn a_file_is_followed_as_it_grows_in_odd_portions() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("growing.rnx");
    std::fs::write(&path, "").unwrap();
    let mut records = records(Followed::open(&path).unwrap());
    let stop = Stop::default();
    let (text, end) = (file(0..9), stop.clone());
    // An epoch is complete when its satellites are: the writer may go on when the reader has it.
    let (seen, turn) = std::sync::mpsc::channel::<()>();
    let writer = limits::spawn(move || {
        for portion in text.as_bytes().chunks(37) {
            append(&path, portion);
        }
        turn.recv().unwrap();
        append(&path, one_satellite_epoch(9).as_bytes());
        turn.recv().unwrap();
        end.request();
    });
    for second in 0..10 {
        assert_eq!(next(&mut records, &stop).unwrap().time_gps, time(second));
        if second >= 8 {
            seen.send(()).unwrap();
        }
    }
    assert!(next(&mut records, &stop).is_none(), "a request to stop is the end");
    writer.join().unwrap();
    assert_eq!(records.decoder().format(), Some(Format::Rinex));
    assert!(records.skips().is_empty(), "{}", records.skips());
}

#[test]
fn a_file_that_is_not_there_yet_is_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("later.rnx");
    let mut records = records(Followed::open(&path).unwrap());
    let stop = Stop::default();
    let writer = std::thread::spawn(move || std::fs::write(&path, file(0..3)).unwrap());
    assert_eq!(next(&mut records, &stop).unwrap().time_gps, time(0));
    writer.join().unwrap();
    stop.request();
    let missing = Followed::open(&folder.path().join("never.rnx")).unwrap();
    assert!(next(&mut self::records(missing), &stop).is_none());
    assert!(Followed::open(folder.path()).is_err(), "a folder");
}

#[test]
fn a_file_written_anew_is_read_from_its_beginning() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rewritten.rnx");
    std::fs::write(&path, file(0..20)).unwrap();
    let mut records = records(Followed::open(&path).unwrap());
    let stop = Stop::default();
    for second in 0..20 {
        assert_eq!(next(&mut records, &stop).unwrap().time_gps, time(second));
    }
    // Shorter, and with new epochs only: the old ones come no second time.
    std::fs::write(&path, file(18..24)).unwrap();
    for second in 20..24 {
        assert_eq!(next(&mut records, &stop).unwrap().time_gps, time(second));
    }
    assert_eq!(records.skips().count("connection lost and opened again, or file written anew"), 1);
}

/// As `rsync` and `adb pull` do: a new file of the same beginning takes the old one's name.
#[test]
fn a_file_replaced_by_a_longer_one_of_the_same_beginning_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let (path, other) = (folder.path().join("log.rnx"), folder.path().join("new"));
    std::fs::write(&path, "").unwrap();
    let mut records = records(Followed::open(&path).unwrap());
    let stop = Stop::default();
    for (done, end) in [(0, 5), (5, 6), (6, 19)] {
        // And half a line.
        std::fs::write(&other, file(0..end) + "> 2020 08 13 14").unwrap();
        std::fs::rename(&other, &path).unwrap();
        for second in done..end {
            assert_eq!(next(&mut records, &stop).unwrap().time_gps, time(second));
        }
    }
    assert!(records.skips().is_empty(), "{}", records.skips());
}

/// Not shorter, but another one: by name, after it was removed, and in place.
#[test]
fn a_file_replaced_by_another_one_is_read_from_its_beginning() {
    let replace: [fn(&Path, &str); 3] = [
        |path, text| {
            let other = path.with_extension("new");
            std::fs::write(&other, text).unwrap();
            std::fs::rename(&other, path).unwrap();
        },
        |path, text| {
            std::fs::remove_file(path).unwrap();
            std::thread::sleep(Duration::from_millis(150));
            std::fs::write(path, text).unwrap();
        },
        |path, text| std::fs::write(path, text).unwrap(),
    ];
    for replace in replace {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.rnx");
        std::fs::write(&path, file(0..5)).unwrap();
        let mut records = records(Followed::open(&path).unwrap());
        let stop = Stop::default();
        for second in 0..5 {
            assert_eq!(next(&mut records, &stop).unwrap().time_gps, time(second));
        }
        // The columns in another order.
        let text = file(5..30).replace("C1C L1C D1C S1C", "C1C L1C S1C D1C");
        replace(&path, &text.replace("     -1200.000 8        45.000 8", "        45.000 8     -1200.000 8"));
        for second in 5..30 {
            let epoch = next(&mut records, &stop).unwrap();
            assert_eq!(epoch.time_gps, time(second));
            assert_eq!(epoch.observations[0].cn0_dbhz, Some(45.0));
        }
        let skips = records.skips();
        assert_eq!(skips.count("connection lost and opened again, or file written anew"), 1, "{skips}");
        assert_eq!(skips.total(), 1, "{skips}");
    }
}

#[test]
fn a_pipe_ends_with_its_writer() {
    let mut records = records(Piped::start(Cursor::new(file(0..5).into_bytes())).unwrap());
    assert_eq!(all(&mut records), (0..5).map(time).collect::<Vec<_>>());
}

#[test]
fn a_silent_pipe_hears_the_request_to_stop() {
    struct Silent;
    impl std::io::Read for Silent {
        fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
            std::thread::park();
            Ok(0)
        }
    }
    let stop = Stop::default();
    stop.request();
    let mut records = records(Piped::start(Silent).unwrap());
    assert!(records.next(&stop).unwrap().is_none());
}

fn quick(attempts: u32) -> Backoff {
    let (first, longest) = (Duration::from_millis(1), Duration::from_millis(5));
    Backoff { first, longest, attempts, silence: Duration::from_hours(1) }
}

/// A server that sends each of `portions` to one connection and drops it. The last connection ends when it is told.
fn server(portions: Vec<Vec<u8>>) -> (String, limits::Running<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let serving = limits::spawn(move || {
        for portion in portions {
            let (mut connection, _): (TcpStream, _) = listener.accept().unwrap();
            connection.write_all(&portion).unwrap();
        }
    });
    (address, serving)
}

#[test]
fn a_lost_connection_is_opened_again() {
    let text = file(0..10);
    // Dropped in the middle of epoch 4's satellite line; garbage of the restart; then the rest from epoch 6 on.
    let cut = text.find(&one_satellite_epoch(5)).unwrap() - 30;
    let mut second = b"\x00\xffboot\r\nnonsense 17 \n".to_vec();
    second.extend_from_slice(&text.as_bytes()[text.find(&one_satellite_epoch(6)).unwrap()..]);
    let (address, serving) = server(vec![text.as_bytes()[..cut].to_vec(), second]);
    let mut records = records(Connected::new(&address, quick(4)));
    let times = all(&mut records);
    serving.join().unwrap();
    assert_eq!(times[..4], (0..4).map(time).collect::<Vec<_>>());
    assert_eq!(times[times.len() - 4..], (6..10).map(time).collect::<Vec<_>>());
    let skips = records.skips();
    assert_eq!(skips.count("connection lost and opened again, or file written anew"), 1, "{skips}");
    assert_eq!(skips.count("source ended before its end"), 1, "the server is gone for good: {skips}");
}

/// Some other service's greeting, over and over: not asked for ever.
#[test]
fn a_server_that_never_says_anything_useful_is_given_up() {
    let (address, serving) = server(vec![b"hello, this is telnet\r\n".to_vec(); 13]);
    let mut records = records(Connected::new(&address, quick(1_000)));
    let error = records.next(&Stop::default()).unwrap_err().to_string();
    assert!(error.contains("begins with 'hello, this is telnet"), "{error}");
    serving.join().unwrap();
}

#[test]
fn a_server_that_was_never_there_is_an_error_that_names_it() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    drop(listener);
    let mut records = records(Connected::new(&address, quick(3)));
    let Err(RecordsError::Read(error)) = records.next(&Stop::default()) else { panic!("an error is due") };
    let said = error.to_string();
    assert!(said.contains(&address) && said.contains("3 attempts"), "{said}");
}

#[test]
fn a_request_to_stop_ends_the_attempts() {
    let backoff = Backoff { first: Duration::from_hours(1), ..Backoff::default() };
    let (address, serving) = server(vec![file(0..1).into_bytes()]);
    let mut records = records(Connected::new(&address, backoff));
    let stop = Stop::default();
    assert_eq!(next(&mut records, &stop).unwrap().time_gps, time(0));
    serving.join().unwrap();
    let other = stop.clone();
    let asked = limits::spawn(move || other.request());
    assert!(next(&mut records, &stop).is_none());
    asked.join().unwrap();
}

/// An RTCM 3 frame with a message that is not read.
fn frame() -> Vec<u8> {
    recordings::frame(&[0x40, 0x00])
}

/// Nobody waits for what cannot become readable.
#[test]
fn a_growing_file_that_is_packed_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.txt.gz");
    std::fs::write(&path, [0x1f, 0x8b, 8, 0, 1, 2, 3]).unwrap();
    let mut records = records(Followed::open(&path).unwrap());
    let error = records.next(&Stop::default()).unwrap_err().to_string();
    assert!(error.contains("zcat FILE | cofix-agent --observations -"), "{error}");
}

#[test]
fn rtcm_is_recognised_behind_noise() {
    let mut bytes = b"\xd3\x00noise\r\n".repeat(9);
    bytes.extend(frame());
    bytes.extend(b"\xd3\xff");
    bytes.extend(frame());
    let mut records = records(Piped::start(Cursor::new(bytes)).unwrap());
    assert!(all(&mut records).is_empty());
    assert_eq!(records.decoder().format(), Some(Format::Rtcm3));
    assert_eq!(records.skips().count("message 1024 is not read"), 2, "{}", records.skips());
}

#[test]
fn what_is_unknown_is_named_and_shown() {
    for (bytes, said) in [
        (b"$GPGGA,1,2\r\n".to_vec(), "NMEA"),
        (vec![b'x'; 100_000], "begins with 'xxxx"),
        (Vec::new(), "it is empty"),
        (vec![0x1f, 0x8b, 8, 0], "packed data"),
    ] {
        let mut records = records(Piped::start(Cursor::new(bytes)).unwrap());
        let error = records.next(&Stop::default()).unwrap_err().to_string();
        assert!(error.contains(said) && error.contains("RTCM 3"), "{error}");
    }
}
