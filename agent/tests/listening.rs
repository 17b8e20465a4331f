//! Sources that are pushed: a client that breaks off in a line and comes back, a second client, garbage, silence.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod limits;
mod recordings;

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::time::Duration;

use cofix_agent::Stop;
use cofix_agent::input::{Bytes, LiveSource, TcpListening, UdpListening};
use cofix_agent::source::records::Records;
use cofix_common::formats::decode::Record;
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;

use recordings::{ONE_SATELLITE_HEADER, one_satellite_epoch};

/// Nobody is idle for so long in these tests.
const NEVER: Duration = Duration::from_hours(1);

fn any_port() -> SocketAddr {
    "127.0.0.1:0".parse().unwrap()
}

fn epochs(seconds: std::ops::Range<u32>) -> String {
    seconds.map(one_satellite_epoch).collect()
}

fn time(second: u32) -> GpsTime {
    format!("2020-08-13T14:19:{second:02}").parse().unwrap()
}

fn tcp(idle: Duration) -> (Records, SocketAddr) {
    limits::watch();
    let port = TcpListening::bind(any_port(), idle).unwrap();
    let address = port.address();
    (Records::new(Box::new(port), time(0)), address)
}

fn udp(idle: Duration) -> (Records, SocketAddr) {
    limits::watch();
    let port = UdpListening::bind(any_port(), idle).unwrap();
    let address = port.address();
    (Records::new(Box::new(port), time(0)), address)
}

/// Checks that these epochs come next.
fn receive(records: &mut Records, seconds: std::ops::Range<u32>) {
    for second in seconds {
        match records.next(&Stop::default()).unwrap() {
            Some(Record::Epoch(epoch)) => assert_eq!(epoch.time_gps, time(second)),
            other => panic!("{other:?}"),
        }
    }
}

fn client(address: SocketAddr, text: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.write_all(text.as_bytes()).unwrap();
    stream
}

#[test]
fn a_client_that_breaks_off_in_a_line_and_comes_back_goes_on() {
    let (mut records, address) = tcp(NEVER);
    let half = one_satellite_epoch(3);
    let first = client(address, &(ONE_SATELLITE_HEADER.to_owned() + &epochs(0..3) + &half[..20]));
    receive(&mut records, 0..3);
    drop(first);
    // As an app that begins anew, and one that goes on.
    let second = client(address, &(ONE_SATELLITE_HEADER.to_owned() + &epochs(4..6)));
    receive(&mut records, 4..6);
    drop(second);
    let _third = client(address, &epochs(6..9));
    receive(&mut records, 6..9);
    let skips = records.skips();
    assert_eq!(skips.count(Reason::ConnectionOpenedAgain), 2, "{skips}");
    assert_eq!(skips.count(Reason::OtherSenderRefused), 0, "{skips}");
}

#[test]
fn a_second_client_is_told_that_the_port_is_busy_and_counted() {
    let (mut records, address) = tcp(NEVER);
    let mut first = client(address, &(ONE_SATELLITE_HEADER.to_owned() + &epochs(0..2)));
    receive(&mut records, 0..2);
    let mut second = TcpStream::connect(address).unwrap();
    first.write_all(epochs(2..4).as_bytes()).unwrap();
    let (mut said, stop) = (String::new(), Stop::default());
    let asked = stop.clone();
    let reader = limits::spawn(move || {
        second.read_to_string(&mut said).unwrap();
        asked.request();
        said
    });
    while records.next(&stop).unwrap().is_some() {}
    assert_eq!(reader.join().unwrap(), "busy: another client sends\r\n");
    let skips = records.skips();
    assert_eq!(skips.count(Reason::OtherSenderRefused), 1, "{skips}");
    assert_eq!(skips.count(Reason::ConnectionOpenedAgain), 0, "{skips}");
}

#[test]
fn a_silent_client_gives_way() {
    let (mut records, address) = tcp(Duration::ZERO);
    let silent = client(address, &(ONE_SATELLITE_HEADER.to_owned() + &epochs(0..2)));
    receive(&mut records, 0..2);
    let _second = client(address, &epochs(2..4));
    receive(&mut records, 2..4);
    assert_eq!(records.skips().count(Reason::ConnectionOpenedAgain), 1);
    drop(silent);
}

/// A client that sends something else costs itself alone.
#[test]
fn garbage_does_not_end_the_source() {
    let (mut records, address) = tcp(NEVER);
    let garbage = limits::spawn(move || {
        let mut stream = client(address, "");
        // Closed before everything is taken.
        let _ = stream.write_all(&vec![b'x'; 200_000]);
        let _ = stream.read(&mut [0]);
        client(address, &(ONE_SATELLITE_HEADER.to_owned() + &epochs(0..3)))
    });
    receive(&mut records, 0..3);
    let _client = garbage.join().unwrap();
    let skips = records.skips();
    assert_eq!(skips.count(Reason::SenderOfNoObservations), 1, "{skips}");
}

#[test]
fn datagrams_are_portions_of_one_stream() {
    let (mut records, address) = udp(NEVER);
    let sender = UdpSocket::bind(any_port()).unwrap();
    let stranger = UdpSocket::bind(any_port()).unwrap();
    let text = ONE_SATELLITE_HEADER.to_owned() + &epochs(0..10);
    // Lines go on in the next datagram.
    for (number, portion) in text.as_bytes().chunks(37).enumerate() {
        sender.send_to(portion, address).unwrap();
        if number == 5 {
            stranger.send_to(b"noise", address).unwrap();
        }
    }
    receive(&mut records, 0..10);
    let skips = records.skips();
    assert_eq!(skips.count(Reason::OtherSenderRefused), 1, "{skips}");
    assert_eq!(skips.total(), 1, "{skips}");
}

#[test]
fn a_silent_sender_of_datagrams_gives_way_and_no_byte_of_the_next_is_lost() {
    let (mut records, address) = udp(Duration::ZERO);
    let text = ONE_SATELLITE_HEADER.to_owned() + &epochs(0..2) + "> 2020 08";
    UdpSocket::bind(any_port()).unwrap().send_to(text.as_bytes(), address).unwrap();
    receive(&mut records, 0..2);
    let second = UdpSocket::bind(any_port()).unwrap();
    second.send_to(epochs(2..4).as_bytes(), address).unwrap();
    receive(&mut records, 2..4);
    assert_eq!(records.skips().count(Reason::ConnectionOpenedAgain), 1);
}

#[test]
fn a_port_to_which_nobody_sends_hears_the_request_to_stop() {
    for scheme in ["tcp", "udp"] {
        let source: LiveSource = format!("{scheme}-listen://127.0.0.1:0").parse().unwrap();
        let bytes: Box<dyn Bytes> = source.open().unwrap();
        let stop = Stop::default();
        let asked = stop.clone();
        let other = limits::spawn(move || asked.request());
        assert!(Records::new(bytes, time(0)).next(&stop).unwrap().is_none());
        other.join().unwrap();
    }
}
