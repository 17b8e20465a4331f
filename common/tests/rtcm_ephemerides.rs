//! Ephemeris messages written by another implementation (rtcm-rs).

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod rtcm_support;

use std::f64::consts::PI;

use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::rtcm::{RtcmDecoder, RtcmOptions};
use cofix_common::orbit::{KeplerEphemeris, NavigationMessage, is_healthy};
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;
use rtcm_rs::Message;
use rtcm_rs::msg::{Msg1019T, Msg1042T, Msg1044T, Msg1045T, Msg1046T};
use rtcm_support::{decode, frame, lnav};

fn ephemeris(message: &Message) -> KeplerEphemeris {
    match decode(&[&frame(message)]) {
        (records, skips) if skips.is_empty() => match records.as_slice() {
            [Record::Ephemeris(ephemeris)] => **ephemeris,
            other => panic!("{other:?}"),
        },
        (_, skips) => panic!("{skips}"),
    }
}

/// What an orbit must be like, with half a unit of the last bit as tolerance. Sign and order of all fields are told apart.
fn check_orbit(e: &KeplerEphemeris) {
    let near = |value: f64, expected: f64, unit: f64| {
        assert!((value - expected).abs() <= unit, "{value:e} is not {expected:e} in {}", e.satellite);
    };
    let semicircle = PI * f64::powi(2.0, -31);
    near(e.sqrt_a, 5_153.707_128_525, f64::powi(2.0, -19));
    near(e.eccentricity, 0.010_003_942_297, f64::powi(2.0, -33));
    near(e.m0_rad, -0.2 * PI, semicircle);
    near(e.omega0_rad, 0.8189 * PI, semicircle);
    near(e.i0_rad, 0.312 * PI, semicircle);
    near(e.omega_rad, -0.2527 * PI, semicircle);
    near(e.delta_n_radps, 1.37e-9 * PI, PI * f64::powi(2.0, -43));
    near(e.i_dot_radps, -1.5e-10 * PI, PI * f64::powi(2.0, -43));
    near(e.omega_dot_radps, -2.669e-9 * PI, PI * f64::powi(2.0, -43));
    near(e.cuc_cus_rad.0, -2.177_432e-6, f64::powi(2.0, -29));
    near(e.cuc_cus_rad.1, 1.937_151e-6, f64::powi(2.0, -29));
    near(e.cic_cis_rad.0, -1.508_743e-7, f64::powi(2.0, -29));
    near(e.cic_cis_rad.1, 1.359_731e-7, f64::powi(2.0, -29));
    near(e.crc_crs_m.0, 353.968_75, 0.0);
    near(e.crc_crs_m.1, -39.6875, 0.0);
    near(e.clock.0, -1.604_342_833_161e-5, f64::powi(2.0, -31));
    near(e.clock.1, 7.048_584e-12, f64::powi(2.0, -43));
    assert!(is_healthy(e));
}

#[test]
fn gps_and_qzss_ephemerides() {
    let gps = ephemeris(&Message::Msg1019(lnav()));
    check_orbit(&gps);
    assert_eq!(
        (gps.satellite.to_string(), gps.message, gps.issue_of_data, gps.issue_of_clock),
        ("G07".into(), NavigationMessage::Lnav, 58, 0x23a)
    );
    assert_eq!(gps.toe, GpsTime::from_week_tow(2118, 396_000.0));
    assert_eq!((gps.toc, gps.toe_own_tow_s, gps.accuracy_m), (gps.toe, 396_000.0, 4.0));
    assert!((gps.group_delays_s.0 - 5.122_274e-9).abs() < 1e-15);
    let unhealthy = ephemeris(&Message::Msg1019(Msg1019T { sv_health_ind: 63, ..lnav() }));
    assert_eq!((unhealthy.health, is_healthy(&unhealthy)), (63.0, false));

    let g = lnav();
    let qzss = ephemeris(&Message::Msg1044(Msg1044T {
        qzss_satellite_id: 2,
        toc_s: g.toc_s,
        af1_s_s: g.af1_s_s,
        af0_s: g.af0_s,
        iode: 58,
        iodc: g.iodc,
        crs_m: g.crs_m,
        delta_n_sc_s: g.delta_n_sc_s,
        m0_sc: g.m0_sc,
        cuc_rad: g.cuc_rad,
        eccentricity: g.eccentricity,
        cus_rad: g.cus_rad,
        sqrt_a_sqrt_m: g.sqrt_a_sqrt_m,
        toe_s: g.toe_s,
        cic_rad: g.cic_rad,
        omega0_sc: g.omega0_sc,
        cis_rad: g.cis_rad,
        i0_sc: g.i0_sc,
        crc_m: g.crc_m,
        omega_sc: g.omega_sc,
        omegadot_sc_s: g.omegadot_sc_s,
        idot_sc_s: g.idot_sc_s,
        qzss_week_number: g.gps_week_number,
        ura_index: 2,
        tgd_s: g.tgd_s,
        ..Msg1044T::default()
    }));
    check_orbit(&qzss);
    assert_eq!(qzss.satellite.to_string(), "J02");
    assert_eq!(KeplerEphemeris { satellite: gps.satellite, ..qzss }, gps);
}

