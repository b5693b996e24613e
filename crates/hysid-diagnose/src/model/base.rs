//! A calibrated simulation and its evidence space: what later steps look at and build upon.

use std::collections::BTreeMap;

use hysid_plant::Simulation;

use super::force::noise_of;
use super::{Count, Model, Values};
use crate::data::DataSet;
use crate::evidence::{ForcePaths, Projector, Whitener, norm2};
use crate::refit::{Fit, LmOptions, Problem, go_on, levenberg_marquardt};

/// Largest order of the noise models.
pub const MAX_AR: usize = 16;

/// Standard deviations on either side of a 95 % interval.
pub const QUANTILE: f64 = 1.96;

/// How the noise of a fit is modelled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseKind {
    /// An autoregression and a spectral shape: what is left is noise, whatever its colour.
    Coloured,
    /// White, each row counting for this share of one: what is left is mismatch, whose colour says nothing of the noise. A coloured model
    /// would explain a slow mismatch by its own past, and judge by frequencies at which nothing happens.
    White(f64),
}

impl NoiseKind {
    /// How many independent rows each row stands for.
    pub fn share(self) -> f64 {
        match self {
            Self::Coloured => 1.0,
            Self::White(share) => share,
        }
    }

    /// What `further` unknowns cost in log evidence beside `own` lasting ones in a recording of so many rows: half of `ln n` each; those that
    /// pass cost what a parameter takes of the noise and of a prediction (Akaike), since the recording's length says no more of them.
    ///
    /// Where rows are no independent witnesses, few are left, and half of `ln n` for each unknown is too little: the more unknowns there are
    /// beside few witnesses, the more each explains by chance. The price is then that of the Bayes criterion corrected for small samples
    /// (A. D. R. McQuarrie, C.-L. Tsai, Regression and Time Series Model Selection, World Scientific (1998), BICc).
    pub fn price(self, own: usize, further: Count, rows: usize) -> f64 {
        let rows = (self.share() * rows as f64).max(2.0);
        let all = |unknowns: usize| match self {
            Self::Coloured => 0.5 * unknowns as f64 * rows.ln(),
            Self::White(_) => corrected_price(unknowns as f64, rows),
        };
        all(own + further.lasting) - all(own) + further.passing as f64
    }
}

/// Least share of the rows that the correction for small samples leaves: beyond it the criterion is no approximation of anything.
const LEAST_LEFT: f64 = 0.25;

/// What the corrected Bayes criterion takes for these unknowns beside so many independent rows.
fn corrected_price(unknowns: f64, rows: f64) -> f64 {
    let left = ((rows - unknowns - 2.0) / rows).max(LEAST_LEFT);
    0.5 * unknowns * rows.ln() / left
}

/// A simulation fitted to a data set under a noise model of its own.
#[derive(Debug)]
pub struct Base<'d> {
    /// The compiled simulation on the data.
    pub model: Model<'d>,
    /// The fit.
    pub fit: Fit,
    /// The noise of its residual.
    pub whitener: Whitener,
    /// Ways of an unknown force to each output; none where no noise is coloured.
    pub paths: ForcePaths,
    /// How many independent rows each row stands for.
    pub share: f64,
    /// Log likelihood of the residual under that noise, less half of `ln n` for each coefficient of the noise model.
    pub log_likelihood: f64,
    /// 95 % intervals of parameters that were profiled, by name: they stand in the place of those that the tangents tell.
    pub profiled: BTreeMap<String, [f64; 2]>,
}

/// A fitted parameter and how well it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Interval {
    /// Its name.
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// The ends of its 95 % interval; `None` where nothing tells: it stands at a bound, or the recording does not see it.
    pub ends: Option<[f64; 2]>,
    /// Whether it stands at a bound.
    pub at_bound: bool,
}

impl Interval {
    /// The lower and the upper end, each where there is one.
    pub fn low_and_high(&self) -> (Option<f64>, Option<f64>) {
        self.ends.map_or((None, None), |[low, high]| (Some(low), Some(high)))
    }
}

