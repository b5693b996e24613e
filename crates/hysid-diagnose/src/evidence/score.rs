//! The score of an effect: how much of the residual its response explains that the simulation's own parameters cannot.

use hysid_linalg::dot;
use statrs::function::gamma::{gamma_ur, ln_gamma};

use super::layout::{Layout, Whitener};
use super::projector::{Projector, doubly, norm2};

/// Below this the tail of the chi-square law is taken from its asymptotic series.
const LEAST_TAIL: f64 = 1e-200;

/// Share of a direction's power outside others below which what is left is rounding and curvature.
const LEAST_LEFT: f64 = 1e-3;

/// An effect that acts where there is next to no noise is seen by other samples too.
const LEAST_INFLATION: f64 = 0.05;

/// Share of a whitened column (squared norms) below which what is left of it outside the simulation's own tangents is rounding.
pub const INSIDE: f64 = 1e-12;

/// The response of one effect at one shape: whitened, projected, orthonormalised.
#[derive(Debug, Clone)]
pub struct FeatureGroup {
    /// Orthonormal columns that span the effect's response outside the simulation's own tangent space; in single precision, since those of all effects are what
    /// fills the memory of a long recording.
    pub columns: Vec<Vec<f32>>,
    /// Share of the first column's whitened response that the simulation's own parameters can absorb, from 0 to 1.
    pub concealment: f64,
    /// Which response each column came from, and the upper triangular factor that makes the responses from the columns, row by row.
    factor: Vec<(usize, Vec<f64>)>,
    /// Norm of the first column outside the tangent space, for a unit amplitude: with it a score becomes an amplitude.
    pub norm: f64,
}

impl FeatureGroup {
    /// From responses to unit amplitudes, as stacks in the unit of the outputs. `None` when nothing is left outside the tangent space.
    pub fn new(responses: &[Vec<f64>], layout: &Layout, whitener: &Whitener, own: &Projector) -> Option<Self> {
        let mut projector = Projector::default();
        let mut factor = Vec::new();
        let (mut concealment, mut norm) = (1.0, 0.0);
        for (i, response) in responses.iter().enumerate() {
            if response.iter().any(|x| !x.is_finite()) {
                return None;
            }
            let mut w = whitener.apply(layout, response);
            let before = norm2(&w);
            own.remove(&mut w);
            let after = norm2(&w);
            if !(before > 0.0 && before.is_finite()) || after < INSIDE * before {
                continue;
            }
            if i == 0 || norm == 0.0 {
                concealment = (1.0 - after / before).clamp(0.0, 1.0);
                norm = after.sqrt();
            }
            let mut coefficients: Vec<f64> = projector.basis().iter().map(|q| dot(q, &w)).collect();
            let inside: f64 = coefficients.iter().map(|c| c * c).sum();
            if projector.push(w) {
                coefficients.push((after - inside).max(0.0).sqrt());
                factor.push((i, coefficients));
            }
        }
        if projector.rank() == 0 {
            return None;
        }
        Some(Self { columns: projector.singly(), concealment, factor, norm })
    }

    /// The directions of the group outside further ones, which are then no evidence for it; `None` where next to nothing is left.
    pub fn outside(&self, others: &Projector) -> Option<Self> {
        let mut left = Projector::default();
        for column in &self.columns {
            let mut rest = doubly(column);
            others.remove(&mut rest);
            if norm2(&rest) > LEAST_LEFT {
                left.push(rest);
            }
        }
        (left.rank() > 0).then(|| Self { columns: left.singly(), factor: Vec::new(), ..*self })
    }

    /// A group that is known by the norm of its first response only.
    pub fn of_norm(norm: f64) -> Self {
        Self { columns: Vec::new(), concealment: 0.0, factor: Vec::new(), norm }
    }

    /// Sum of squares of `r` along the columns.
    pub fn explained(&self, r: &[f64]) -> f64 {
        self.columns.iter().map(|g| dot(g, r).powi(2)).sum()
    }

    /// What `r` with the sign of each sample drawn has along the columns in the mean, over what as much noise of one size has; at least [`LEAST_INFLATION`].
    ///
    /// Reference: H. White, Econometrica 48 (1980) 817-838.
    pub fn inflation(&self, r: &[f64]) -> f64 {
        let at = |g: &Vec<f32>| g.iter().zip(r).map(|(g, r)| (f64::from(*g) * r).powi(2)).sum::<f64>();
        let mean: f64 = self.columns.iter().map(at).sum();
        let even = norm2(r) * self.columns.len() as f64 / r.len().max(1) as f64;
        if even > 0.0 { (mean / even).max(LEAST_INFLATION) } else { 1.0 }
    }

    /// The amplitudes of the `count` responses that explain `r` best; zero for responses without a column of their own.
    pub fn amplitudes(&self, r: &[f64], count: usize) -> Vec<f64> {
        let mut right: Vec<f64> = self.columns.iter().map(|g| dot(g, r)).collect();
        let mut out = vec![0.0; count];
        for c in (0..self.columns.len()).rev() {
            let (response, coefficients) = &self.factor[c];
            let diagonal = coefficients[c];
            let a = if diagonal > 0.0 { right[c] / diagonal } else { 0.0 };
            if let Some(o) = out.get_mut(*response) {
                *o = a;
            }
            for (b, coefficient) in right.iter_mut().zip(coefficients).take(c) {
                *b -= a * coefficient;
            }
        }
        out
    }
}

/// `lambda = n ln(|r|^2 / |r - Pi r|^2) - k ln n`: twice the log likelihood gained, less the price of `k` amplitudes.
pub fn score(total: f64, explained: f64, rows: usize, columns: usize) -> f64 {
    let n = rows as f64;
    let left = (total - explained).max(total * 1e-12).max(f64::MIN_POSITIVE);
    n * (total.max(f64::MIN_POSITIVE) / left).ln() - columns as f64 * n.ln()
}

