//! Live hubs that run as processes of their own, and their agents.

#![allow(clippy::unwrap_used, clippy::panic, dead_code, missing_docs)] // helpers of tests

#[path = "../../../agent/tests/limits/mod.rs"]
pub mod limits;

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use cofix_agent::{AgentConfig, AgentError, AgentReport, Speed, Stop};
use cofix_common::simulation::Scenario;
use cofix_hub::replay::{Plan, PlannedPhone};
use limits::Running;

/// An agent in a thread.
pub type Agent = Running<Result<AgentReport, AgentError>>;

/// Three phones of a car for three minutes.
pub fn plan() -> Plan {
    cofix_hub::demo::plan(Scenario { duration_s: 180.0, ..Scenario::car(3) }).unwrap()
}

/// The session file of a live hub for the plan's phones.
pub fn write_session(folder: &Path, plan: &Plan) {
    let phones = plan.phones.iter().map(|phone| format!("[[phone]]\nname = '{}'\n", phone.name));
    let bound = "[[constraint]]\nkind = 'distance'\nmaximum_m = 2.0\n";
    let text = format!("group = '{}'\n{}{bound}", plan.group, phones.collect::<String>());
    std::fs::write(folder.join("car.toml"), text).unwrap();
}

pub fn free_endpoint() -> String {
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    format!("tcp/{}", port.local_addr().unwrap())
}

/// A hub that listens.
pub fn start_hub(folder: &Path, endpoint: &str, latency_s: &str, outputs: &[&str]) -> Child {
    let mut hub = Command::new(env!("CARGO_BIN_EXE_cofix-hub"))
        .current_dir(folder)
        .args(["run", "car.toml", "--until-finished", "--latency", latency_s, "--listen", endpoint])
        .args(outputs)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(hub.stderr.take().unwrap()).lines();
    let mut said = Vec::new();
    while !said.last().is_some_and(|line: &String| line.contains("listens on")) {
        said.push(lines.next().unwrap_or_else(|| panic!("the hub has ended: {said:?}")).unwrap());
    }
    // Its log is read, so that it never waits for that, and shown where a test fails.
    std::thread::spawn(move || lines.map_while(Result::ok).for_each(|line| println!("hub: {line}")));
    hub
}

pub fn start_agents(plan: &Plan, endpoint: &str) -> Vec<Agent> {
    plan.phones.iter().map(|phone| start_agent(plan, phone, endpoint, AgentConfig::KEPT_MESSAGES)).collect()
}

/// An agent at 20 times real time that keeps so many epochs.
pub fn start_agent(plan: &Plan, phone: &PlannedPhone, endpoint: &str, kept_messages: usize) -> Agent {
    let config = AgentConfig {
        products: plan.products.clone(),
        connect: vec![endpoint.to_owned()],
        speed: Speed::Times(20.0),
        kept_messages,
        ..AgentConfig::new(&plan.group, &phone.name, phone.source.clone())
    };
    limits::spawn(move || cofix_agent::run(&config, &Stop::default()))
}

/// The positions of a hub to which everything came in time, in `undisturbed.csv` too.
pub fn undisturbed(folder: &Path, plan: &Plan, latency_s: &str) -> String {
    let endpoint = free_endpoint();
    let mut hub =
        start_hub(folder, &endpoint, latency_s, &["--no-journal", "--positions", "undisturbed.csv"]);
    for agent in start_agents(plan, &endpoint) {
        agent.join().unwrap().unwrap();
    }
    assert!(limits::ended(&mut hub).success());
    read(folder, "undisturbed.csv")
}

pub fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap()
}