fn inav() -> Msg1046T {
    let g = lnav();
    Msg1046T {
        gal_satellite_id: 11,
        gal_week_number: 2118 - 1024,
        iodnav: 97,
        sisa_e1_e5b_index: 107,
        idot_sc_s: -1.5e-10,
        toc_s: 396_600.0,
        af1_s_s: g.af1_s_s.into(),
        af0_s: g.af0_s,
        crs_m: g.crs_m,
        delta_n_sc_s: g.delta_n_sc_s,
        m0_sc: g.m0_sc,
        cuc_rad: g.cuc_rad,
        eccentricity: g.eccentricity,
        cus_rad: g.cus_rad,
        sqrt_a_sqrt_m: g.sqrt_a_sqrt_m,
        toe_s: 396_600.0,
        cic_rad: g.cic_rad,
        omega0_sc: g.omega0_sc,
        cis_rad: g.cis_rad,
        i0_sc: g.i0_sc,
        crc_m: g.crc_m,
        omega_sc: g.omega_sc,
        omegadot_sc_s: g.omegadot_sc_s,
        bgd_e1_e5a_s: -1.862_645e-9,
        bgd_e1_e5b_s: -2.095_476e-9,
        ..Msg1046T::default()
    }
}

#[test]
fn galileo_ephemerides() {
    let inav = inav();
    let e = ephemeris(&Message::Msg1046(inav.clone()));
    check_orbit(&e);
    assert_eq!(
        (e.satellite.to_string(), e.message, e.issue_of_data),
        ("E11".into(), NavigationMessage::GalileoInav, 97)
    );
    assert_eq!((e.toe, e.toc), (GpsTime::from_week_tow(2118, 396_600.0), e.toe));
    assert!((e.accuracy_m - 3.12).abs() < 1e-9);
    assert!(
        (e.group_delays_s.0 + 1.862_645e-9).abs() < 1e-15
            && (e.group_delays_s.1 + 2.095_476e-9).abs() < 1e-15
    );
    // RINEX, table A8: bits 0 E1-B validity, 1-2 E1-B health, 3 E5a validity, 4-5 E5a health, 6-8 E5b.
    let health = ephemeris(&Message::Msg1046(Msg1046T {
        e1_b_sig_health_ind: 2,
        e5b_data_validity_flag: 1,
        ..inav.clone()
    }));
    assert_eq!(health.health, f64::from(2 << 1 | 1 << 6));

    let fnav = ephemeris(&Message::Msg1045(Msg1045T {
        gal_satellite_id: 11,
        gal_week_number: inav.gal_week_number,
        sisa_e1_e5a_index: 255,
        idot_sc_s: inav.idot_sc_s,
        toc_s: inav.toc_s,
        af1_s_s: inav.af1_s_s,
        af0_s: inav.af0_s,
        crs_m: inav.crs_m,
        delta_n_sc_s: inav.delta_n_sc_s,
        m0_sc: inav.m0_sc,
        cuc_rad: inav.cuc_rad,
        eccentricity: inav.eccentricity,
        cus_rad: inav.cus_rad,
        sqrt_a_sqrt_m: inav.sqrt_a_sqrt_m,
        toe_s: inav.toe_s,
        cic_rad: inav.cic_rad,
        omega0_sc: inav.omega0_sc,
        cis_rad: inav.cis_rad,
        i0_sc: inav.i0_sc,
        crc_m: inav.crc_m,
        omega_sc: inav.omega_sc,
        omegadot_sc_s: inav.omegadot_sc_s,
        bgd_e1_e5a_s: inav.bgd_e1_e5a_s,
        ..Msg1045T::default()
    }));
    check_orbit(&fnav);
    assert_eq!((fnav.message, fnav.accuracy_m), (NavigationMessage::GalileoFnav, 10.0));
    assert!(fnav.group_delays_s.1.is_nan() && fnav.group_delays_s.0 == e.group_delays_s.0);
}

