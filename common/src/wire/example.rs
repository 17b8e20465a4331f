//! Messages for the tests of this module.

use nalgebra::Matrix3;

use super::EpochMessage;
use crate::filter::PhoneState;
use crate::frames::{Direction, Ecef, EcefVector};
use crate::gnss::{ClockGroup, Constellation, SatelliteId, SignalCode};
use crate::integrity::{
    GlobalTest, ProtectionLevels, RaimReport, SlopeLevels, StateReport, TestReport, Verdict,
};
use crate::measurement::{CorrectedObservation, RangeChange, RangeRate, SharedError, Usage};
use crate::solve::{Dops, PointSolution, VelocitySolution};
use crate::time::GpsTime;

/// A plausible observation of a GPS satellite.
pub(super) fn observation(number: u8) -> CorrectedObservation {
    CorrectedObservation {
        satellite: SatelliteId::new(Constellation::Gps, number),
        signal: SignalCode::new(b'1', b'C'),
        pseudorange_m: 22.1e6 + f64::from(number),
        pseudorange_sigma_m: 3.5,
        shared: SharedError { stated_sigma_m: 1.25, satellite_sigma_m: 0.75, ionosphere_m: 2.75 },
        range_rate: Some(RangeRate { range_rate_mps: -431.25, sigma_mps: 0.3, averaged_s: 0.0 }),
        range_change: Some(RangeChange {
            change_m: -431.5,
            sigma_m: 0.02,
            satellite_before: Ecef::new(15.599e6, 7.502e6, 20.098e6),
        }),
        cn0_dbhz: Some(38.5),
        direction: Direction { azimuth_rad: 1.25, elevation_rad: 0.75 },
        satellite_position: Ecef::new(15.6e6, 7.5e6, 20.1e6),
        satellite_velocity: EcefVector::new(1.0e3, -2.0e3, 1.5e3),
        usage: Usage::Used,
        residual_m: Some(-1.75),
    }
}

/// A plausible message with `count` observations.
pub(super) fn message(count: u8) -> EpochMessage {
    let mean = [-2.27e6, 5.01e6, 3.22e6, 5.0, -3.0, 1.0, 0.1, 0.2, -0.1];
    let groups = ClockGroup { constellation: Constellation::Gps, band: b'1' };
    EpochMessage {
        phone: "HP30".to_owned(),
        sequence: 7,
        time_gps: GpsTime::from_week_tow(2118, 397_141.999_759),
        observations: (1..=count).map(observation).collect(),
        changes_since_gps: Some(GpsTime::from_week_tow(2118, 397_140.999_759)),
        wls: Some(PointSolution {
            position: Ecef::new(-2.27e6, 5.01e6, 3.22e6),
            position_covariance: Matrix3::identity() * 4.0,
            clocks_m: vec![(groups, 71_234.5)],
            velocity: Some(VelocitySolution {
                velocity: EcefVector::new(5.0, -3.0, 1.0),
                covariance: Matrix3::identity() * 0.04,
            }),
            dops: Dops { gdop: 2.5, pdop: 2.0, hdop: 1.1, vdop: 1.7 },
            used: u16::from(count),
        }),
        local: Some(PhoneState { mean: mean.into(), covariance: nalgebra::SMatrix::identity() }),
        local_integrity: Some(StateReport {
            verdict: Verdict::Reliable,
            test: Some(TestReport {
                verdict: Verdict::Reliable,
                global_test: Some(GlobalTest { statistic: 8.5, threshold: 31.3, degrees_of_freedom: 11 }),
                excluded: 1,
            }),
            protection: Some(ProtectionLevels { horizontal_m: 11.0, vertical_m: 17.0 }),
        }),
        raim: RaimReport {
            verdict: Verdict::Reliable,
            global_test: Some(GlobalTest { statistic: 9.5, threshold: 27.9, degrees_of_freedom: 12 }),
            excluded: 1,
            protection: Some(ProtectionLevels { horizontal_m: 14.0, vertical_m: 21.0 }),
            slope: Some(SlopeLevels { horizontal_m: 12.0, vertical_m: 17.0, arp_m: 8.0 }),
            velocity: Some(TestReport {
                verdict: Verdict::Reliable,
                global_test: Some(GlobalTest { statistic: 3.5, threshold: 22.5, degrees_of_freedom: 6 }),
                excluded: 0,
            }),
        },
    }
}
