//! Galileo F/NAV (Galileo OS SIS ICD 2.1, 4.2).

use cofix_common::orbit::{KeplerEphemeris, sisa_m};
use cofix_common::time::GpsTime;

use super::{Bits, remainder, semicircles, units};

/// Pages 1 to 4, of which the first begins at `sent`, each in 30 bytes.
pub fn pages(e: &KeplerEphemeris, sent: GpsTime) -> [Vec<u8>; 4] {
    let issue = i64::from(e.issue_of_data);
    let accuracy = (0..256).find(|index| sisa_m(*index) == e.accuracy_m).unwrap_or(255);
    #[allow(clippy::cast_possible_truncation)]
    let health = e.health as i64;
    let minutes = |time: GpsTime| units(time.tow_s() / 60.0, 0);
    let time = |seconds: f64| (sent + seconds).week() - 1024;
    let second = |seconds: f64| units((sent + seconds).tow_s(), 0);
    let mut pages: [Bits; 4] = Default::default();
    let [one, two, three, four] = &mut pages;
    one.put(1, 6).put(e.satellite.number.into(), 6).put(issue, 10).put(minutes(e.toc), 14);
    one.put(units(e.clock.0, -34), 31).put(units(e.clock.1, -46), 21).put(units(e.clock.2, -59), 6);
    one.put(i64::try_from(accuracy).unwrap(), 8).put(0, 11 + 11 + 14 + 5);
    one.put(units(e.group_delays_s.0, -32), 10).put(health >> 4, 2);
    one.put(time(0.0), 12).put(second(0.0), 20).put(health >> 3, 1).put(0, 26);
    two.put(2, 6).put(issue, 10).put(semicircles(e.m0_rad, -31), 32);
    two.put(semicircles(e.omega_dot_radps, -43), 24).put(units(e.eccentricity, -33), 32);
    two.put(units(e.sqrt_a, -19), 32).put(semicircles(e.omega0_rad, -31), 32);
    two.put(semicircles(e.i_dot_radps, -43), 14).put(time(10.0), 12).put(second(10.0), 20);
    three.put(3, 6).put(issue, 10).put(semicircles(e.i0_rad, -31), 32).put(semicircles(e.omega_rad, -31), 32);
    three.put(semicircles(e.delta_n_radps, -43), 16);
    for harmonic in [e.cuc_cus_rad.0, e.cuc_cus_rad.1] {
        three.put(units(harmonic, -29), 16);
    }
    three.put(units(e.crc_crs_m.0, -5), 16).put(units(e.crc_crs_m.1, -5), 16);
    three.put(minutes(e.toe), 14).put(time(20.0), 12).put(second(20.0), 20).put(0, 8);
    four.put(4, 6).put(issue, 10).put(units(e.cic_cis_rad.0, -29), 16).put(units(e.cic_cis_rad.1, -29), 16);
    four.put(0, 32 + 24).put(0, 8 + 8 + 8).put(0, 8 + 3 + 8).put(0, 8 + 16 + 12 + 6);
    four.put(second(30.0), 20).put(0, 5);
    pages.map(|page| with_crc(&page))
}

fn with_crc(page: &Bits) -> Vec<u8> {
    assert_eq!(page.0.len(), 214);
    let mut whole = Bits(page.0.clone());
    whole.put(remainder(&page.0), 24);
    whole.bytes()
}