#[test]
fn beidou_ephemerides() {
    let g = lnav();
    let beidou = ephemeris(&Message::Msg1042(Msg1042T {
        bds_satellite_id: 21,
        bds_week_number: 2118 - 1356,
        ura_index: 0,
        idot_sc_s: g.idot_sc_s,
        aode: 3,
        aodc: 17,
        toc_s: 396_000.0,
        a1_s_s: g.af1_s_s.into(),
        a0_s: g.af0_s,
        crs_m: g.crs_m,
        delta_n_sc_s: g.delta_n_sc_s,
        m0_sc: g.m0_sc,
        cuc_rad: g.cuc_rad,
        eccentricity: g.eccentricity,
        cus_rad: g.cus_rad,
        sqrt_a_sqrt_m: g.sqrt_a_sqrt_m,
        toe_s: 396_000.0,
        cic_rad: g.cic_rad,
        omega0_sc: g.omega0_sc,
        cis_rad: g.cis_rad,
        i0_sc: g.i0_sc,
        crc_m: g.crc_m,
        omega_sc: g.omega_sc,
        omegadot_sc_s: g.omegadot_sc_s,
        tgd1_s: 5.7e-9,
        tgd2_s: -9.3e-9,
        ..Msg1042T::default()
    }));
    check_orbit(&beidou);
    assert_eq!(
        (beidou.message, beidou.issue_of_data, beidou.issue_of_clock, beidou.accuracy_m),
        (NavigationMessage::BeidouD1D2, 3, 17, 2.0)
    );
    assert_eq!(beidou.toe, GpsTime::from_beidou_week_tow(762, 396_000.0));
    assert_eq!((beidou.toc, beidou.toe_own_tow_s), (beidou.toe, 396_000.0));
    assert!(
        (beidou.group_delays_s.0 - 5.7e-9).abs() < 1e-15 && (beidou.group_delays_s.1 + 9.3e-9).abs() < 1e-15
    );
}

#[test]
fn ephemerides_come_once_and_absurd_ones_not_at_all() {
    let message = |lnav| frame(&Message::Msg1019(lnav));
    let stream = [
        message(lnav()),
        message(lnav()),
        message(Msg1019T { iode: 59, toe_s: 403_200.0, toc_s: 403_200.0, ..lnav() }),
        message(Msg1019T { sqrt_a_sqrt_m: 100.0, ..lnav() }),
        message(Msg1019T { gps_satellite_id: 0, ..lnav() }),
        message(Msg1019T { toc_s: 100_000.0, ..lnav() }),
    ];
    let (records, skips) = decode(&[&stream.concat()]);
    assert_eq!(records.len(), 2);
    assert_eq!((skips.total(), skips.count(Reason::EphemerisImpossible)), (3, 3), "{skips}");
}

/// An ephemeris of the first hours of a week is sent before that week begins.
#[test]
fn weeks_are_completed_across_their_end() {
    let near = GpsTime::from_week_tow(2118, 604_790.0);
    for (week, toe_s, expected) in
        [(2118, 0.0, 2119), (2119, 0.0, 2119), (2118, 597_600.0, 2118), (2119, 597_600.0, 2118)]
    {
        let mut decoder = RtcmDecoder::new(RtcmOptions::near(near));
        let message = Msg1019T { gps_week_number: week % 1024, toe_s, toc_s: toe_s, ..lnav() };
        decoder.feed(&frame(&Message::Msg1019(message))).unwrap();
        let Some(Record::Ephemeris(ephemeris)) = decoder.next_record() else { panic!("{}", decoder.skips()) };
        assert_eq!(
            ephemeris.toe,
            GpsTime::from_week_tow(expected, f64::from(toe_s)),
            "week {week}, toe {toe_s}"
        );
    }
}
