//! Gauss-Legendre quadrature.

use std::f64::consts::PI;
use std::sync::LazyLock;

/// Five nodes on (0, 1) with their weights, exact for polynomials up to degree 9.
pub(crate) const ON_UNIT_INTERVAL: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_24),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_24),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];

/// Number of nodes of the rule for densities.
const NODES: usize = 32;
/// Number of nodes of the rule for densities that change little.
const FEW: usize = 16;

/// Nodes in (−1, 1), symmetric about 0, with their weights.
pub(super) static GAUSS_LEGENDRE: LazyLock<[(f64, f64); NODES]> = LazyLock::new(rule);
/// The same with half as many nodes.
pub(super) static GAUSS_LEGENDRE_16: LazyLock<[(f64, f64); FEW]> = LazyLock::new(rule);

fn rule<const N: usize>() -> [(f64, f64); N] {
    let mut rule = [(0.0, 0.0); N];
    for index in 0..N / 2 {
        let (node, weight) = node_and_weight::<N>(index);
        rule[index] = (-node, weight);
        rule[N - 1 - index] = (node, weight);
    }
    rule
}

/// The root of the Legendre polynomial of degree N with index `index` from the right, by Newton's method, and its weight.
fn node_and_weight<const N: usize>(index: usize) -> (f64, f64) {
    let n = N as f64;
    let mut x = (PI * (index as f64 + 0.75) / (n + 0.5)).cos();
    let mut slope = 0.0;
    for _ in 0..20 {
        let (mut previous, mut value) = (1.0, x);
        for degree in 2..=N {
            let k = degree as f64;
            (previous, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * previous) / k);
        }
        slope = n * (x * value - previous) / (x * x - 1.0);
        let step = value / slope;
        x -= step;
        if step.abs() < 1e-16 {
            break;
        }
    }
    (x, 2.0 / ((1.0 - x * x) * slope * slope))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_up_to_degree_9_are_exact_on_the_unit_interval() {
        for power in 0..10 {
            let sum: f64 = ON_UNIT_INTERVAL.iter().map(|(x, w)| w * x.powi(power)).sum();
            assert!((sum - 1.0 / f64::from(power + 1)).abs() < 1e-14, "degree {power}: {sum}");
        }
    }

    #[test]
    fn polynomials_up_to_twice_the_number_of_nodes_are_exact() {
        for rule in [GAUSS_LEGENDRE.as_slice(), GAUSS_LEGENDRE_16.as_slice()] {
            for power in 0..2 * rule.len() {
                let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(i32::try_from(power).unwrap())).sum();
                let exact = if power % 2 == 0 { 2.0 / (power as f64 + 1.0) } else { 0.0 };
                assert!((sum - exact).abs() < 1e-14, "degree {power}: {sum} {exact}");
            }
        }
    }
}
