//! Residual tests by correlation: does the residual still hold what a better model could have explained?
//!
//! The five tests of S. A. Billings and W. S. F. Voon, "Correlation based model validity tests for non-linear models", Int. J. Control 44
//! (1986) 235-244. With e the residual, u the input, a prime for "mean removed", and each correlation divided by the norms of its two
//! signals, a model that explains everything has
//!
//! | test | correlation at lag k | expected |
//! |---|---|---|
//! | `e, e` | e(n) e(n+k), k = 1, 2, ... | 0 |
//! | `u, e` | u(n) e(n+k), all k | 0 |
//! | `u2', e` | (u^2)'(n) e(n+k), all k | 0 |
//! | `u2', e2` | (u^2)'(n) (e^2)'(n+k), all k | 0 |
//! | `e, (e u)` | (e u)'(n) e(n+1+k), k = 0, 1, ... | 0 |
//!
//! The 95 % bounds are +-1.96 / sqrt(N). Where the input is white or the residual is, about one lag in twenty lies outside by chance; the p-value
//! therefore judges the largest correlation among all lags (Sidak's correction, on the safe side where lags hang together).

use statrs::distribution::{ContinuousCDF, Normal};

/// The residual and the inputs over one stretch without a gap.
#[derive(Debug, Clone, Copy)]
pub struct ResidualRecord<'a> {
    /// Each input, as many samples as the residual.
    pub inputs: &'a [&'a [f64]],
    /// The residual, measured minus predicted.
    pub residual: &'a [f64],
}

/// One of the tests, over its lags.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrelationTest {
    /// Its name in the field: `e, e`, `u, e`, `u2', e`, `u2', e2`, `e, (e u)`; with several inputs, `u` carries its number from 1.
    pub name: String,
    /// The lags, in samples.
    pub lags: Vec<i64>,
    /// The correlation at each lag, between -1 and 1.
    pub values: Vec<f64>,
    /// 1.96 / sqrt(N): a white residual stays within plus and minus this at 95 % of the lags.
    pub bound: f64,
    /// Lags outside of the bound.
    pub outside: usize,
    /// Probability of a correlation as large as the largest one, at some lag, by chance.
    pub p_value: f64,
}

impl CorrelationTest {
    /// Whether the residual passes at this level (0.01, say).
    pub fn passes(&self, level: f64) -> bool {
        self.p_value >= level
    }
}