/// Where a fit begins.
#[derive(Debug, Clone, Copy)]
pub enum Start<'a> {
    /// At these values.
    Values(&'a Values),
    /// Where a fit of the same simulation ended.
    Fit(&'a Fit),
}

/// Fits a simulation: alternately the unknowns under the noise model and the noise model on the residual.
///
/// `pushed` names the states whose derivative an unknown force may enter. The first round uses `whitener`, or white noise where there is none.
/// `None` where the simulation diverges at the start.
pub fn fit_simulation<'d>(
    model: Model<'d>,
    start: Start<'_>,
    pushed: &[String],
    whitener: Option<&Whitener>,
    rounds: usize,
    options: LmOptions,
    kind: NoiseKind,
) -> Option<Base<'d>> {
    let data = model.data();
    let mut noise = match whitener {
        Some(w) if kind == NoiseKind::Coloured || w.coefficients() == 0 => w.clone(),
        _ => data.layout.white_noise(&data.about_means()),
    };
    let mut fit: Option<Fit> = None;
    let mut paths = ForcePaths::default();
    for _ in 0..rounds.max(1) {
        let f = match (&fit, start) {
            (Some(before), _) | (None, Start::Fit(before)) => {
                go_on(&model, before, &data.layout, &noise, None, options)?
            }
            (None, Start::Values(values)) => {
                levenberg_marquardt(&model, &model.theta(values), &data.layout, &noise, None, options)?
            }
        };
        (noise, paths) = match kind {
            NoiseKind::Coloured => noise_of(&model, &f.theta, &f.residual, pushed),
            NoiseKind::White(_) => (data.layout.white_noise(&f.residual), ForcePaths::default()),
        };
        fit = Some(f);
    }
    let fit = fit?;
    let log_likelihood = kind.share() * log_likelihood(data, &noise, &fit.residual);
    Some(Base { model, fit, whitener: noise, paths, share: kind.share(), log_likelihood, profiled: BTreeMap::new() })
}

/// Log likelihood of a residual under a noise model, up to a constant of the data set.
pub fn log_likelihood(data: &DataSet, noise: &Whitener, residual: &[f64]) -> f64 {
    noise.log_likelihood(&data.layout, residual)
}

/// What [`log_likelihood`] would be more with a price of one for each coefficient of the noise model.
///
/// Half of `ln n` is what a coefficient must gain before it is believed. Whoever asks whether something besides noise is there must not
/// have an effect win by the coefficients that it spares: noise of any colour is likely beforehand. Nor by those that it has besides: what is
/// more than `none`, the noise of the simulation as it is, has no cheaper price.
pub fn spared(data: &DataSet, noise: &Whitener, none: &Whitener) -> f64 {
    noise.coefficients().min(none.coefficients()) as f64 * (data.layout.price() - 1.0).max(0.0)
}

/// A noise whose innovations are a smaller share of it than this is no noise: something moves the output slowly and smoothly.
const GROSS: f64 = 0.1;
/// Share of the output that a residual has where the simulation's parameters say little.
const FAR: f64 = 0.3;
/// Innovations of white noise are the noise; below this share something is left that a further effect may explain.
const COLOURED: f64 = 0.85;

