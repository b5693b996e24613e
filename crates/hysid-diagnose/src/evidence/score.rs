//! The score of an effect: how much of the residual its response explains that the simulation's own parameters cannot.

use super::layout::{Layout, Whitener};
use super::projector::{Projector, dot, norm2};

/// The response of one effect at one shape: whitened, projected, orthonormalised.
#[derive(Debug, Clone)]
pub struct FeatureGroup {
    /// Orthonormal columns that span the effect's response outside the simulation's own tangent space.
    pub columns: Vec<Vec<f64>>,
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
            if !(before > 0.0 && before.is_finite()) || after < 1e-12 * before {
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
        Some(Self { columns: projector.basis().to_vec(), concealment, factor, norm })
    }

    /// A group that is known by the norm of its first response only.
    pub fn of_norm(norm: f64) -> Self {
        Self { columns: Vec::new(), concealment: 0.0, factor: Vec::new(), norm }
    }

    /// Sum of squares of `r` along the columns.
    pub fn explained(&self, r: &[f64]) -> f64 {
        self.columns.iter().map(|g| dot(g, r).powi(2)).sum()
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

/// The smallest amplitude that this record would have shown (5 % false alarms over `candidates` effects, 90 % power), in the
/// amplitude's own unit: `(2.8 + sqrt(2 ln candidates)) / norm`, for a whitened noise of unit variance.
pub fn detectable_amplitude(group: &FeatureGroup, noise: f64, candidates: usize) -> f64 {
    let threshold = 2.8 + (2.0 * (candidates.max(1) as f64).ln()).sqrt();
    if group.norm > 0.0 { noise * threshold / group.norm } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{NoiseModel, Series};

    fn plain(n: usize) -> (Layout, Whitener) {
        let layout = Layout { series: vec![Series { stretch: 0, output: 0, first: 0, rows: 0..n }], outputs: 1 };
        (layout, Whitener { models: vec![NoiseModel::white(1.0)] })
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
        assert!((a[0] - 3.0).abs() < 1e-12 && (a[1] + 1.0).abs() < 1e-12, "{a:?}");
        assert!(FeatureGroup::new(&[vec![3.0, 0.0, 0.0, 0.0]], &layout, &w, &own).is_none());
    }

    #[test]
    fn the_score_is_zero_gain_minus_price() {
        assert!((score(10.0, 0.0, 100, 2) + 2.0 * 100f64.ln()).abs() < 1e-12);
        assert!(score(10.0, 5.0, 100, 1) > score(10.0, 4.0, 100, 1));
    }
}
