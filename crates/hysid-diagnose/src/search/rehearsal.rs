//! The second look rehearsed: how much evidence the likeliest effects gain on recordings in which nothing is missing, on the user's own input.
//!
//! Surrogates hold the noise model fixed. Noise that passes through a plant which integrates is known by a few coefficients that an effect changes
//! when it is fitted, so that most of a true effect is noise to a surrogate, and what an effect gains with a noise model of its own follows
//! no law that is known beforehand. It is therefore simulated: the fitted simulation without effects answers the
//! recorded input, noise is drawn from its noise model with the whitened residual's own distribution, and the same few effects are chosen and
//! fitted as on the recording itself, each with a noise model of its own.
//!
//! Reference: G. J. McLachlan, On bootstrapping the likelihood ratio test statistic for the number of components in a normal mixture, Applied
//! Statistics 36 (1987) 318-324.

use rand::RngExt;
use rayon::prelude::*;

use super::candidate::{Candidate, Point};
use super::peaks::lines_of;
use super::screen::with_added_starts;
use super::starts::set;
use crate::budget::Step;
use crate::data::DataSet;
use crate::evidence::{Projector, norm2, surprise};
use crate::model::base::{Base, spared};
use crate::model::hypothesis::{Hypothesis, Setting};
use crate::random::generator;

/// Effects that are fitted, from each list of candidates.
const LOOKED_AT: usize = 4;
/// Rounds of unknowns and noise by turns, and iterations in each.
const ROUNDS: usize = 2;
const ITERATIONS: usize = 6;
/// Rehearsals that are drawn together, and most of them.
const TOGETHER: usize = 8;
const MOST: usize = 24;
/// Log evidence by which a recording must stand out from all rehearsals before no more are drawn.
const CLEAR: f64 = 6.0;
/// Stream of the noise.
const STREAM: u64 = 0x8 << 56;

/// Candidates as they stand under one noise model: what is estimated besides, and how a residual is whitened.
struct List<'a, 'd> {
    base: &'a Base<'d>,
    own: Projector,
    candidates: &'a [Candidate],
}

impl<'a> List<'a, '_> {
    /// The candidates that explain most of a residual, each at its best point, with the amplitudes there. What slow noise does is none of them: no
    /// recording tells how its noise goes on below the lowest line.
    fn likeliest(&self, residual: &[f64]) -> Vec<(&'a Candidate, &'a Point, Vec<f64>)> {
        let mut r = self.base.whitener.apply(&self.base.model.data().layout, residual);
        self.own.remove(&mut r);
        let total = norm2(&r);
        let mut found: Vec<(f64, &Candidate, &Point, Vec<f64>)> = self
            .candidates
            .iter()
            .filter(|c| c.lacking.is_none() && !c.mechanism.family.is_slow_noise())
            .filter_map(|c| {
                let scored = c.points.iter().filter_map(|p| {
                    let group = p.group.as_ref()?;
                    let left = (total - group.explained(&r)).max(f64::MIN_POSITIVE);
                    Some((surprise(0.5 * r.len() as f64 * (total / left).ln(), group.columns.len()), p, group))
                });
                let (surprise, point, group) = scored.max_by(|a, b| a.0.total_cmp(&b.0))?;
                Some((surprise, c, point, group.amplitudes(&r, point.amplitudes.len())))
            })
            .collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        found.into_iter().take(LOOKED_AT).map(|(_, c, p, amplitudes)| (c, p, amplitudes)).collect()
    }
}

