//! Refit of the short list and composition of effects: a beam over sets, with backward drops and swaps.
//!
//! A hypothesis is a set of effects written into the user's simulation one after the other and fitted together with its parameters by
//! simulation error. Its evidence is the log likelihood of the residual under its own noise model, less half of `ln n` for each unknown
//! that the effects brought (the Bayes criterion).

use hysid_plant::Simulation;
use rayon::prelude::*;

use crate::base::{Base, NoiseKind, fit_simulation};
use crate::data::{DataSet, held_out_blocks};
use crate::evidence::Whitener;
use crate::mechanism::{Mechanism, Rewritten};
use crate::model::{Model, Values};
use crate::refit::{LmOptions, levenberg_marquardt};
use crate::screen::{Candidate, screen, with_added_starts};
use crate::slot::Slot;

/// An effect of a hypothesis.
#[derive(Debug, Clone)]
pub struct Effect {
    /// The mechanism.
    pub mechanism: &'static Mechanism,
    /// The slot at which it was written.
    pub slot: Slot,
    /// How it was written: names of its parameters and states, what is reported.
    pub written: Rewritten,
    /// Share that the simulation's own parameters absorb, from the screening.
    pub concealment: Option<f64>,
}

/// A fitted set of effects.
#[derive(Debug)]
pub struct Hypothesis<'d> {
    /// The effects in the order in which they were written.
    pub effects: Vec<Effect>,
    /// The fitted simulation.
    pub base: Base<'d>,
    /// Log likelihood less the price of what the effects brought.
    pub log_evidence: f64,
}

/// Names of a set, sorted: two hypotheses with the same key are the same statement.
pub type Key = Vec<(&'static str, String)>;

impl Hypothesis<'_> {
    /// The statement that it makes.
    pub fn key(&self) -> Key {
        let mut key: Key = self.effects.iter().map(|e| (e.mechanism.id, e.slot.label.clone())).collect();
        key.sort();
        key
    }
}

/// How well a hypothesis predicts blocks of the estimation recordings when it is fitted to the rest: log likelihood of the blocks, and the
/// sum of squares of each block's rows for the standard error of a difference.
pub fn block_score(setting: &Setting<'_>, h: &Hypothesis<'_>) -> Option<(f64, Vec<f64>)> {
    let data = setting.data;
    let weights = held_out_blocks(&data.layout, &data.y);
    let options = LmOptions { iterations: 5, ..LmOptions::default() };
    let fit =
        levenberg_marquardt(&h.base.model, &h.base.fit.theta, &data.layout, &h.base.whitener, Some(&weights), options)?;
    let white = h.base.whitener.apply(&data.layout, &fit.residual);
    let (mut score, mut squares) = (0.0, Vec::new());
    for s in &data.layout.series {
        let scale = h.base.whitener.models[s.output].log_scale(s.rows.len()) / s.rows.len() as f64;
        for row in s.rows.clone().filter(|&row| weights[row] == 0.0) {
            score -= 0.5 * white[row] * white[row] + scale;
            squares.push(fit.residual[row] * fit.residual[row]);
        }
    }
    (!squares.is_empty()).then_some((score, squares))
}

/// What all fits share.
#[derive(Debug, Clone)]
pub struct Setting<'d> {
    /// The estimation data.
    pub data: &'d DataSet,
    /// The user's simulation.
    pub original: Simulation,
    /// Names of its states.
    pub own_states: Vec<String>,
    /// Integration steps in each period.
    pub substeps: usize,
    /// Number of unknowns of the simulation without effects.
    pub own_unknowns: usize,
    /// Iterations of a refit on the short list.
    pub iterations: usize,
    /// How noise is modelled.
    pub noise: NoiseKind,
}

impl<'d> Setting<'d> {
    /// Fits a document from values; the noise model is that given, then its own.
    pub fn fit(
        &self,
        document: &Simulation,
        start: &Values,
        noise: Option<&Whitener>,
        rounds: usize,
        iterations: usize,
    ) -> Option<Base<'d>> {
        let model = Model::new(document, self.data, &self.own_states, self.substeps).ok()?;
        fit_simulation(model, start, noise, rounds, LmOptions { iterations, ..LmOptions::default() }, self.noise)
    }

    /// The evidence of a fitted document.
    pub fn evidence(&self, base: &Base<'_>) -> f64 {
        let brought = base.model.unknowns().len().saturating_sub(self.own_unknowns) as f64;
        base.log_likelihood - 0.5 * brought * (self.noise.share() * self.data.rows() as f64).max(2.0).ln()
    }
}

