//! Differential corrections on recordings of base and rover: what they bring against the truth.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod beside;

use std::sync::Arc;

use beside::{pixel4_table, required};
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::frames::{Ecef, Geodetic, LocalFrame};
use cofix_common::gnss::{Constellation, ObservationEpoch};
use cofix_common::measurement::{
    CorrectionOptions, Corrector, Differential, DifferentialCounts, DifferentialOptions, Uncorrected,
    without_position,
};
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::Products;
use cofix_common::solve::solve_position;
use cofix_common::time::GpsTime;

fn observations(path: &str) -> Vec<ObservationEpoch> {
    ObservationFile::parse(&required(path)).unwrap().epochs
}

fn products(path: &str) -> Arc<Products> {
    let file = NavigationFile::parse(&required(path)).unwrap();
    Arc::new(Products::new(Vec::new(), vec![file]))
}

/// A rover's session beside a base.
struct Session {
    products: Arc<Products>,
    rover: Vec<ObservationEpoch>,
    base: Vec<ObservationEpoch>,
    base_position: Ecef,
    correction: CorrectionOptions,
    /// A base epoch is known so long after its time.
    latency_s: f64,
}

/// Positions of the epochs that can be solved.
#[derive(Default)]
struct Solved {
    positions: Vec<(GpsTime, Ecef)>,
    /// Standard deviations of the positions over errors: root mean square of what the covariance promises, m.
    promised_m: f64,
    counts: DifferentialCounts,
}

impl Session {
    fn mask(degrees: f64) -> CorrectionOptions {
        CorrectionOptions { elevation_mask_rad: degrees.to_radians(), ..CorrectionOptions::default() }
    }

    /// Only the given systems and bands.
    fn keep(mut self, wanted: &[(Constellation, u8)]) -> Self {
        for epoch in self.rover.iter_mut().chain(&mut self.base) {
            epoch.observations.retain(|o| wanted.contains(&(o.satellite.constellation, o.signal.band)));
        }
        self
    }

    /// Each epoch by itself; with corrections when there are options for them.
    fn solve(&self, options: Option<DifferentialOptions>) -> Solved {
        let mut corrector = Corrector::new(self.products.clone(), self.correction.clone());
        let mut differential =
            options.map(|options| Differential::new(self.products.clone(), self.correction.clone(), options));
        let mut base = self.base.iter().peekable();
        let mut solved = Solved::default();
        for epoch in &self.rover {
            if let Some(differential) = &mut differential {
                while let Some(known) = base.next_if(|b| b.time_gps + self.latency_s <= epoch.time_gps) {
                    differential.add(0, known.clone(), self.base_position);
                }
            }
            let prepared = corrector.prepare(epoch);
            let centre = Ecef::new(0.0, 0.0, 0.0);
            let Ok(rough) = solve_position(&without_position(&prepared), centre) else { continue };
            let mut position = rough.position();
            for round in 0..2 {
                let (mut corrected, _) = corrector.finish(&prepared, position, epoch.time_gps);
                if let Some(differential) = &mut differential {
                    let applied = differential.apply(&mut corrected, position, epoch.time_gps);
                    if round == 1 {
                        solved.counts.add(applied.counts);
                    }
                }
                let Ok(fit) = solve_position(&corrected, position) else { break };
                position = fit.position();
                if round == 1 {
                    solved.positions.push((epoch.time_gps, position));
                    solved.promised_m += fit.position_covariance().trace();
                }
            }
        }
        solved.promised_m = (solved.promised_m / solved.positions.len() as f64).sqrt();
        if let Some(differential) = &differential {
            println!("    {:?}; {}", solved.counts, differential.skips());
        }
        solved
    }
}

/// Percentiles of errors, m.
#[derive(Clone, Copy, Debug)]
struct Errors {
    horizontal: (f64, f64),
    vertical: (f64, f64),
}

fn errors(name: &str, solved: &Solved, truth: impl Fn(GpsTime) -> Option<Ecef>) -> Errors {
    let (mut horizontal, mut vertical, mut square) = (Vec::new(), Vec::new(), 0.0);
    for (time, position) in &solved.positions {
        let Some(truth) = truth(*time) else { continue };
        let error = LocalFrame::at(truth).ecef_to_enu(*position);
        horizontal.push(error.horizontal());
        vertical.push(error.up.abs());
        square += error.vector().norm_squared();
    }
    let rms_m = (square / horizontal.len() as f64).sqrt();
    let percentiles = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        (values[values.len() / 2], values[values.len() * 95 / 100])
    };
    let errors = Errors { horizontal: percentiles(&mut horizontal), vertical: percentiles(&mut vertical) };
    println!(
        "{name}: {} epochs, horizontal {:.2} / {:.2} m, vertical {:.2} / {:.2} m, rms {rms_m:.2} m, promised {:.2} m",
        horizontal.len(),
        errors.horizontal.0,
        errors.horizontal.1,
        errors.vertical.0,
        errors.vertical.1,
        solved.promised_m
    );
    errors
}

