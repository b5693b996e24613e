//! How samples are stacked into rows, and the whitening of such a stack.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use super::common::CommonForce;
use super::noise::NoiseModel;
use super::projector::norm2;
use super::response::{CommonPath, Course, ForcePath, ForcePaths};
use super::shared::Shared;

/// A run of rows that follow each other in time: one output of one stretch, between gaps.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// The stretch of the data set (a contiguous simulation run).
    pub stretch: usize,
    /// The output.
    pub output: usize,
    /// First sample within the stretch.
    pub first: usize,
    /// The rows in the stack; as many samples follow `first`.
    pub rows: Range<usize>,
}

impl Series {
    /// Whether the other holds the same moments.
    pub fn is_beside(&self, other: &Self) -> bool {
        (self.stretch, self.first, self.rows.len()) == (other.stretch, other.first, other.rows.len())
    }
}

/// The rows of a stack.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Layout {
    /// In order of rows, without holes.
    pub series: Vec<Series>,
    /// Number of outputs.
    pub outputs: usize,
}

impl Layout {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.series.last().map_or(0, |s| s.rows.end)
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What a coefficient of a noise must gain before it is believed: half of the logarithm of the number of rows (Bayes' criterion).
    pub fn price(&self) -> f64 {
        0.5 * (self.len().max(2) as f64).ln()
    }

    /// The series, each after its place among those of its output.
    pub fn runs(&self) -> impl Iterator<Item = (usize, &Series)> {
        let mut seen = vec![0; self.outputs];
        self.series.iter().map(move |s| {
            seen[s.output] += 1;
            (seen[s.output] - 1, s)
        })
    }

    /// The runs that all of these outputs recorded: one series of each, in their order.
    pub fn together(&self, outputs: impl IntoIterator<Item = usize, IntoIter: Clone>) -> Vec<Vec<&Series>> {
        let outputs = outputs.into_iter();
        let Some(first) = outputs.clone().next() else { return Vec::new() };
        let beside = |run: &Series, o: usize| self.series.iter().find(|s| s.output == o && s.is_beside(run));
        let of_first = self.series.iter().filter(|s| s.output == first);
        of_first.filter_map(|run| outputs.clone().map(|o| beside(run, o)).collect()).collect()
    }

    /// White noise of each output, as large as this stacked residual.
    pub fn white_noise(&self, residual: &[f64]) -> Whitener {
        self.fit_noise(residual, 0, &ForcePaths::default())
    }

    /// The noise of this stacked residual: a model for each output, or one force that several have in common, with what they share (neither colour nor that for an
    /// order of 0), by the ways of an unknown force to them, where there are any.
    pub fn fit_noise(&self, residual: &[f64], max_order: usize, paths: &ForcePaths) -> Whitener {
        let common = |entry: usize| paths.common.iter().find(|path| path.entry() == entry).cloned();
        self.fit_noise_along(residual, max_order, &paths.each, |output, way| paths.each[output][way].course(), common)
    }

    /// The same with courses of the ways, by output and place among them, and with the common way of a force at a state, that are made where they are asked for.
    pub fn fit_noise_along(
        &self,
        residual: &[f64],
        max_order: usize,
        paths: &[Vec<ForcePath>],
        course: impl Fn(usize, usize) -> Option<Arc<Course>>,
        common: impl Fn(usize) -> Option<Arc<CommonPath>>,
    ) -> Whitener {
        let models: Vec<NoiseModel> = (0..self.outputs)
            .map(|o| {
                let stretches: Vec<&[f64]> =
                    self.series.iter().filter(|s| s.output == o).map(|s| &residual[s.rows.clone()]).collect();
                NoiseModel::along(&stretches, max_order, paths.get(o).map_or(&[], Vec::as_slice), |way| course(o, way))
            })
            .collect();
        let shared = |noise: &Whitener| Shared::of(self, &noise.apply(self, residual));
        let score = |noise: &Whitener| noise.log_likelihood(self, residual);
        let mut best = Whitener::of(models);
        if max_order > 0 {
            best.shared = shared(&best);
        }
        let entries: BTreeSet<usize> = best.models.iter().filter_map(|m| Some(m.driven()?.entry)).collect();
        for path in entries.into_iter().filter_map(common) {
            let fitted = CommonForce::fit(&path, self, residual, &best.models, self.price());
            let with = |common: CommonForce| {
                let alone = Whitener { common: Some((common.clone(), None)), ..best.clone() };
                Whitener { common: Some((common, shared(&alone))), ..alone }
            };
            if let Some(with) = fitted.map(with).filter(|with| score(with) > score(&best)) {
                best = with;
            }
        }
        best
    }

    /// Root mean square of each output's rows of a stack.
    pub fn rms(&self, stack: &[f64]) -> Vec<f64> {
        (0..self.outputs)
            .map(|o| {
                let (mut sum, mut count) = (0.0, 0usize);
                for s in self.series.iter().filter(|s| s.output == o) {
                    sum += stack[s.rows.clone()].iter().map(|x| x * x).sum::<f64>();
                    count += s.rows.len();
                }
                if count == 0 { 0.0 } else { (sum / count as f64).sqrt() }
            })
            .collect()
    }
}

/// What whitens a layout beside the models of its outputs.
struct Parts<'a> {
    /// A force in common, with its runs.
    common: Option<(&'a CommonForce, Vec<Vec<&'a Series>>)>,
    shared: Option<&'a Shared>,
}