/// How surprising the most surprising of the likeliest effects is on a data set, by the log likelihood that it gains. `handicapped`: what the
/// residual of the recording itself pointed to counts as one of all the lines there are.
fn largest_surprise(
    setting: &Setting<'_>,
    none: &Base<'_>,
    lists: &[List<'_, '_>],
    residual: &[f64],
    handicapped: bool,
) -> Option<f64> {
    // As thoroughly as any effect, which goes on from there: what it gains must not be what this left undone.
    let start = lists
        .iter()
        .filter_map(|l| {
            let noise = Some(&l.base.whitener);
            setting.fit(none.model.simulation(), &l.base.values(), noise, ROUNDS + 1, 2 * ITERATIONS)
        })
        .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))?;
    let likelihood = |b: &Base<'_>| b.log_likelihood + spared(setting.data, &b.whitener, &start.whitener);
    let nothing = likelihood(&start);
    let mut best: Option<f64> = None;
    let chosen = lists.iter().flat_map(|l| l.likeliest(residual).into_iter().map(move |c| (&l.base.whitener, c)));
    for (noise, (candidate, point, amplitudes)) in chosen {
        let document = &candidate.refit.simulation;
        let mut from =
            with_added_starts(&start.values(), &candidate.refit, &candidate.slot, setting.data.stretches.len());
        point.shapes.iter().for_each(|(name, x)| set(&mut from, document, name, *x));
        point.amplitudes.iter().zip(&amplitudes).for_each(|((name, _), x)| set(&mut from, document, name, *x));
        let Some(base) = setting.fit(document, &from, Some(noise), ROUNDS, ITERATIONS) else { continue };
        let lines = if handicapped { lines_of(setting.data, &candidate.refit).ln() } else { 0.0 };
        let unknowns = base.model.unknowns().len().saturating_sub(start.model.unknowns().len());
        let found = surprise(likelihood(&base) - nothing, unknowns) - lines;
        best = Some(best.map_or(found, |b| b.max(found)));
    }
    best
}

/// A recording in which nothing is missing: what the simulation answers, with noise of its own.
fn rehearsed(none: &Base<'_>, answer: &[f64], white: &[f64], seed: u64, index: u64) -> (DataSet, Vec<f64>) {
    let data = none.model.data();
    let mut rng = generator(seed, STREAM | index);
    let mut noise: Vec<f64> = (0..white.len())
        .map(|_| {
            let w = white[rng.random_range(0..white.len())];
            if rng.random::<bool>() { w } else { -w }
        })
        .collect();
    none.whitener.colour(&data.layout, &mut noise);
    let y = answer.iter().zip(&noise).map(|(y, e)| y + e).collect();
    (data.with_outputs(y), noise)
}

/// Probability that a gain is exceeded by chance, from gains that were drawn: the highest quarter of them and beyond it an exponential tail, no steeper
/// than that of a ratio of evidences (Markov's inequality; J. Pickands, Annals of Statistics 3 (1975) 119-131, for peaks over a threshold).
fn exceeded(gains: &[f64], gain: f64) -> f64 {
    let mut sorted = gains.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let (above, rest) = sorted.split_at(sorted.len() / 4);
    let Some(threshold) = rest.first() else { return 1.0 };
    if gain <= *threshold {
        return 1.0;
    }
    let scale = (above.iter().map(|g| g - threshold).sum::<f64>() / above.len().max(1) as f64).max(1.0);
    (above.len() + 1) as f64 / (gains.len() + 1) as f64 * (-(gain - threshold) / scale).exp()
}