const L1: [(Constellation, u8); 4] = [
    (Constellation::Gps, b'1'),
    (Constellation::Glonass, b'1'),
    (Constellation::Galileo, b'1'),
    (Constellation::Beidou, b'2'),
];

/// A static pair, a few metres apart.
fn mat() -> (Session, Ecef) {
    let session = Session {
        products: products("oracle/inputs/mat_base.nav.gz"),
        rover: observations("oracle/inputs/mat_rover.obs.gz"),
        base: observations("oracle/inputs/mat_base.obs.gz"),
        base_position: Ecef::new(-3_817_681.121_3, 3_562_839.431_1, 3_650_159.159_3),
        correction: Session::mask(15.0),
        latency_s: 0.0,
    };
    let truth = Geodetic::from_degrees(35.134_699_01, 136.977_575_49, 104.862_6).geodetic_to_ecef();
    (session, truth)
}

/// What the reference (RTKLIB, code differences with a filter over time) reached.
fn reference(path: &str, truth: Ecef) -> Errors {
    let text = String::from_utf8(required(path)).unwrap();
    let mut solved = Solved::default();
    for line in text.lines().filter(|line| !line.starts_with('%')) {
        let fields: Vec<f64> = line.split_whitespace().map(|field| field.parse().unwrap()).collect();
        let time = GpsTime::from_week_tow(2320, fields[1]);
        solved.positions.push((time, Ecef::new(fields[2], fields[3], fields[4])));
    }
    errors("    reference", &solved, |_| Some(truth))
}

#[test]
#[ignore = "needs the reference data"]
fn a_pair_of_receivers() {
    let (session, truth) = mat();
    let session = session.keep(&L1);
    let plain = errors("mat, plain", &session.solve(None), |_| Some(truth));
    let solved = session.solve(Some(DifferentialOptions::default()));
    assert_eq!((solved.counts.missing, solved.counts.too_old, solved.counts.refused), (0, 0, 0));
    let with = errors("mat, differential", &solved, |_| Some(truth));
    assert!(with.horizontal.0 < 0.3 && with.horizontal.1 < 0.5, "{with:?}");
    assert!(with.vertical.0 < 0.35 && with.vertical.1 < 0.85, "{with:?}");
    assert!(with.horizontal.0 < 0.1 * plain.horizontal.0 && with.vertical.0 < 0.2 * plain.vertical.0);
    let reference = reference("oracle/pos/mat__ex__dgps_GREC_el15.pos", truth);
    // It has a filter over time.
    assert!(with.horizontal.1 < 2.0 * reference.horizontal.1 && with.vertical.1 < 1.1 * reference.vertical.1);
}

/// A base that tracks GPS only: what the others do beside it.
#[test]
#[ignore = "needs the reference data"]
fn a_base_that_lacks_systems() {
    let (mut session, truth) = mat();
    session = session.keep(&L1);
    for epoch in &mut session.base {
        epoch.observations.retain(|o| o.satellite.constellation == Constellation::Gps);
    }
    let plain = errors("mat, plain", &session.solve(None), |_| Some(truth));
    let mut horizontal_m = Vec::new();
    for sigma_m in [1.0, 3.0, 5.0, 10.0] {
        let options = DifferentialOptions {
            uncorrected: Uncorrected::Kept { sigma_m },
            ..DifferentialOptions::default()
        };
        let name = format!("mat, base with GPS, others with {sigma_m} m more");
        horizontal_m.push(errors(&name, &session.solve(Some(options)), |_| Some(truth)).horizontal.0);
    }
    let options = DifferentialOptions { uncorrected: Uncorrected::Dropped, ..DifferentialOptions::default() };
    let dropped = session.solve(Some(options));
    horizontal_m.push(errors("mat, base with GPS, others dropped", &dropped, |_| Some(truth)).horizontal.0);
    assert_eq!((dropped.counts.corrected, dropped.counts.missing), (2_709, 9_331));
    assert!(horizontal_m.is_sorted_by(|a, b| a > b), "{horizontal_m:?}");
    assert!(horizontal_m[2] < 0.4 * plain.horizontal.0 && horizontal_m[4] < 0.4, "{horizontal_m:?}");
}

