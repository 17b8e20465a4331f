//! The NTRIP client against casters of our own on loopback: both revisions, refusals, odd chunks, cut connections, garbage.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod caster;
mod limits;
mod recordings;

use std::io::{Read, Write};
use std::net::TcpListener;

use cofix_agent::Stop;
use cofix_agent::input::ntrip::{Caster, RoverPosition, sourcetable};
use cofix_common::frames::Geodetic;
use cofix_common::skips::Reason;

use caster::{CHUNKED, NOT_READ, TestCaster, chunked, exhaust, frame, frames, head, in_portions, read_head};

#[test]
fn a_caster_of_the_second_revision_is_asked_and_its_chunks_joined() {
    for (chunk, portion) in [(1, 1), (3, 2), (7, 1), (100, 13), (1_000, 4_096)] {
        let reply = [head(CHUNKED), chunked(&frames(5), chunk)].concat();
        let caster = TestCaster::start(vec![in_portions(&reply, portion)]);
        let mut records = caster.records(&RoverPosition::default(), 1);
        exhaust(&mut records).unwrap();
        assert_eq!(records.skips().count(NOT_READ), 5, "chunks of {chunk}: {}", records.skips());
        let requests = caster.requests();
        let request = &requests[0];
        assert!(request.starts_with("GET /BASE HTTP/1.1\r\nHost: 127.0.0.1:"), "{request}");
        for line in [
            "Ntrip-Version: Ntrip/2.0",
            "User-Agent: NTRIP cofix-agent/",
            "Authorization: Basic bWU6c2U6Y3JldA==",
        ] {
            assert!(request.contains(line), "{request}");
        }
        assert!(!request.contains("Ntrip-GGA"), "no position is known: {request}");
    }
}

#[test]
fn replies_of_the_first_revision_are_understood() {
    for reply in ["ICY 200 OK\r\n\r\n", "ICY 200 OK\r\n", "ICY 200 OK\r\nServer: NTRIP Caster: 1\r\n\r\n"] {
        let caster = TestCaster::start(vec![vec![[reply.as_bytes(), &frames(3)].concat()]]);
        let mut records = caster.records(&RoverPosition::default(), 1);
        exhaust(&mut records).unwrap();
        let skips = records.skips();
        assert_eq!(skips.count(NOT_READ), 3, "{skips}");
        assert_eq!(skips.iter().count(), 2, "only the end is told besides: {skips}");
        caster.requests();
    }
}

#[test]
fn a_caster_that_does_not_understand_is_asked_as_the_first_revision_has_it() {
    let caster = TestCaster::start(vec![
        vec![head("HTTP/1.1 505 HTTP Version not supported")],
        vec![[head("ICY 200 OK"), frames(2)].concat()],
    ]);
    let mut records = caster.records(&RoverPosition::default(), 2);
    exhaust(&mut records).unwrap();
    assert_eq!(records.skips().count(NOT_READ), 2);
    let requests = caster.requests();
    assert!(requests[1].starts_with("GET /BASE HTTP/1.0\r\nUser-Agent: NTRIP"), "{}", requests[1]);
    assert!(!requests[1].contains("Ntrip-Version"));
}

#[test]
fn refusals_say_what_to_do_and_are_final() {
    for (reply, said) in [
        ("HTTP/1.1 401 Unauthorized\r\n\r\n", "refuses user 'me' (401 Unauthorized)"),
        ("HTTP/1.0 401 Unauthorized\r\n", "refuses user 'me' (401 Unauthorized)"),
        ("ERROR - Bad Password\r\n", "refuses user 'me' (ERROR - Bad Password)"),
        (
            "HTTP/1.1 404 Not Found\r\n\r\n",
            "no mount point 'BASE' now (404 Not Found): list them with 'cofix-agent sourcetable ntrip://127.0.0.1:",
        ),
        (
            "SOURCETABLE 200 OK\r\n\r\nSTR;OTHER;x;RTCM 3;;2;GPS;n;DEU;1;2;\r\nENDSOURCETABLE\r\n",
            "no mount point 'BASE' now",
        ),
        ("HTTP/1.1 200 OK\r\nContent-Type: gnss/sourcetable\r\n\r\n", "no mount point 'BASE' now"),
        ("HTTP/1.1 200 OK\r\nContent-Type: text/html\r\n\r\n<html>", "a web page is answered"),
    ] {
        let caster = TestCaster::start(vec![vec![reply.as_bytes().to_vec()]]);
        // A second attempt would wait for a caster that is gone for ever.
        let error =
            exhaust(&mut caster.records(&RoverPosition::default(), 1_000_000)).unwrap_err().to_string();
        assert!(error.contains(said), "expected '{said}' in: {error}");
        assert!(error.contains("/BASE") && !error.contains("cret"), "{error}");
        caster.requests();
    }
}

#[test]
fn other_answers_are_tried_again_and_shown() {
    let busy = || vec![head("HTTP/1.1 503 Too many clients")];
    let caster = TestCaster::start(vec![busy(), vec![b"\x07garbage\r\n".to_vec()], busy()]);
    let error = exhaust(&mut caster.records(&RoverPosition::default(), 3)).unwrap_err().to_string();
    assert!(error.contains("503 Too many clients") && error.contains("3 attempts"), "{error}");
    caster.requests();
}