impl Base<'_> {
    /// Whether a good part of the residual can be told from its own past: coloured noise, or mismatch.
    pub fn coloured(&self) -> bool {
        self.whitener.models.iter().any(|m| m.innovation() < COLOURED * m.noise_rms())
    }

    /// Whether the residual is mismatch throughout: its own past predicts it too well for noise.
    pub fn gross(&self) -> bool {
        self.whitener.models.iter().any(|m| m.innovation() < GROSS * m.noise_rms())
    }

    /// Whether the noise of an output is that of an unknown force through the plant.
    pub fn driven(&self) -> bool {
        self.whitener.is_driven()
    }

    /// Whether the simulation is so far from the recording that its parameters say little.
    pub fn far(&self) -> bool {
        let data = self.model.data();
        data.relative_squares(&self.fit.residual) > FAR * FAR * data.rows() as f64
    }

    /// Sum of squares of the residual, each output in units of its scale. Of the means only that counts which is not the noise's: under 1/f noise a fit
    /// whose parameters follow the mean would pass for the better one.
    pub fn unexplained(&self) -> f64 {
        let data = self.model.data();
        let mut left = self.fit.residual.clone();
        for s in &data.layout.series {
            self.whitener.models[s.output].discount_mean(&mut left[s.rows.clone()]);
        }
        data.relative_squares(&left)
    }

    /// The stacked outputs of the fitted simulation.
    pub fn prediction(&self) -> Vec<f64> {
        self.model.data().y.iter().zip(&self.fit.residual).map(|(y, e)| y - e).collect()
    }

    /// The document with the fitted values.
    pub fn document(&self) -> Simulation {
        self.model.document(&self.fit.theta)
    }

    /// The fitted values by name.
    pub fn values(&self) -> Values {
        self.model.values(&self.fit.theta)
    }

    /// What the fitted simulation leaves of data with the same stretches, whose rows may be others; `None` where it diverges.
    pub fn residual_on(&self, data: &DataSet) -> Option<Vec<f64>> {
        if data.step == self.model.data().step {
            return Some(self.fit.residual.clone());
        }
        let model = Model::new(self.model.simulation(), data, self.model.substeps()).ok()?;
        model.residual(&model.theta(&self.values()))
    }

    /// The projector off the whitened tangent space of all unknowns, and the whitened residual projected off it.
    pub fn evidence(&self) -> (Projector, Vec<f64>) {
        self.evidence_under(&self.whitener)
    }

    /// The same under another noise.
    pub fn evidence_under(&self, noise: &Whitener) -> (Projector, Vec<f64>) {
        self.evidence_beside(noise, 0..self.fit.jacobian.len())
    }

    /// The same off the tangents of these unknowns only (places in `theta`).
    pub fn evidence_beside(&self, noise: &Whitener, places: impl IntoIterator<Item = usize>) -> (Projector, Vec<f64>) {
        let layout = &self.model.data().layout;
        let own = Projector::new(places.into_iter().map(|i| noise.apply(layout, &self.fit.jacobian[i])));
        let mut r = noise.apply(layout, &self.fit.residual);
        own.remove(&mut r);
        (own, r)
    }

    /// The parameters (not initial values) with their 95 % intervals.
    pub fn intervals(&self) -> Vec<Interval> {
        let k = self.fit.theta.len();
        let covariance = self.covariance();
        let bounds = self.model.bounds();
        (0..k)
            .filter_map(|i| {
                let name = self.model.name_of(i)?.to_owned();
                let value = self.fit.theta[i];
                let variance = covariance[i + k * i];
                let half = QUANTILE * variance.sqrt();
                let within = || [(value - half).max(bounds[i].0), (value + half).min(bounds[i].1)];
                let ends = self.profiled.get(&name).copied().or_else(|| (variance > 0.0).then(within));
                Some(Interval { name, value, ends, at_bound: self.fit.at_bound[i] })
            })
            .collect()
    }

    /// Covariance of the unknowns, column-major.
    pub fn covariance(&self) -> Vec<f64> {
        self.fit.covariance(&self.model.data().layout, &self.whitener, None, self.variance())
    }

    /// Sum of squares of the whitened residual for each independent row that is left: by how much it rises for one standard deviation of an unknown.
    pub fn variance(&self) -> f64 {
        let data = self.model.data();
        let white = self.whitener.apply(&data.layout, &self.fit.residual);
        let witnesses = self.share * data.rows().saturating_sub(self.fit.theta.len()).max(1) as f64;
        norm2(&white) / witnesses
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beside_few_witnesses_each_further_unknown_costs_more() {
        let step = |unknowns: f64, rows: f64| corrected_price(unknowns + 1.0, rows) - corrected_price(unknowns, rows);
        assert!((step(5.0, 1e6) - 0.5 * 1e6_f64.ln()).abs() < 1e-3);
        let many = 0.5 * 20.0_f64.ln();
        assert!(step(4.0, 20.0) > 1.5 * many && step(6.0, 20.0) > step(5.0, 20.0));
        // Where nothing is left it grows no more.
        assert!((step(30.0, 20.0) - many / LEAST_LEFT).abs() < 1e-9);
    }

    #[test]
    fn rows_count_for_their_share_of_a_witness() {
        let three = Count { lasting: 3, passing: 0 };
        let (rows, few) = (NoiseKind::White(1.0).price(4, three, 25), NoiseKind::White(0.01).price(4, three, 2500));
        assert!((rows - few).abs() < 1e-9 && rows > NoiseKind::Coloured.price(4, three, 25));
        assert!((NoiseKind::Coloured.price(4, three, 25) - 1.5 * 25_f64.ln()).abs() < 1e-12);
    }
}
