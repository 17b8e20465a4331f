//! Accuracy indices of the navigation messages, as standard deviations.

/// Standard deviation assumed for a message without a prediction, m. The satellite stays in use with little weight.
pub const UNKNOWN_ACCURACY_M: f64 = 10.0;

/// Nominal user range accuracy of an index, m (IS-GPS-200, 20.3.3.3.1.3; BDS-SIS-ICD-B1I, 5.2.4.5). Index 15, no
/// prediction, means "more than 6144 m".
pub fn ura_m(index: u64) -> f64 {
    match index {
        1 => 2.8,
        3 => 5.7,
        5 => 11.3,
        0..=6 => 2_f64.powf(1.0 + index as f64 / 2.0),
        7..=14 => 2_f64.powf(index as f64 - 2.0),
        _ => 6_144.0,
    }
}

/// Signal-in-space accuracy of an index, m (Galileo OS SIS ICD, table 89). No prediction (255), the reserved indices, and
/// zero, which no satellite has, are [`UNKNOWN_ACCURACY_M`].
pub fn sisa_m(index: u64) -> f64 {
    let above = |start: u64, base: f64, step: f64| base + step * (index - start) as f64;
    match index {
        1..50 => above(0, 0.0, 0.01),
        50..75 => above(50, 0.5, 0.02),
        75..100 => above(75, 1.0, 0.04),
        100..=125 => above(100, 2.0, 0.16),
        _ => UNKNOWN_ACCURACY_M,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All indices at the ends of the tables' steps.
    #[test]
    fn indices_are_the_metres_of_the_documents() {
        let ura =
            [2.0, 2.8, 4.0, 5.7, 8.0, 11.3, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0, 4096.0];
        for (index, metres) in (0..).zip(ura) {
            assert!((ura_m(index) - metres).abs() < 1e-12, "URA {index}");
        }
        assert!(ura_m(15) >= 6_144.0);
        let sisa =
            [(1, 0.01), (49, 0.49), (50, 0.5), (74, 0.98), (75, 1.0), (99, 1.96), (100, 2.0), (125, 6.0)];
        for (index, metres) in sisa {
            assert!((sisa_m(index) - metres).abs() < 1e-12, "SISA {index}");
        }
        assert!([0, 126, 255].iter().all(|&index| (sisa_m(index) - UNKNOWN_ACCURACY_M).abs() < 1e-12));
    }
}