/// The five tests for each input (and `e, e` once), over lags up to `max_lag`, on all stretches together.
///
/// Samples past the shortest of a record's signals are not looked at. Correlations of a signal that is constant are 0.
pub fn residual_tests(records: &[ResidualRecord<'_>], max_lag: usize) -> Vec<CorrelationTest> {
    let inputs = records.iter().map(|r| r.inputs.len()).min().unwrap_or(0);
    let signal = |f: &dyn Fn(&ResidualRecord<'_>, usize) -> f64| -> Vec<Vec<f64>> {
        let mut all: Vec<Vec<f64>> = records
            .iter()
            .map(|r| {
                let n = r.inputs.iter().map(|u| u.len()).fold(r.residual.len(), usize::min);
                (0..n).map(|i| f(r, i)).collect()
            })
            .collect();
        remove_mean(&mut all);
        all
    };
    let e = signal(&|r, n| r.residual[n]);
    let e2 = signal(&|r, n| r.residual[n].powi(2));
    let lag = max_lag as i64;
    let mut tests = vec![test("e, e".into(), &e, &e, 1, lag)];
    for i in 0..inputs {
        let u_name = if inputs == 1 { "u".to_owned() } else { format!("u{}", i + 1) };
        let u = signal(&|r, n| r.inputs[i][n]);
        let u2 = signal(&|r, n| r.inputs[i][n].powi(2));
        let eu = signal(&|r, n| r.residual[n] * r.inputs[i][n]);
        tests.push(test(format!("{u_name}, e"), &u, &e, -lag, lag));
        tests.push(test(format!("{u_name}2', e"), &u2, &e, -lag, lag));
        tests.push(test(format!("{u_name}2', e2"), &u2, &e2, -lag, lag));
        let mut shifted = test(format!("e, (e {u_name})"), &eu, &e, 1, lag + 1);
        shifted.lags.iter_mut().for_each(|k| *k -= 1);
        tests.push(shifted);
    }
    tests
}

fn remove_mean(signals: &mut [Vec<f64>]) {
    let count: usize = signals.iter().map(Vec::len).sum();
    let mean = signals.iter().flatten().sum::<f64>() / count as f64;
    signals.iter_mut().flatten().for_each(|x| *x -= mean);
}

/// The correlation of a(n) with b(n + k) for k = `from` to `to`.
fn test(name: String, a: &[Vec<f64>], b: &[Vec<f64>], from: i64, to: i64) -> CorrelationTest {
    let energy = |x: &[Vec<f64>]| x.iter().flatten().map(|v| v * v).sum::<f64>();
    let scale = (energy(a) * energy(b)).sqrt();
    let count: usize = a.iter().map(Vec::len).sum();
    let lags: Vec<i64> = (from..=to).collect();
    let values: Vec<f64> = lags
        .iter()
        .map(|&k| {
            let sum: f64 = a.iter().zip(b).map(|(a, b)| lagged_product(a, b, k)).sum();
            if scale > 0.0 { sum / scale } else { 0.0 }
        })
        .collect();
    let bound = 1.96 / (count as f64).sqrt();
    let outside = values.iter().filter(|v| v.abs() > bound).count();
    let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let one = 2.0 * Normal::standard().sf(largest * (count as f64).sqrt());
    // 1 - (1 - one)^lags, without cancellation.
    let p_value = -(lags.len() as f64 * (-one).ln_1p()).exp_m1();
    CorrelationTest { name, lags, values, bound, outside, p_value }
}

fn lagged_product(a: &[f64], b: &[f64], k: i64) -> f64 {
    let shift = k.unsigned_abs() as usize;
    let (early, late) = if k >= 0 { (a, b) } else { (b, a) };
    early.iter().zip(late.iter().skip(shift)).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that look like white noise, uniform in -1 to 1: the finaliser of SplitMix64 on a counter.
    fn noise(seed: u64, n: usize) -> Vec<f64> {
        (0..n as u64)
            .map(|i| {
                let mut z = (seed << 32).wrapping_add(i).wrapping_mul(0x9E37_79B9_7F4A_7C15);
                z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
                z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
                (z ^ (z >> 31)) as f64 / u64::MAX as f64 * 2.0 - 1.0
            })
            .collect()
    }

    fn tests_of(u: &[f64], e: &[f64]) -> Vec<CorrelationTest> {
        residual_tests(&[ResidualRecord { inputs: &[u], residual: e }], 20)
    }

    #[test]
    fn white_residuals_raise_false_alarms_at_the_stated_rates() {
        let (mut outside, mut lags, mut alarms, mut runs) = (0, 0, 0, 0);
        for seed in 0..200 {
            for t in tests_of(&noise(2 * seed, 600), &noise(2 * seed + 1, 600)) {
                outside += t.outside;
                lags += t.lags.len();
                alarms += usize::from(!t.passes(0.05));
                runs += 1;
            }
        }
        let rate = outside as f64 / lags as f64;
        assert!((0.040..0.055).contains(&rate), "{rate} of the lags outside of the 95 % bounds");
        let rate = alarms as f64 / f64::from(runs);
        assert!((0.025..0.065).contains(&rate), "{rate} of the tests fail at level 0.05");
    }

    #[test]
    fn each_test_sees_what_it_is_for() {
        let (u, w) = (noise(1, 2000), noise(2, 2000));
        let at = |n: usize, k: usize| n.checked_sub(k);
        let with = |f: &dyn Fn(usize) -> f64| (0..2000).map(|n| w[n] + f(n)).collect::<Vec<f64>>();
        let cases: [(&str, Vec<f64>, i64); 4] = [
            ("e, e", with(&|n| at(n, 3).map_or(0.0, |k| 0.8 * w[k])), 3),
            ("u, e", with(&|n| at(n, 2).map_or(0.0, |k| u[k])), 2),
            ("u2', e", with(&|n| at(n, 4).map_or(0.0, |k| u[k] * u[k])), 4),
            ("e, (e u)", with(&|n| at(n, 6).map_or(0.0, |k| w[k] * u[k])), 5),
        ];
        for (name, e, lag) in cases {
            let tests = tests_of(&u, &e);
            let seen = tests.iter().find(|t| t.name == name).unwrap();
            assert!(seen.p_value < 1e-9, "{name}: {}", seen.p_value);
            let largest = (0..seen.values.len()).max_by(|&a, &b| seen.values[a].abs().total_cmp(&seen.values[b].abs()));
            assert_eq!(seen.lags[largest.unwrap()], lag, "{name}");
        }
        let variance: Vec<f64> = (0..2000).map(|n| w[n] * (0.2 + u[n] * u[n])).collect();
        assert!(tests_of(&u, &variance).iter().any(|t| t.name == "u2', e2" && t.p_value < 1e-9));
    }

    #[test]
    fn the_correlation_of_two_sines_in_closed_form() {
        let wave = |lag: f64| (0..20_000).map(|n| (0.1 * (n as f64 - lag)).sin()).collect::<Vec<f64>>();
        let t = &tests_of(&wave(0.0), &wave(7.0))[1];
        for (k, v) in t.lags.iter().zip(&t.values) {
            assert!((v - (0.1 * (*k as f64 - 7.0)).cos()).abs() < 5e-3, "{k}: {v}");
        }
    }

    #[test]
    fn stretches_are_not_joined_and_constants_are_harmless() {
        let (u, e) = (noise(5, 400), noise(6, 400));
        let parts = [
            ResidualRecord { inputs: &[&u[..150]], residual: &e[..150] },
            ResidualRecord { inputs: &[&u[150..]], residual: &e[150..] },
        ];
        let joined = tests_of(&u, &e);
        let apart = residual_tests(&parts, 20);
        let zero_lag = |t: &[CorrelationTest]| t[1].values[20];
        assert!((zero_lag(&joined) - zero_lag(&apart)).abs() < 1e-12);
        assert_ne!(joined[1].values[25], apart[1].values[25]);
        assert!(tests_of(&[1.0; 50], &[0.0; 50]).iter().all(|t| t.values.iter().all(|v| *v == 0.0) && t.passes(0.5)));
        assert_eq!(residual_tests(&[], 5).len(), 1);
    }
}