#[test]
fn a_stream_cut_in_the_middle_of_a_frame_goes_on_with_the_next() {
    let whole = frames(4);
    let cut = whole.len() - 3;
    let garbage = [b"\x00\xd3\xffgarbage".to_vec(), frames(2)].concat();
    let caster = TestCaster::start(vec![
        vec![[head("ICY 200 OK"), whole[..cut].to_vec()].concat()],
        vec![[head(CHUNKED), chunked(&garbage, 5)].concat()],
        // Damaged in its second chunk.
        vec![[head(CHUNKED), b"8\r\n".to_vec(), frame(1024), b"no line end".to_vec()].concat()],
        // Has served before: a refusal is not final.
        vec![head("HTTP/1.1 404 Not Found")],
        vec![[head("ICY 200 OK"), frames(1)].concat()],
    ]);
    let mut records = caster.records(&RoverPosition::default(), 4);
    exhaust(&mut records).unwrap();
    let skips = records.skips();
    assert_eq!(skips.count(NOT_READ), 3 + 2 + 1 + 1, "{skips}");
    assert_eq!(skips.count(Reason::ConnectionOpenedAgain), 3, "{skips}");
    assert_eq!(caster.requests().len(), 5);
}

#[test]
fn a_caster_hears_where_the_rover_is() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let serving = limits::spawn(move || {
        let (mut connection, _) = listener.accept().unwrap();
        let request = read_head(&mut connection);
        connection.write_all(&head("ICY 200 OK")).unwrap();
        // Not a byte before the position has come.
        let mut sentence = Vec::new();
        while !sentence.ends_with(b"\r\n") {
            let mut byte = [0];
            connection.read_exact(&mut byte).unwrap();
            sentence.push(byte[0]);
        }
        connection.write_all(&frames(1)).unwrap();
        (request, String::from_utf8(sentence).unwrap())
    });
    let rover = RoverPosition::default();
    rover.set(Geodetic::from_degrees(-35.5, -0.25, 12.0).geodetic_to_ecef());
    let caster = TestCaster { address, thread: limits::spawn(Vec::new) };
    let mut records = caster.records(&rover, 1);
    exhaust(&mut records).unwrap();
    assert_eq!(records.skips().count(NOT_READ), 1);
    let (request, sentence) = serving.join().unwrap();
    assert!(request.contains("\r\nNtrip-GGA: $GPGGA,"), "{request}");
    assert!(
        sentence.starts_with("$GPGGA,") && sentence.contains(",3530.00000,S,00015.00000,W,1,"),
        "{sentence}"
    );
}

const TABLE: &str =
    "STR;BASE;Here;RTCM 3.3;1005(1);2;GPS+GLO;n;DEU;49.1;12.9;0;0;x;none;B;N;9600;\r\nENDSOURCETABLE\r\n";

#[test]
fn sourcetables_of_both_revisions_are_read() {
    let second = "HTTP/1.1 200 OK\r\nContent-Type: gnss/sourcetable\r\nTransfer-Encoding: chunked";
    for reply in [
        [head(second), chunked(TABLE.as_bytes(), 9)].concat(),
        format!("SOURCETABLE 200 OK\r\nServer: x: y\r\nContent-Length: 85\r\n\r\n{TABLE}").into_bytes(),
    ] {
        let caster = TestCaster::start(vec![in_portions(&reply, 7)]);
        let address: Caster = format!("ntrip://{}", caster.address).parse().unwrap();
        let table = sourcetable(&address, &Stop::default()).unwrap();
        assert_eq!(table.streams.len(), 1);
        assert_eq!(table.streams[0].mount, "BASE");
        assert!(caster.requests()[0].starts_with("GET / HTTP/1.1\r\n"));
    }
    let page = "HTTP/1.1 200 OK\r\nContent-Type: text/html\r\n\r\n<html>It works!\r\n";
    let caster = TestCaster::start(vec![vec![page.as_bytes().to_vec()]]);
    let address: Caster = format!("ntrip://{}", caster.address).parse().unwrap();
    let error = sourcetable(&address, &Stop::default()).unwrap_err().to_string();
    assert!(error.contains("no sourcetable") && error.contains("'<html>It works!'"), "{error}");
    caster.requests();
    let caster = TestCaster::start(vec![vec![head("HTTP/1.1 401 Unauthorized")]]);
    let address: Caster = format!("ntrip://{}", caster.address).parse().unwrap();
    let error = sourcetable(&address, &Stop::default()).unwrap_err().to_string();
    assert!(error.contains("wants an account (401 Unauthorized)"), "{error}");
    caster.requests();
}

#[test]
fn the_command_lists_a_casters_streams() {
    let caster = TestCaster::start(vec![vec![format!("SOURCETABLE 200 OK\r\n{TABLE}").into_bytes()]]);
    let assert = assert_cmd::Command::new(env!("CARGO_BIN_EXE_cofix-agent"))
        .args(["sourcetable", &format!("ntrip://{}", caster.address)])
        .timeout(limits::LIMIT)
        .assert()
        .success();
    let text = String::from_utf8(assert.get_output().stdout.clone()).unwrap();
    assert!(text.contains("BASE") && text.contains("GPS+GLO") && text.ends_with("1 streams\n"), "{text}");
    caster.requests();
}