/// Starts of a refit: the best point of the grid, the best that is no neighbour of it, and the gentlest.
fn starts(candidate: &Candidate, most: usize) -> Vec<Vec<(String, f64)>> {
    let named = |point: &crate::screen::Point| -> Vec<(String, f64)> {
        let mut values = point.shapes.clone();
        for (name, amplitude) in &point.amplitudes {
            values.push((name.clone(), *amplitude));
        }
        values
    };
    let mut out: Vec<Vec<(String, f64)>> = Vec::new();
    let Some(best) = candidate.points.first() else { return out };
    out.push(named(best));
    let far = |a: &[(String, f64)], b: &[(String, f64)]| {
        a.iter().zip(b).any(|((_, x), (_, y))| (x - y).abs() > 0.6 * x.abs().max(y.abs()))
    };
    if let Some(other) = candidate.points.iter().skip(1).find(|p| far(&p.shapes, &best.shapes)) {
        out.push(named(other));
    }
    if candidate.refit.amplitudes.is_empty() && !candidate.refit.neutral.is_empty() {
        // Only shapes: the effect's strength is in them, and the point's weight says how strong.
        let weight = best.amplitudes.first().map_or(1.0, |a| a.1.clamp(0.05, 1.0));
        let neutral = |name: &str| candidate.refit.neutral.iter().find(|(n, _)| n == name).map_or(0.0, |(_, v)| *v);
        out.push(best.shapes.iter().map(|(n, v)| (n.clone(), neutral(n) + weight.sqrt() * (v - neutral(n)))).collect());
    }
    out.truncate(most);
    out
}

/// A few iterations from a candidate's best start.
fn sketch<'d>(setting: &Setting<'d>, parent: &Hypothesis<'_>, candidate: &Candidate) -> Option<Hypothesis<'d>> {
    let from = starting_values(setting, parent, candidate).into_iter().next()?;
    let base = setting.fit(&candidate.refit.simulation, &from, Some(&parent.base.whitener), 1, 3)?;
    Some(hypothesis(setting, parent, candidate, base))
}

/// The parent's values with each of the candidate's starts.
fn starting_values(setting: &Setting<'_>, parent: &Hypothesis<'_>, candidate: &Candidate) -> Vec<Values> {
    let document = &candidate.refit.simulation;
    let values =
        with_added_starts(&parent.base.values(), &candidate.refit, &candidate.slot, setting.data.stretches.len());
    starts(candidate, 3)
        .into_iter()
        .map(|start| {
            let mut from = values.clone();
            for (name, x) in start {
                if let Some(p) = document.parameter(&name) {
                    from.parameters.insert(name, x.clamp(p.lower(), p.upper()));
                }
            }
            from
        })
        .collect()
}

/// Refits one candidate on top of a hypothesis' simulation; `begun` is a fit from its best start that has not converged.
pub fn refit<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    begun: Option<Base<'d>>,
) -> Option<Hypothesis<'d>> {
    let document = &candidate.refit.simulation;
    let mut froms = starting_values(setting, parent, candidate);
    if let (Some(b), Some(first)) = (&begun, froms.first_mut()) {
        *first = b.values();
    }
    let mut best: Option<Base<'d>> = begun;
    for (i, from) in froms.into_iter().enumerate() {
        // Another start must come near the best in a few iterations to be followed.
        let brief = if i == 0 { setting.iterations } else { 5 };
        let Some(mut base) = setting.fit(document, &from, Some(&parent.base.whitener), 1, brief) else {
            continue;
        };
        if i > 0 && best.as_ref().is_none_or(|b| base.log_likelihood > b.log_likelihood - 10.0) {
            let longer = setting.fit(document, &base.values(), Some(&parent.base.whitener), 1, setting.iterations);
            base = longer.unwrap_or(base);
        }
        if best.as_ref().is_none_or(|b| base.log_likelihood > b.log_likelihood) {
            best = Some(base);
        }
    }
    let base = best?;
    let base = profile_shapes(setting, candidate, base);
    // A last round under its own noise model.
    let polished = setting.fit(document, &base.values(), Some(&base.whitener), 1, 6);
    let base = match polished {
        Some(p) if p.log_likelihood > base.log_likelihood => p,
        _ => base,
    };
    Some(hypothesis(setting, parent, candidate, base))
}

