//! Shared inputs of the benchmarks.
//!
//! The known 11-term system that every selection is timed on, and the dictionaries of the four cases.

use std::f64::consts::TAU;

pub mod limits;
pub mod timing;

/// The terms of the known system: coefficient, and the term as the comparison with other tools writes it.
pub const TRUTH: [(f64, &str); 11] = [
    (0.05, "1"),
    (0.55, "y[k-1]"),
    (-0.20, "y[k-2]"),
    (0.60, "u[k-1]"),
    (0.25, "u[k-2]"),
    (0.15, "u[k-1]*u[k-1]"),
    (-0.20, "u[k-2]*y[k-1]"),
    (0.12, "u[k-1]*u[k-3]"),
    (-0.10, "y[k-1]*y[k-1]*y[k-1]"),
    (0.18, "u[k-1]*u[k-2]*y[k-2]"),
    (-0.15, "u[k-2]*u[k-2]*u[k-3]"),
];

/// A portable stream of uniform numbers (Knuth's multiplicative congruence, high bits).
pub struct Uniform(pub u64);

impl Uniform {
    /// In -1 to 1.
    #[allow(clippy::should_implement_trait)] // a stream without an end
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Standard normal (Box-Muller).
    fn normal(&mut self) -> f64 {
        let (a, b) = ((self.next() + 1.0) / 2.0, self.next());
        (-2.0 * a.max(1e-300).ln()).sqrt() * (TAU * b / 2.0).cos()
    }
}

/// Input (white, uniform) and output of the known system, with equation noise of this standard deviation.
pub fn known_system(n: usize, seed: u64, noise: f64) -> (Vec<f64>, Vec<f64>) {
    let mut stream = Uniform(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    (0..16).for_each(|_| {
        stream.next();
    });
    let u: Vec<f64> = (0..n).map(|_| stream.next()).collect();
    let mut y = vec![0.0; n];
    for k in 3..n {
        let (y1, y2, u1, u2, u3) = (y[k - 1], y[k - 2], u[k - 1], u[k - 2], u[k - 3]);
        y[k] = 0.05 + 0.55 * y1 - 0.20 * y2 + 0.60 * u1 + 0.25 * u2 + 0.15 * u1 * u1 - 0.20 * y1 * u2 + 0.12 * u1 * u3
            - 0.10 * y1 * y1 * y1
            + 0.18 * u1 * u2 * y2
            - 0.15 * u2 * u2 * u3
            + noise * stream.normal();
    }
    (u, y)
}

/// The known system as a model that runs.
pub fn known_model() -> hysid_dictionary::Model {
    let signals = hysid_dictionary::Signals::siso();
    let (terms, theta) = TRUTH.iter().filter_map(|(c, t)| Some((signals.parse(t).ok()?, *c))).unzip();
    hysid_dictionary::Model::new(signals, terms, theta).unwrap_or_else(|e| panic!("the known system: {e}"))
}

/// The full polynomial dictionary of these lags, cubic.
pub fn dictionary(lags: usize) -> hysid_dictionary::Dictionary {
    hysid_dictionary::Spec::narx(hysid_dictionary::Signals::siso(), lags, 1..=lags, 3)
        .build()
        .unwrap_or_else(|e| panic!("a plain dictionary: {e}"))
}
