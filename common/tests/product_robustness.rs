//! Clock, bias and ionosphere files, damaged and arbitrary: they count, they do not panic, and what they give is in bounds.

#![allow(clippy::unwrap_used)] // helpers of tests

use std::fmt::Write as _;

use cofix_common::atmosphere::{Ionex, IonosphereMaps};
use cofix_common::frames::{Direction, Geodetic};
use cofix_common::orbit::{BiasFile, ClockFile, Products};
use proptest::prelude::*;

fn clock_text() -> String {
    let mut text = "     3.00           C                                       RINEX VERSION / TYPE
   GPS                                                      TIME SYSTEM ID
                                                            END OF HEADER
"
    .to_owned();
    for second in [0, 30] {
        for satellite in ["G01", "E11", "C21"] {
            writeln!(
                text,
                "AS {satellite}  2020 08 13 14 00 {second:2}.000000  2    2.691084288582e-04  1.5074e-11"
            )
            .unwrap();
        }
    }
    text
}

const BIASES: &str = "%=BIA 1.00 TST 2020:227:30548 IGS 2020:226:00000 2020:227:00000 A 00000003
+BIAS/DESCRIPTION
 TIME_SYSTEM                             G
-BIAS/DESCRIPTION
+BIAS/SOLUTION
 OSB  G063 G01           C1C       2020:226:00000 2020:227:00000 ns                  7.4321      0.0200
 OSB  E101 E11           C5Q       2020:226:00000 0000:000:00000 ns                 -3.5000      0.0200
 DSB  G063 G01           C1C  C1W  2020:226:00000 2020:227:00000 ns                 -0.6679      0.0200
-BIAS/SOLUTION
%=ENDBIA
";

fn map_text() -> String {
    let line = |content: &str, label: &str| format!("{content:<60}{label}\n");
    let mut text = line("     1.0            IONOSPHERE MAPS     GPS", "IONEX VERSION / TYPE")
        + &line("  6371.0", "BASE RADIUS")
        + &line("   450.0 450.0   0.0", "HGT1 / HGT2 / DHGT")
        + &line("    90.0 -90.0 -60.0", "LAT1 / LAT2 / DLAT")
        + &line("  -180.0 180.0  90.0", "LON1 / LON2 / DLON")
        + &line("    -1", "EXPONENT")
        + &line("", "END OF HEADER");
    for hour in [14, 16] {
        text += &line("     1", "START OF TEC MAP");
        text += &line(&format!("  2020     8    13    {hour:2}     0     0"), "EPOCH OF CURRENT MAP");
        for latitude in ["90.0", "30.0", "-30.0", "-90.0"] {
            text += &line(&format!("  {latitude:>6}-180.0 180.0  90.0 450.0"), "LAT/LON1/LON2/DLON/H");
            text += "  103  118   87 9999  120\n";
        }
        text += &line("     1", "END OF TEC MAP");
    }
    text + &line("", "END OF FILE")
}

/// Reads bytes as each kind of file and uses what comes out.
fn use_all(bytes: &[u8]) {
    let mut products = Products::default();
    if let Ok(file) = ClockFile::parse(bytes) {
        assert!(file.interval_s > 0.0 && file.interval_s.is_finite());
        assert!(file.records.iter().all(|record| record.clock_s.abs() <= 0.1));
        products.add_clocks(vec![file.clone(), file]);
    }
    if let Ok(file) = BiasFile::parse(bytes) {
        assert!(file.biases.iter().all(|bias| bias.bias_s.abs() <= 1e-6));
        products.add_biases(file.clone());
        products.add_biases(file);
    }
    let Ok(file) = Ionex::parse(bytes) else { return };
    let mut maps = IonosphereMaps::default();
    maps.add(file.maps);
    let Some((first, last)) = maps.span() else { return };
    for time in [first, first + 0.3 * (last - first), last] {
        for latitude_deg in [-90.0, -12.0, 30.0, 89.0] {
            for longitude_deg in [-180.0, -91.0, 0.0, 114.0, 180.0] {
                let receiver = Geodetic::from_degrees(latitude_deg, longitude_deg, 20.0);
                let direction = Direction { azimuth_rad: 1.0, elevation_rad: 0.3 };
                if let Ok(delay_m) = maps.delay_m(receiver, direction, time, 1_575.42e6) {
                    assert!(delay_m.is_finite() && delay_m >= 0.0, "{delay_m}");
                }
            }
        }
    }
}

#[test]
fn the_samples_are_sound() {
    assert_eq!(ClockFile::parse(clock_text().as_bytes()).unwrap().records.len(), 6);
    assert_eq!(BiasFile::parse(BIASES.as_bytes()).unwrap().biases.len(), 2);
    let maps = Ionex::parse(map_text().as_bytes()).unwrap();
    assert_eq!((maps.maps.len(), maps.skips.total()), (2, 0), "{}", maps.skips);
}

proptest! {
    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..1_000)) {
        use_all(&bytes);
        for start in [clock_text().as_bytes(), BIASES.as_bytes(), map_text().as_bytes()] {
            use_all(&[start, &bytes].concat());
        }
    }

    #[test]
    fn damaged_files_are_read_or_refused(
        kind in 0..3_usize,
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
        cut in any::<prop::sample::Index>(),
        is_cut in any::<bool>(),
    ) {
        let mut bytes = [clock_text(), BIASES.to_owned(), map_text()][kind].clone().into_bytes();
        for (at, byte) in damage {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if is_cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        use_all(&bytes);
    }

    /// Digits in place of digits: the harder damage, for it can be believed.
    #[test]
    fn files_of_other_numbers_are_read_or_refused(
        kind in 0..3_usize,
        digits in prop::collection::vec((any::<prop::sample::Index>(), b'0'..=b'9'), 1..40),
    ) {
        let mut bytes = [clock_text(), BIASES.to_owned(), map_text()][kind].clone().into_bytes();
        let places: Vec<usize> = (0..bytes.len()).filter(|at| bytes[*at].is_ascii_digit()).collect();
        for (at, digit) in digits {
            bytes[*at.get(&places)] = digit;
        }
        use_all(&bytes);
    }
}
