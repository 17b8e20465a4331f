//! One phone's pipeline with a base station beside it, on a recorded pair of receivers: least squares with RAIM and the local filter.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

#[path = "../../common/tests/beside/mod.rs"]
mod beside;

use std::sync::Arc;

use cofix_common::formats::rinex::ObservationFile;
use cofix_common::frames::{Ecef, Geodetic, LocalFrame};
use cofix_common::measurement::DifferentialOptions;
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::Products;
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};

fn input(path: &str) -> Vec<u8> {
    beside::required(&format!("oracle/inputs/{path}"))
}

/// 50th percentile of horizontal and vertical errors of least squares and filter, m.
#[derive(Debug)]
struct Medians {
    wls: (f64, f64),
    local: (f64, f64),
}

fn medians(positions: &[(Ecef, Ecef)], truth: Ecef) -> Medians {
    let frame = LocalFrame::at(truth);
    let median = |value: &dyn Fn(&(Ecef, Ecef)) -> f64| {
        let mut values: Vec<f64> = positions.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let horizontal = |position: Ecef| frame.ecef_to_enu(position).horizontal();
    let vertical = |position: Ecef| frame.ecef_to_enu(position).up.abs();
    Medians {
        wls: (median(&|p| horizontal(p.0)), median(&|p| vertical(p.0))),
        local: (median(&|p| horizontal(p.1)), median(&|p| vertical(p.1))),
    }
}

#[test]
#[ignore = "needs the reference data"]
fn both_solutions_gain_by_a_base() {
    let (navigation, rover, base) =
        (input("mat_base.nav.gz"), input("mat_rover.obs.gz"), input("mat_base.obs.gz"));
    let products = Arc::new(Products::new(Vec::new(), vec![NavigationFile::parse(&navigation).unwrap()]));
    let (rover, base) = (ObservationFile::parse(&rover).unwrap(), ObservationFile::parse(&base).unwrap());
    let base_position = Ecef::new(-3_817_681.121_3, 3_562_839.431_1, 3_650_159.159_3);
    let truth = Geodetic::from_degrees(35.134_699_01, 136.977_575_49, 104.862_6).geodetic_to_ecef();
    let solve = |with_base: bool| {
        let mut pipeline = PhonePipeline::new("p", products.clone(), PipelineOptions::default());
        if with_base {
            pipeline.use_bases(DifferentialOptions::default());
        }
        let mut bases = base.epochs.iter().peekable();
        let mut positions = Vec::new();
        for epoch in &rover.epochs {
            while let Some(known) = bases.next_if(|known| known.time_gps <= epoch.time_gps) {
                pipeline.add_base_epoch(0, known.clone(), base_position);
            }
            let message = pipeline.process(epoch);
            let (Some(wls), Some(local)) = (message.wls, message.local) else { continue };
            positions.push((wls.position, local.position()));
        }
        println!("{:?}; {}", pipeline.differential_counts(), pipeline.skips());
        assert!(positions.len() >= 300, "{} positions", positions.len());
        medians(&positions, truth)
    };
    let (plain, with) = (solve(false), solve(true));
    println!("without {plain:.2?}\nwith    {with:.2?}");
    assert!(with.wls.0 < 0.05 * plain.wls.0 && with.local.0 < 0.05 * plain.local.0, "{plain:?} {with:?}");
    assert!(with.wls.0 < 0.15 && with.wls.1 < 0.35 && with.local.0 < 0.15 && with.local.1 < 0.4, "{with:?}");
}