/// A fitted candidate as a hypothesis.
fn hypothesis<'d>(
    setting: &Setting<'d>,
    parent: &Hypothesis<'_>,
    candidate: &Candidate,
    base: Base<'d>,
) -> Hypothesis<'d> {
    let mut effects = parent.effects.clone();
    effects.push(Effect {
        mechanism: candidate.mechanism,
        slot: candidate.slot.clone(),
        written: candidate.refit.clone(),
        concealment: candidate.concealment(),
    });
    let log_evidence = setting.evidence(&base);
    Hypothesis { effects, base, log_evidence }
}

/// Line search over shapes that least squares cannot move: where the derivative by the shape vanishes or the shape stands where it began,
/// its neighbourhood in the grid is searched by shrinking steps, the other unknowns refitted at each.
fn profile_shapes<'d>(setting: &Setting<'d>, candidate: &Candidate, base: Base<'d>) -> Base<'d> {
    let mut best = base;
    for shape in &candidate.refit.shapes {
        if !crate::screen::needs_profile(candidate.mechanism.id, &shape.name) || shape.grid.len() < 3 {
            continue;
        }
        let mut document = candidate.refit.simulation.clone();
        let Some(p) = document.parameter_mut(&shape.name) else { continue };
        let (low, high) = (p.lower(), p.upper());
        p.fixed = true;
        let here = |b: &Base<'_>| b.values().parameters.get(&shape.name).copied().unwrap_or(0.0);
        let spacing = shape.grid.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        let mut step = 0.5 * spacing;
        for _ in 0..6 {
            let x = here(&best);
            let trials: Vec<Option<Base<'d>>> = [x - step, x + step]
                .into_par_iter()
                .map(|value| {
                    if value < low || value > high {
                        return None;
                    }
                    let mut d = document.clone();
                    if let Some(p) = d.parameter_mut(&shape.name) {
                        p.value = value;
                    }
                    let mut from = best.values();
                    from.parameters.insert(shape.name.clone(), value);
                    setting.fit(&d, &from, Some(&best.whitener), 1, 3)
                })
                .collect();
            let better = trials
                .into_iter()
                .flatten()
                .filter(|t| t.log_likelihood > best.log_likelihood + 1e-3)
                .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
            match better {
                Some(t) => best = t,
                None => step *= 0.4,
            }
        }
        // Back to the document in which the shape is an unknown again.
        if let Some(b) = setting.fit(&candidate.refit.simulation, &best.values(), Some(&best.whitener), 1, 2)
            && b.log_likelihood >= best.log_likelihood
        {
            best = b;
        } else if let Some(b) = setting.fit(&candidate.refit.simulation, &best.values(), Some(&best.whitener), 1, 0) {
            best = b;
        }
    }
    best
}

/// The candidates worth a refit: the best by score, at most `most`, and one for each slot and family that is not far behind.
pub fn short_list(candidates: &[Candidate], most: usize) -> Vec<&Candidate> {
    let Some(top) = candidates.first().map(Candidate::score) else { return Vec::new() };
    let mut list: Vec<&Candidate> = Vec::new();
    for (i, c) in candidates.iter().enumerate() {
        let fresh = !list.iter().any(|l| l.mechanism.family == c.mechanism.family && l.slot.label == c.slot.label);
        let near = c.score() > top - 40.0 && c.score() > 0.0;
        if i < most || (fresh && near && list.len() < most + 6) {
            list.push(c);
        }
    }
    // Siblings of the best must be heard: the verdict turns on them.
    if let Some(best) = candidates.first() {
        for c in candidates {
            let rival = (c.mechanism.family == best.mechanism.family
                || best.mechanism.contains.contains(&c.mechanism.id)
                || best.mechanism.confusable.contains(&c.mechanism.id)
                || c.mechanism.contains.contains(&best.mechanism.id))
                && c.slot.label == best.slot.label;
            if rival && !list.iter().any(|l| std::ptr::eq(*l, c)) {
                list.push(c);
            }
        }
    }
    list
}

