//! The residual of a fitted simulation as a noise model sees it.

use rayon::prelude::*;

use crate::evidence::{INSIDE, Layout, Projector, Whitener, norm2, score};
use crate::model::base::{Base, log_likelihood, spared};

/// The residual under a noise, off what is estimated besides.
pub struct View<'a> {
    /// The noise.
    pub noise: &'a Whitener,
    layout: &'a Layout,
    own: Projector,
    /// The whitened residual.
    pub r: Vec<f64>,
}

impl<'a> View<'a> {
    /// Of a fitted simulation.
    pub fn new(base: &'a Base<'_>, noise: &'a Whitener) -> Self {
        let (own, r) = base.evidence_under(noise);
        Self { noise, layout: &base.model.data().layout, own, r }
    }

    /// Columns likewise.
    pub fn of(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        columns.iter().map(|x| self.column(x).1).collect()
    }

    /// A column likewise, after its squared norm with what is estimated besides in it.
    pub fn column(&self, x: &[f64]) -> (f64, Vec<f64>) {
        let mut w = self.noise.apply(self.layout, x);
        let whole = norm2(&w);
        self.own.remove(&mut w);
        (whole, w)
    }

    /// Score of columns together, which may be hundreds.
    pub fn score(&self, columns: &[&[f64]]) -> f64 {
        let outside: Vec<Vec<f64>> = columns
            .par_iter()
            .filter_map(|x| {
                let (whole, rest) = self.column(x);
                (whole.is_finite() && norm2(&rest) > INSIDE * whole).then_some(rest)
            })
            .collect();
        let span = Projector::new(outside);
        if span.rank() == 0 {
            return f64::NEG_INFINITY;
        }
        score(norm2(&self.r), span.inside(&self.r), self.r.len(), span.rank())
    }

    /// Log likelihood that free amplitudes of a few columns gain.
    pub fn free_gain(&self, columns: &[Vec<f64>]) -> f64 {
        0.5 * score(norm2(&self.r), Projector::new(self.of(columns)).inside(&self.r), self.r.len(), 0)
    }

    /// Log likelihood of the residual without the price of the noise's coefficients, and whatever is estimated besides at its best.
    pub fn log_likelihood(&self, base: &Base<'_>) -> f64 {
        let data = base.model.data();
        let plain = self.noise.apply(self.layout, &base.fit.residual);
        let fitted = 0.5 * (norm2(&plain) - norm2(&self.r));
        log_likelihood(data, self.noise, &base.fit.residual) + fitted + spared(data, self.noise, &base.whitener)
    }
}
