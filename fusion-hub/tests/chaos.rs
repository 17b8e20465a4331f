//! A trial in which hubs are killed and paused and links are cut, in an order by chance: nothing is lost, and its journal gives what an undisturbed trial gives.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)] // helpers of tests

mod hubs;
#[path = "../../tests/src/slow_link.rs"]
#[allow(dead_code)] // it is not slow here
mod slow_link;

use std::process::{Child, Command};
use std::time::Duration;

use assert_cmd::Command as Checked;
use cofix_agent::AgentConfig;
use cofix_common::simulation::Scenario;
use cofix_hub::replay::Plan;
use hubs::{free_endpoint, limits, read, start_agent, start_hub, undisturbed, write_session};
use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use slow_link::SlowLink;

/// Longer than any disturbance, s.
const LATENCY_S: &str = "30";
const OUTPUTS: [&str; 6] = ["--recording", "live.rrd", "--report", "live.json", "--positions", "live.csv"];

#[derive(Clone, Copy, Debug)]
enum Disturbance {
    Kill,
    /// The hub stands still.
    Pause,
    /// Of one agent.
    CutLink(usize),
    CutAll,
}

/// How many disturbances, half of them kills: few, or as many as the variable COFIX_CHAOS says.
fn disturbances() -> usize {
    std::env::var("COFIX_CHAOS").ok().and_then(|text| text.parse().ok()).unwrap_or(6)
}

fn plan(disturbances: usize) -> Plan {
    let duration_s = 80.0 + 40.0 * disturbances as f64;
    cofix_hub::demo::plan(Scenario { duration_s, ..Scenario::car(3) }).unwrap()
}

fn signal(hub: &Child, name: &str) {
    let status = Command::new("kill").args([name, &hub.id().to_string()]).status().unwrap();
    assert!(status.success());
}

fn disturb(
    what: Disturbance,
    hub: &mut Child,
    links: &[SlowLink],
    restart: impl Fn() -> Child,
    lasting: Duration,
) {
    println!("{what:?} for {lasting:?}");
    match what {
        Disturbance::Kill => {
            hub.kill().unwrap();
            hub.wait().unwrap();
            std::thread::sleep(lasting);
            *hub = restart();
        }
        Disturbance::Pause => {
            signal(hub, "-STOP");
            std::thread::sleep(lasting);
            signal(hub, "-CONT");
        }
        Disturbance::CutLink(_) | Disturbance::CutAll => {
            let is_cut = |place: usize| match what {
                Disturbance::CutLink(phone) => place == phone,
                _ => true,
            };
            let set = |now: bool| {
                for (_, link) in links.iter().enumerate().filter(|(place, _)| is_cut(*place)) {
                    link.set_cut(now);
                }
            };
            set(true);
            std::thread::sleep(lasting);
            set(false);
        }
    }
}

#[test]
fn after_kills_pauses_and_cuts_nothing_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let count = disturbances();
    let plan = plan(count);
    write_session(folder.path(), &plan);
    let expected = undisturbed(folder.path(), &plan, LATENCY_S);
    let endpoint = free_endpoint();
    let start = || start_hub(folder.path(), &endpoint, LATENCY_S, &OUTPUTS);
    let mut hub = start();
    let links: Vec<SlowLink> = plan.phones.iter().map(|_| SlowLink::to(&endpoint).unwrap()).collect();
    let agents: Vec<_> = plan
        .phones
        .iter()
        .zip(&links)
        .map(|(phone, link)| start_agent(&plan, phone, &link.endpoint, AgentConfig::KEPT_MESSAGES))
        .collect();
    let kinds = [Disturbance::Pause, Disturbance::CutLink(0), Disturbance::CutLink(2), Disturbance::CutAll];
    let mut chance = ChaCha8Rng::seed_from_u64(7);
    for round in 0..count {
        std::thread::sleep(Duration::from_millis(chance.random_range(300..900)));
        let lasting = Duration::from_millis(chance.random_range(100..1_500));
        let what = if round % 2 == 0 { Disturbance::Kill } else { *kinds.choose(&mut chance).unwrap() };
        disturb(what, &mut hub, &links, start, lasting);
    }
    for agent in agents {
        agent.join().unwrap().unwrap();
    }
    // A phone whose link is cut is not waited for: its epochs come too late, which the exit code tells.
    let code = limits::ended(&mut hub).code();
    let report: Value = serde_json::from_str(&read(folder.path(), "live.json")).unwrap();
    assert!(plan.phones.iter().all(|phone| report["lost"][&phone.name] == 0), "{}", report["lost"]);
    let again = |arguments: &[&str]| {
        let outputs = ["--positions", "again.csv", "--report", "again.json", "--overwrite"];
        let mut command = Checked::cargo_bin("cofix-hub").unwrap();
        command.current_dir(folder.path()).args(["replay", "--journal", "live.mcap"]).args(outputs);
        command.args(arguments).assert()
    };
    again(&[]).code(code.unwrap());
    assert!(read(folder.path(), "again.csv") == read(folder.path(), "live.csv"));
    assert_eq!(read(folder.path(), "again.json"), read(folder.path(), "live.json"));
    again(&["--late"]).success();
    assert!(read(folder.path(), "again.csv") == expected, "the positions are others");
}