/// Log evidence by which a candidate may trail after a few iterations and still be refitted to the end.
const HOPELESS: f64 = 40.0;

/// Refits a short list on top of a hypothesis, in parallel, best evidence first.
///
/// A few iterations from the best start tell who is hopeless; the others are refitted to the end, from all their starts.
pub fn refit_all<'d>(setting: &Setting<'d>, parent: &Hypothesis<'d>, list: &[&Candidate]) -> Vec<Hypothesis<'d>> {
    let first: Vec<Option<Hypothesis<'d>>> = list.par_iter().map(|c| sketch(setting, parent, c)).collect();
    let mut order: Vec<f64> = first.iter().flatten().map(|h| h.log_evidence).collect();
    order.sort_by(|a, b| b.total_cmp(a));
    let best = order.first().copied().unwrap_or(f64::NEG_INFINITY);
    let fourth = order.get(3).copied().unwrap_or(f64::NEG_INFINITY);
    let threshold = (best - HOPELESS).min(fourth);
    let mut out: Vec<Hypothesis<'d>> = list
        .par_iter()
        .zip(first)
        .filter_map(|(c, sketched)| match sketched {
            Some(h) if h.log_evidence < threshold => Some(h),
            Some(h) => refit(setting, parent, c, Some(h.base)),
            None => refit(setting, parent, c, None),
        })
        .collect();
    out.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    out
}

/// The set without its `index`-th effect: the others are written anew in their order and fitted from where they were.
pub fn without<'d>(
    setting: &Setting<'d>,
    none: &Hypothesis<'d>,
    set: &Hypothesis<'d>,
    index: usize,
) -> Option<Hypothesis<'d>> {
    let rest: Vec<&Effect> = set.effects.iter().enumerate().filter(|(i, _)| *i != index).map(|(_, e)| e).collect();
    if rest.is_empty() {
        return None;
    }
    let mut document = none.base.document();
    let mut values = set.base.values();
    let mut effects = Vec::new();
    for e in rest {
        let written = crate::screen::rewrite_at(&none.base, &document, &setting.original, e.mechanism, &e.slot.label)?;
        // The same law may have got other names: values go by order.
        let old = e.written.parameters_of();
        let new = written.0.parameters_of();
        for (o, n) in old.iter().zip(&new) {
            if let Some(x) = set.base.values().parameters.get(o) {
                values.parameters.insert(n.clone(), *x);
            }
        }
        document = written.0.simulation.clone();
        effects.push(Effect {
            mechanism: e.mechanism,
            slot: written.1,
            written: written.0,
            concealment: e.concealment,
        });
    }
    let base = setting.fit(&document, &values, Some(&set.base.whitener), 2, setting.iterations)?;
    let log_evidence = setting.evidence(&base);
    Some(Hypothesis { effects, base, log_evidence })
}

/// How a search is bounded.
#[derive(Debug, Clone, Copy)]
pub struct SearchOptions {
    /// Most effects in a set.
    pub depth: usize,
    /// Sets that are extended at each depth.
    pub beam: usize,
    /// Candidates that are refitted for each set.
    pub most: usize,
}

/// Log evidence that another effect must add.
pub const LEAST_GAIN: f64 = 4.0;