/// `-ln P(chi^2_k > 2 gain)`: how surprising it is that `unknowns` which stand for nothing gain so much log likelihood (Wilks).
///
/// A price of `ln n / 2` for each of them compares an effect with none; where what chance does is simulated, that price would hide laws of three
/// unknowns behind those of one.
pub fn surprise(gain: f64, unknowns: usize) -> f64 {
    if gain.is_nan() || gain <= 0.0 || unknowns == 0 {
        return 0.0;
    }
    let half = 0.5 * unknowns as f64;
    let tail = gamma_ur(half, gain);
    if tail > LEAST_TAIL {
        return -tail.ln();
    }
    // The first terms of the asymptotic series of the incomplete gamma function.
    gain - (half - 1.0) * gain.ln() + ln_gamma(half) - ((half - 1.0) / gain).ln_1p()
}

/// The smallest amplitude that this record would have shown (5 % false alarms over `candidates` effects, 80 % power, both sides), in the
/// amplitude's own unit: `(2.8 + sqrt(2 ln candidates)) / norm`, for a whitened noise of unit variance.
pub fn detectable_amplitude(group: &FeatureGroup, noise: f64, candidates: usize) -> f64 {
    let threshold = 2.8 + (2.0 * (candidates.max(1) as f64).ln()).sqrt();
    if group.norm > 0.0 { noise * threshold / group.norm } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{NoiseModel, Series};

    /// What a column in single precision is off by, of a response of a few samples.
    const SINGLY: f64 = 1e-6;

    fn plain(n: usize) -> (Layout, Whitener) {
        let layout = Layout { series: vec![Series { stretch: 0, output: 0, first: 0, rows: 0..n }], outputs: 1 };
        (layout, Whitener::of(vec![NoiseModel::white(1.0)]))
    }

    #[test]
    fn concealment_is_the_share_inside_the_tangent_space() {
        let (layout, w) = plain(4);
        let own = Projector::new([vec![1.0, 0.0, 0.0, 0.0]]);
        let g = FeatureGroup::new(&[vec![3.0, 4.0, 0.0, 0.0]], &layout, &w, &own).unwrap();
        assert!((g.concealment - 9.0 / 25.0).abs() < 1e-12);
        assert!((g.norm - 4.0).abs() < 1e-12);
        assert!((g.amplitudes(&[0.0, 8.0, 0.0, 0.0], 1)[0] - 2.0).abs() < 1e-12);
        let two = FeatureGroup::new(&[vec![0.0, 2.0, 1.0, 0.0], vec![0.0, 1.0, 3.0, 0.5]], &layout, &w, &own).unwrap();
        let a = two.amplitudes(&[0.0, 2.0 * 3.0 - 1.0, 3.0 - 3.0, -0.5], 2);
        assert!((a[0] - 3.0).abs() < SINGLY && (a[1] + 1.0).abs() < SINGLY, "{a:?}");
        assert!(FeatureGroup::new(&[vec![3.0, 0.0, 0.0, 0.0]], &layout, &w, &own).is_none());
    }

    #[test]
    fn outside_others_a_group_explains_what_both_explain_less_what_the_others_do() {
        let (layout, w) = plain(5);
        let wave = |f: f64| -> Vec<f64> { (0..5).map(|i| (f * i as f64).cos()).collect() };
        let group = FeatureGroup::new(&[wave(0.7), wave(1.9)], &layout, &w, &Projector::default()).unwrap();
        let (drift, r) = (wave(0.2), wave(2.6));
        let others = Projector::new([drift.clone()]);
        let both = Projector::new([drift, wave(0.7), wave(1.9)]);
        let rest = group.outside(&others).unwrap().explained(&r);
        assert!((rest - (both.inside(&r) - others.inside(&r))).abs() < SINGLY * norm2(&r));
        assert!(group.outside(&Projector::new(group.columns.iter().map(|c| doubly(c)))).is_none());
    }

    #[test]
    fn surprise_is_the_tail_of_the_chi_square_law_and_grows_on_where_that_underflows() {
        // For two unknowns the tail is exp(-gain); for one, 5 % lie beyond 3.8415 and 0.1 % beyond 10.828; for three 1 % beyond 11.345.
        for gain in [0.3, 7.0, 90.0, 600.0] {
            assert!((surprise(gain, 2) - gain).abs() < 1e-9 * gain.max(1.0), "{gain}");
        }
        for (twice, unknowns, tail) in [(3.8415, 1, 0.05_f64), (10.828, 1, 1e-3), (11.345, 3, 0.01)] {
            assert!((surprise(0.5 * twice, unknowns) + tail.ln()).abs() < 1e-3);
        }
        for unknowns in 1..12 {
            let mut last = 0.0;
            for gain in (1..2000).map(|i| 0.5 * f64::from(i)) {
                let s = surprise(gain, unknowns);
                assert!(s >= last && surprise(gain, unknowns + 1) <= s, "{gain} {unknowns}: {s} after {last}");
                assert!(s - last < 0.55 + 0.5 / gain, "{gain} {unknowns}: {s} after {last}");
                last = s;
            }
        }
        assert_eq!((surprise(-1.0, 2), surprise(f64::NAN, 2), surprise(3.0, 0)), (0.0, 0.0, 0.0));
    }

    #[test]
    fn the_score_is_zero_gain_minus_price() {
        assert!((score(10.0, 0.0, 100, 2) + 2.0 * 100f64.ln()).abs() < 1e-12);
        assert!(score(10.0, 5.0, 100, 1) > score(10.0, 4.0, 100, 1));
    }
}