impl Parts<'_> {
    /// The series that models of their own whiten, each after its place among those of its output.
    fn alone<'l>(&self, layout: &'l Layout) -> impl Iterator<Item = (usize, &'l Series)> {
        layout.runs().filter(|(_, s)| self.common.as_ref().is_none_or(|(common, _)| !common.has(s.output)))
    }
}

/// The noise of the outputs: the model of each, a force that several have in common, and what they share.
#[derive(Debug, Clone, PartialEq)]
pub struct Whitener {
    /// In the order of the outputs.
    pub models: Vec<NoiseModel>,
    /// What they still share, whitened so.
    shared: Option<Shared>,
    /// A force that is in several of them, in the place of their own models, and what they share beside it.
    common: Option<(CommonForce, Option<Shared>)>,
}

impl Whitener {
    /// Of outputs that share no noise.
    pub fn of(models: Vec<NoiseModel>) -> Self {
        Self { models, common: None, shared: None }
    }

    /// The stack, each series whitened by its output's model.
    pub fn apply(&self, layout: &Layout, stack: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; stack.len()];
        self.apply_into(layout, stack, &mut out);
        out
    }

    /// As [`Whitener::apply`], into a buffer of the same length.
    pub fn apply_into(&self, layout: &Layout, stack: &[f64], out: &mut [f64]) {
        let parts = self.parts(layout);
        for (run, s) in parts.alone(layout) {
            self.models[s.output].whiten(run, &stack[s.rows.clone()], &mut out[s.rows.clone()]);
        }
        if let Some((common, runs)) = &parts.common {
            common.whiten(runs, stack, out);
        }
        if let Some(shared) = parts.shared {
            shared.take_out(layout, out);
        }
    }

    /// The transpose of [`Whitener::apply`], in place.
    pub fn transpose(&self, layout: &Layout, stack: &mut [f64]) {
        let parts = self.parts(layout);
        if let Some(shared) = parts.shared {
            shared.transpose(layout, stack);
        }
        for (run, s) in parts.alone(layout) {
            self.models[s.output].transpose(run, &mut stack[s.rows.clone()]);
        }
        if let Some((common, runs)) = &parts.common {
            common.transpose(runs, stack);
        }
    }

    /// The same for rows of another motion than that it was fitted to: what a force makes there is known by the mean of its ways, in each output by itself.
    pub fn elsewhere(&self) -> Self {
        let models = self.models.iter().map(NoiseModel::elsewhere).collect();
        Self { models, common: None, shared: self.shared.clone() }
    }

    /// What whitens a layout beside the models of its outputs.
    fn parts<'a>(&'a self, layout: &'a Layout) -> Parts<'a> {
        let with =
            |(common, shared): &'a (CommonForce, Option<Shared>)| Some((common, common.runs(layout)?, shared.as_ref()));
        match self.common.as_ref().and_then(with) {
            Some((common, runs, shared)) => Parts { common: Some((common, runs)), shared },
            None => Parts { common: None, shared: self.shared.as_ref() },
        }
    }

    /// The state in whose derivative a force enters that several outputs have in common.
    pub fn common_from(&self) -> Option<usize> {
        self.common.as_ref().map(|(common, _)| common.entry())
    }

    /// Colours unit white noise in place: the inverse of [`Whitener::apply`].
    pub fn colour(&self, layout: &Layout, stack: &mut [f64]) {
        let parts = self.parts(layout);
        if let Some(shared) = parts.shared {
            shared.put_in(layout, stack);
        }
        for (run, s) in parts.alone(layout) {
            self.models[s.output].colour(run, &mut stack[s.rows.clone()]);
        }
        if let Some((common, runs)) = &parts.common {
            common.colour(runs, stack);
        }
    }

    /// Sum over rows of the logarithm of the innovation's standard deviation: the determinant's share of a log likelihood.
    pub fn log_scale(&self, layout: &Layout) -> f64 {
        let parts = self.parts(layout);
        layout.runs().map(|(run, s)| self.log_scale_within(&parts, layout, run, s)).sum()
    }

    /// The share that a series, after its place among those of its output, has in [`Whitener::log_scale`].
    pub fn log_scale_of(&self, layout: &Layout, run: usize, s: &Series) -> f64 {
        self.log_scale_within(&self.parts(layout), layout, run, s)
    }

    fn log_scale_within(&self, parts: &Parts<'_>, layout: &Layout, run: usize, s: &Series) -> f64 {
        let shared = parts.shared.map_or(0.0, |shared| shared.log_scale(layout, s));
        let common = parts.common.as_ref().and_then(|(common, runs)| {
            let run = runs.iter().position(|run| common.has(s.output) && run.contains(&s))?;
            Some(common.log_scale(run, s))
        });
        common.unwrap_or_else(|| self.models[s.output].log_scale(run, s.rows.len())) + s.rows.len() as f64 * shared
    }

    /// Log likelihood of a stacked residual, up to a constant of the layout, less the price of each coefficient.
    pub fn log_likelihood(&self, layout: &Layout, residual: &[f64]) -> f64 {
        let white = self.apply(layout, residual);
        -0.5 * norm2(&white) - self.log_scale(layout) - layout.price() * self.coefficients() as f64
    }

    /// Number of coefficients beyond the scales.
    pub fn coefficients(&self) -> usize {
        let (common, shared) = match &self.common {
            Some((common, shared)) => (Some(common), shared.as_ref()),
            None => (None, self.shared.as_ref()),
        };
        let alone = self.models.iter().enumerate().filter(|(o, _)| common.is_none_or(|common| !common.has(*o)));
        alone.map(|(_, m)| m.coefficients()).sum::<usize>()
            + common.map_or(0, CommonForce::coefficients)
            + shared.map_or(0, Shared::coefficients)
    }

    /// Whether each output's noise is white, whatever they share.
    pub fn is_white(&self) -> bool {
        self.models.iter().all(|m| m.coefficients() == 0)
    }

    /// Whether an output's noise is that of an unknown force through the plant.
    pub fn is_driven(&self) -> bool {
        self.models.iter().any(NoiseModel::is_driven)
    }

    /// The largest order.
    pub fn order(&self) -> usize {
        self.models.iter().map(NoiseModel::order).max().unwrap_or(0)
    }
}