/// Extends the hypotheses of `pool` (all of one effect or more) until evidence stops growing, prunes the best and tries swaps.
///
/// `unexplained` says whether something significant is left of a hypothesis' residual, `enough` whether time is up. All hypotheses that were fitted stay in the pool: the verdict's probabilities are over them.
pub fn compose<'d>(
    setting: &Setting<'d>,
    none: &Hypothesis<'d>,
    pool: &mut Vec<Hypothesis<'d>>,
    options: SearchOptions,
    unexplained: &dyn Fn(&Hypothesis<'d>) -> bool,
    enough: &(dyn Fn() -> bool + Sync),
) {
    for depth in 2..=options.depth {
        if enough() {
            return;
        }
        // Where nothing significant is left there is nothing to add.
        if best_of(pool).is_none_or(|b| pool[b].effects.len() + 1 < depth || !unexplained(&pool[b])) {
            break;
        }
        let best = pool.iter().map(|h| h.log_evidence).fold(f64::NEG_INFINITY, f64::max);
        let parents = beam(pool, depth - 1, options.beam);
        let mut found = Vec::new();
        for p in parents {
            if enough() {
                break;
            }
            let parent = &pool[p];
            let evidence = parent.base.evidence();
            let candidates = screen(&parent.base, &setting.original, &evidence, &|_, _| true);
            if candidates.first().is_none_or(|c| c.score() < 2.0) {
                continue;
            }
            let list = short_list(&candidates, options.most);
            found.extend(refit_all(setting, parent, &list));
        }
        let reached = found.iter().map(|h| h.log_evidence).fold(f64::NEG_INFINITY, f64::max);
        for h in found {
            add(pool, h);
        }
        if reached < best + LEAST_GAIN {
            break;
        }
    }
    // Backward: drop each member of the best set, put another in its place.
    for _ in 0..1 {
        let Some(best) = best_of(pool) else { return };
        let n = pool[best].effects.len();
        if n < 2 || enough() {
            return;
        }
        let before = pool[best].log_evidence;
        let mut found = Vec::new();
        for index in 0..n {
            if enough() {
                break;
            }
            let Some(rest) = without(setting, none, &pool[best], index) else { continue };
            let evidence = rest.base.evidence();
            let candidates = screen(&rest.base, &setting.original, &evidence, &|_, _| true);
            let list = short_list(&candidates, options.most);
            let swapped = refit_all(setting, &rest, &list);
            found.push(rest);
            found.extend(swapped);
        }
        for h in found {
            add(pool, h);
        }
        let after = best_of(pool).map_or(before, |b| pool[b].log_evidence);
        if after < before + 1.0 {
            break;
        }
    }
}

/// Adds a hypothesis, or replaces the same statement with less evidence.
pub fn add<'d>(pool: &mut Vec<Hypothesis<'d>>, h: Hypothesis<'d>) {
    let key = h.key();
    match pool.iter_mut().find(|p| p.key() == key) {
        Some(same) => {
            if h.log_evidence > same.log_evidence {
                *same = h;
            }
        }
        None => pool.push(h),
    }
}

/// The set that stands: most evidence, where each further effect must have added [`LEAST_GAIN`].
pub fn best_of(pool: &[Hypothesis<'_>]) -> Option<usize> {
    let most = pool.iter().map(|h| h.effects.len()).max()?;
    let mut standing: Option<usize> = None;
    for size in 0..=most {
        let of_size = (0..pool.len())
            .filter(|&i| pool[i].effects.len() == size)
            .max_by(|&a, &b| pool[a].log_evidence.total_cmp(&pool[b].log_evidence));
        let Some(i) = of_size else { continue };
        match standing {
            Some(s)
                if pool[i].log_evidence < pool[s].log_evidence + LEAST_GAIN * (size - pool[s].effects.len()) as f64 => {
            }
            _ => standing = Some(i),
        }
    }
    standing
}

/// The best sets of one size, of different families where there are any.
fn beam(pool: &[Hypothesis<'_>], size: usize, width: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..pool.len()).filter(|&i| pool[i].effects.len() == size).collect();
    order.sort_by(|&a, &b| pool[b].log_evidence.total_cmp(&pool[a].log_evidence));
    let families = |i: usize| -> Vec<&'static str> {
        let mut f: Vec<&'static str> = pool[i].effects.iter().map(|e| e.mechanism.family.name()).collect();
        f.sort_unstable();
        f
    };
    let mut chosen: Vec<usize> = Vec::new();
    for &i in &order {
        if chosen.len() < width && !chosen.iter().any(|&c| families(c) == families(i)) {
            chosen.push(i);
        }
    }
    chosen
}