/// Probability that the likeliest effects gain so much where nothing is missing; `None` where that cannot be told. `plain` are the candidates
/// around the simulation under white noise, which see what a coloured noise model takes for noise.
pub fn by_rehearsal(
    setting: &Setting<'_>,
    none: &Hypothesis<'_>,
    candidates: &[Candidate],
    plain: Option<&(Hypothesis<'_>, Vec<Candidate>)>,
    alpha: f64,
    seed: u64,
) -> Option<f64> {
    let around = |base, candidates| List { base, own: Base::evidence(base).0, candidates };
    let mut lists = vec![around(&none.base, candidates)];
    lists.extend(plain.map(|(start, found)| around(&start.base, found)));
    let gain = largest_surprise(setting, &none.base, &lists, &none.base.fit.residual, true).filter(|g| *g > 0.0)?;
    let answer = none.base.model.predict(&none.base.fit.theta)?;
    let white = none.base.whitener.apply(&setting.data.layout, &none.base.fit.residual);
    let mut gains: Vec<f64> = Vec::new();
    let mut p = 1.0;
    while gains.len() < MOST {
        if setting.budget.omits(Step::Rehearsal) {
            return None;
        }
        let from = gains.len() as u64;
        let drawn: Vec<f64> = (from..from + TOGETHER as u64)
            .into_par_iter()
            .filter_map(|index| {
                let (data, noise) = rehearsed(&none.base, &answer, &white, seed, index);
                largest_surprise(&Setting { data: &data, ..setting.clone() }, &none.base, &lists, &noise, false)
            })
            .collect();
        if drawn.len() < TOGETHER {
            return None;
        }
        gains.extend(drawn);
        p = exceeded(&gains, gain);
        let highest = gains.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if p > 10.0 * alpha || (gains.len() > TOGETHER && gain > highest + CLEAR) {
            break;
        }
    }
    Some(p)
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;
    use proptest::prelude::*;

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use crate::search::screen::screen;

    proptest! {
        #[test]
        fn more_gain_is_less_likely_and_nothing_is_impossible(gains in prop::collection::vec(-9.0..9.0_f64, 8..30), a in -9.0..40.0_f64, b in -9.0..40.0_f64) {
            let (p, q) = (exceeded(&gains, a.min(b)), exceeded(&gains, a.max(b)));
            prop_assert!(q <= p && q > 0.0 && p <= 1.0);
            // No steeper than the ratio of evidences that is asked for.
            let highest = gains.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let far = a.max(highest);
            prop_assert!(exceeded(&gains, far + 3.0) >= exceeded(&gains, far) * (-3.0_f64).exp() * (1.0 - 1e-9));
        }
    }

    #[test]
    fn the_tail_of_an_exponential_law_comes_back() {
        for scale in [1.0, 2.5] {
            let gains: Vec<f64> = (0..400).map(|i| -scale * ((i as f64 + 0.5) / 400.0).ln()).collect();
            for gain in [3.0, 6.0, 12.0] {
                let ratio = exceeded(&gains, scale * gain) / (-gain).exp();
                assert!((0.6..1.7).contains(&ratio), "{scale} {gain}: {ratio}");
            }
        }
    }

    /// An oscillator with a cubic spring of this stiffness, in N/m^3, under autoregressive noise.
    fn stiffened(seed: u64, cubic: f64) -> DataSet {
        let mut random = normal(seed);
        let u = drive(800, &mut random);
        let mut y = respond(&u, REAL, |x, _| cubic * x * x * x);
        let size = 0.02 * rms(&y);
        let mut noise = 0.0;
        for y in &mut y {
            noise = 0.8 * noise + 0.6 * size * random();
            *y += noise;
        }
        recorded(&Simulation::parse(BASELINE, "test.sim.toml").unwrap(), PERIOD, [("u_N", u), ("x_m", y)])
    }

    fn p_value(data: &DataSet) -> Option<f64> {
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, data, NoiseKind::Coloured, &budget);
        assert!(!none.base.whitener.is_white());
        let candidates = screen(&none.base, &setting.original, &[], &none.base.evidence(), &|_, _| true);
        by_rehearsal(&setting, &none, &candidates, None, 0.005, 1)
    }

    #[test]
    fn a_cubic_spring_under_coloured_noise_is_seen_and_its_absence_is_no_alarm() {
        for seed in 1..4 {
            let p = p_value(&stiffened(seed, 0.0));
            assert!(p.is_none_or(|p| p > 0.005), "seed {seed}: {p:?} where nothing is missing");
        }
        let p = p_value(&stiffened(4, CUBIC)).unwrap();
        assert!(p < 0.005, "{p}");
    }

    /// Stiffness of the cubic spring that is to be seen, in N/m^3.
    const CUBIC: f64 = 60.0;
}