#[test]
#[ignore = "needs the reference data"]
fn a_base_of_thirty_seconds() {
    let products = products("oracle/inputs/07590920.05n");
    let rover = observations("oracle/inputs/07590920.05o");
    let base = observations("oracle/inputs/30400920.05o");
    let base_position = Ecef::new(-3_978_241.958, 3_382_840.234, 3_649_900.853);
    let session =
        Session { products, rover, base, base_position, correction: Session::mask(15.0), latency_s: 0.0 }
            .keep(&L1);
    // The carrier-phase solution of the reference stands for the truth.
    let text =
        String::from_utf8(required("oracle/pos/rtk05__ex__rtk_kinematic_G_l1_el15_continuous.pos")).unwrap();
    let fixed: Vec<Ecef> = text
        .lines()
        .filter(|line| !line.starts_with('%'))
        .map(|line| line.split_whitespace().map(|field| field.parse().unwrap()).collect::<Vec<f64>>())
        .filter(|fields| fields[5] == 1.0)
        .map(|fields| Ecef::new(fields[2], fields[3], fields[4]))
        .collect();
    let sum = fixed.iter().fold(nalgebra::Vector3::zeros(), |sum, position| sum + position.0);
    let truth = Ecef(sum / fixed.len() as f64);
    println!("{} fixed, baseline {:.0} m", fixed.len(), truth.distance_m(base_position));
    let plain = errors("rtk05, plain", &session.solve(None), |_| Some(truth));
    let with = session.solve(Some(DifferentialOptions::default()));
    let with = errors("rtk05, differential", &with, |_| Some(truth));
    assert!(with.horizontal.0 < 0.45 && with.horizontal.1 < 1.0 && with.vertical.0 < 0.5, "{with:?}");
    assert!(with.horizontal.0 < 0.5 * plain.horizontal.0 && with.vertical.0 < 0.5 * plain.vertical.0);
    let late = Session { latency_s: 30.0, ..session };
    let late = late.solve(Some(DifferentialOptions::default()));
    let late = errors("rtk05, differential 30 s late", &late, |_| Some(truth));
    assert!(late.horizontal.0 < 0.45 && late.horizontal.1 < 1.6 && late.vertical.0 < 0.5, "{late:?}");
}

#[test]
#[ignore = "needs the reference data"]
fn a_phone_and_a_base_at_some_distance() {
    use cofix_common::formats::gsdc::{DerivedFile, ground_truth};
    use cofix_common::measurement::RecordedEpoch;
    let folder = "data/gsdc-2020-05-14-mtv1";
    let products = products(&format!("{folder}/hour1350.20n"));
    let base = observations(&format!("{folder}/slac1350.obs"));
    let truth = required(&format!("{folder}/Pixel4_ground_truth.csv"));
    let rover = DerivedFile::parse(&pixel4_table())
        .unwrap()
        .epochs
        .iter()
        .map(RecordedEpoch::to_observations)
        .collect();
    let (truth, _) = ground_truth(&truth).unwrap();
    let at = |time: GpsTime| truth.at(time, &[1]).map(|point| point.position);
    let mut session = Session {
        products,
        rover,
        base,
        // The header's position is in NAD83, as it is usual there: 1.6 m from that in the frame of the orbits.
        base_position: Ecef::new(-2_703_116.218, -4_291_767.079, 3_854_247.835),
        correction: CorrectionOptions::default(),
        latency_s: 0.0,
    };
    let plain = errors("phone, plain", &session.solve(None), at);
    let with = session.solve(Some(DifferentialOptions::default()));
    assert_eq!((with.counts.missing, with.counts.too_old, with.counts.refused), (0, 0, 0));
    let with = errors("phone, differential", &with, at);
    // A phone's own multipath outweighs what the base knows; heights gain.
    assert!(
        with.horizontal.0 < 1.05 * plain.horizontal.0 && with.horizontal.1 < plain.horizontal.1,
        "{with:?}"
    );
    assert!(with.vertical.0 < 0.75 * plain.vertical.0, "{with:?}");
    session.base_position = Ecef::new(-2_703_115.266, -4_291_768.344, 3_854_247.955);
    errors("phone, base's position in NAD83", &session.solve(Some(DifferentialOptions::default())), at);
}
