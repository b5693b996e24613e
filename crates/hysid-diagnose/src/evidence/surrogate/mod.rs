//! The mismatch test: the largest score over all candidate effects, against surrogates in which residual and input are unrelated.
//!
//! A surrogate keeps the prewhitened residual's distribution, its short correlation and that between the outputs and destroys its alignment with the
//! inputs: each run is rolled by a random number of samples, then the sign of each block is drawn. Rolling alone cannot judge effects
//! that survive it (an offset, a trend, a periodic excitation); blocks of random sign do. Multiplicity over effects and shapes is inside the
//! maximum, so the p-value needs no correction.
//!
//! What is left of low-frequency noise after prewhitening is scattered by the signs, and a handful of its lines can look like a slow effect.
//! So a mismatch must also stand out from noise that is drawn with the residual's own spectrum, smoothed by a running median: a few lines that
//! tower over their neighbours (an offset, a periodic effect) do not raise the median, noise that rises towards low frequency does.
//!
//! Noise that is large where an effect is (a sensor's that grows with its reading) leaves the effect few samples, among which much fits by chance; rolled away
//! it does no such thing. Where that matters to what the best effect leaves, a mismatch must also stand out from the residual with the sign of each sample drawn, which stays where
//! it is, where what each effect explains is measured by what noise of these sizes would let it explain (C. F. J. Wu, Annals of Statistics 14 (1986) 1261-1295, the wild bootstrap).
//!
//! The features must come from *simulated* trajectories: measured ones carry the noise of the residual into the feature.

mod kinds;

use std::ops::Range;

use hysid_signal::median;
use rayon::prelude::*;

use super::layout::Layout;
use super::projector::{Projector, norm2, remove_along};
use super::score::{FeatureGroup, score};
use kinds::{flipped, gaussian, levels, rolled};

/// How the test is run.
#[derive(Debug, Clone, Copy)]
pub struct TestOptions {
    /// The level at which the caller will judge the p-value: decides how many surrogates are needed at least.
    pub alpha: f64,
    /// Seed of the surrogates.
    pub seed: u64,
    /// Whether the residual may be noise, of which some samples are larger than others. Where it has a colour, or is mismatch throughout, what is large is what is
    /// missing.
    pub may_be_noise: bool,
}

/// The outcome of the test.
#[derive(Debug, Clone, PartialEq)]
pub struct SurrogateTest {
    /// `(1 + surrogates that come within a margin of 3 of the score) / (1 + surrogates)`: an upper bound.
    pub p_value: f64,
    /// The largest score on the residual itself.
    pub statistic: f64,
    /// The group that has it.
    pub best: Option<usize>,
    /// Largest score of each surrogate, in order of drawing.
    pub surrogates: Vec<f64>,
    /// Whether noise that is large where the residual is large explains more than noise that is as large everywhere.
    pub unequal: bool,
}

impl SurrogateTest {
    /// The test of a residual in which there is nothing.
    pub fn of_nothing() -> Self {
        Self { p_value: 1.0, statistic: 0.0, best: None, surrogates: Vec::new(), unequal: false }
    }

    /// Whether it tells the residual from noise at this level. A p-value at the level is enough: the residual itself is counted among the surrogates, so
    /// that noise has one so small with a probability of the level.
    pub fn tells(&self, alpha: f64) -> bool {
        self.p_value <= alpha
    }
}

/// A group that is tested.
#[derive(Debug, Clone, Copy)]
pub struct Contender<'a> {
    /// The responses.
    pub group: &'a FeatureGroup,
    /// What its score on the residual must bring beyond that of others, since the noise itself does what it does. Its scores on surrogates
    /// count in full.
    pub handicap: f64,
}

/// Samples until the autocorrelation is first below 0.1, at least 1, in the mean over the longest series of the stack: a quarter of a period where they
/// oscillate.
pub fn correlation_time(layout: &Layout, r: &[f64]) -> usize {
    let Some(rows) = layout.series.iter().map(|s| s.rows.len()).max() else { return 1 };
    let longest = layout.series.iter().filter(|s| s.rows.len() == rows).map(|s| &r[s.rows.clone()]);
    let series: Vec<(&[f64], f64)> = longest.map(|x| (x, norm2(x))).filter(|(_, power)| *power > 0.0).collect();
    if series.is_empty() {
        return 1;
    }
    let limit = (rows / 20).max(1);
    let at = |k: usize, (x, power): &(&[f64], f64)| x[k..].iter().zip(*x).map(|(a, b)| a * b).sum::<f64>() / power;
    let mean = |k: usize| series.iter().map(|s| at(k, s)).sum::<f64>() / series.len() as f64;
    (1..limit).find(|&k| mean(k).abs() < 0.1).unwrap_or(limit)
}

/// Surrogates that are scored together: the groups' columns are far more than a cache holds, and each is read once for all of them.
const TOGETHER: usize = 8;

/// The largest score over the groups less their handicaps, with the group, of each of these residuals; what a group explains is divided by its `inflation`
/// where there is one.
fn largest(
    groups: &[Contender<'_>],
    residuals: &[Vec<f64>],
    own: &Projector,
    inflation: &[f64],
) -> Vec<(f64, Option<usize>)> {
    let mut best: Vec<(f64, Option<usize>)> = vec![(f64::NEG_INFINITY, None); residuals.len()];
    let totals: Vec<f64> = residuals.iter().map(|r| norm2(r) - own.inside(r)).collect();
    for (i, g) in groups.iter().enumerate() {
        for ((r, total), best) in residuals.iter().zip(&totals).zip(&mut best) {
            let explained = g.group.explained(r) / inflation.get(i).unwrap_or(&1.0);
            let s = score(*total, explained, r.len(), g.group.columns.len()) - g.handicap;
            if s > best.0 {
                *best = (s, Some(i));
            }
        }
    }
    best
}

/// Tests whether the whitened residual `r`, already projected off `own`, is related to any of the groups.
///
/// Surrogates are drawn in batches: a clear answer ends after 199, a close one goes on to `4/alpha` (at least 999). The p-value is the
/// largest one of the kinds of surrogate; the second kind is drawn only where the first is exceeded, and the third where it matters where the residual is large.
pub fn surrogate_test(
    groups: &[Contender<'_>],
    layout: &Layout,
    own: &Projector,
    r: &[f64],
    options: TestOptions,
) -> SurrogateTest {
    let largest_on = |r: &[f64], inflation: &[f64]| {
        largest(groups, &[r.to_vec()], own, inflation).pop().unwrap_or((f64::NEG_INFINITY, None))
    };
    let (statistic, best) = largest_on(r, &[]);
    if groups.is_empty() {
        return SurrogateTest { p_value: 1.0, statistic: 0.0, best: None, surrogates: Vec::new(), unequal: false };
    }
    let tau = correlation_time(layout, r);
    let fairly: Vec<Contender<'_>> = groups.iter().map(|g| Contender { handicap: 0.0, ..*g }).collect();
    let scores = |some: Range<u64>, inflation: &[f64], one: &dyn Fn(u64) -> Vec<f64>| -> Vec<f64> {
        let drawn: Vec<Vec<f64>> = some.map(one).collect();
        largest(&fairly, &drawn, own, inflation).into_iter().map(|l| l.0).collect()
    };
    let outside = |mut x: Vec<f64>| {
        own.remove(&mut x);
        x
    };
    let judged = |statistic: f64, some: &(dyn Fn(Range<u64>) -> Vec<f64> + Sync)| {
        let bar = statistic - MARGIN;
        let scores = draw(some, bar, options.alpha);
        (exceeded(&scores, bar), scores)
    };
    let first = judged(statistic, &|some| scores(some, &[], &|b| rolled(layout, r, tau, options.seed, b)));
    let in_place = |of: &[f64], some: Range<u64>, inflation: &[f64]| {
        scores(some, inflation, &|b| outside(flipped(layout, of, options.seed, b)))
    };
    let mut left = r.to_vec();
    best.iter().for_each(|&best| remove_along(&groups[best].group.columns, &mut left));
    let few = || draw_at(0..IN_PLACE, &|some| in_place(&left, some, &[]));
    let unequal = options.may_be_noise && median(few()) > median(first.1.clone()) + UNEQUAL;
    let mut kinds = Vec::new();
    if first.0 <= options.alpha {
        let levels: Vec<Vec<f64>> = layout.series.iter().map(|s| levels(&r[s.rows.clone()])).collect();
        let one = |b| outside(gaussian(layout, &levels, r.len(), options.seed, b));
        kinds.push(judged(statistic, &|some| scores(some, &[], &one)));
    }
    if unequal {
        // The best effect may have taken the largest errors out of what it leaves.
        let inflation: Vec<f64> = groups.iter().map(|g| g.group.inflation(r)).collect();
        let (statistic, _) = largest_on(r, &inflation);
        kinds.push(judged(statistic, &|some| in_place(r, some, &inflation)));
    }
    let (p_value, surrogates) =
        kinds.into_iter().fold(first, |known, other| if other.0 > known.0 { other } else { known });
    SurrogateTest { p_value, statistic, best, surrogates, unequal }
}

/// Surrogates of drawn signs that tell whether it matters where the residual is large, and by how much their scores must lie above those of what is
/// rolled: 31 where the noise of a coil's current grows with the current, and -13 to 2 on the 55 other cases of that bank, with an effect or without.
const IN_PLACE: usize = 3 * TOGETHER;
const UNEQUAL: f64 = 5.0;

/// Score by which a residual must exceed its surrogates: they are made with a noise model that is itself estimated, and on controls
/// without it alarms came at four times the nominal rate.
const MARGIN: f64 = 3.0;

/// `(1 + scores at least as large) / (1 + scores)`.
fn exceeded(scores: &[f64], statistic: f64) -> f64 {
    (1 + scores.iter().filter(|&&v| v >= statistic).count()) as f64 / (1 + scores.len()) as f64
}

/// Scores of the surrogates of these numbers.
fn draw_at(numbers: Range<usize>, some: &(dyn Fn(Range<u64>) -> Vec<f64> + Sync)) -> Vec<f64> {
    let end = numbers.end;
    let blocks: Vec<usize> = numbers.step_by(TOGETHER).collect();
    let drawn: Vec<Vec<f64>> = blocks.into_par_iter().map(|b| some(b as u64..(b + TOGETHER).min(end) as u64)).collect();
    drawn.concat()
}

/// Scores of surrogates, in batches until the answer is clear.
fn draw(some: &(dyn Fn(Range<u64>) -> Vec<f64> + Sync), statistic: f64, alpha: f64) -> Vec<f64> {
    // At a level below this the surrogates would take longer than all else; the second look has a bound for it.
    let alpha = alpha.clamp(1e-4, 0.5);
    let first = ((1.0 / alpha).ceil() as usize).max(200) - 1;
    let most = ((4.0 / alpha).ceil() as usize).max(1000) - 1;
    let mut scores: Vec<f64> = Vec::new();
    while scores.len() < most {
        let start = scores.len();
        let end = if start == 0 { first } else { (start + 200).min(most) };
        scores.extend(draw_at(start..end, some));
        let exceeding = scores.iter().filter(|&&v| v >= statistic).count();
        let highest = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if exceeding >= 20 || (exceeding == 0 && statistic > highest + 6.0 && 1.0 / (1 + scores.len()) as f64 <= alpha)
        {
            break;
        }
    }
    scores
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::evidence::layout::Series;
    use crate::evidence::{ForcePaths, Whitener};
    use crate::random::generator;

    const N: usize = 1000;

    /// A synthetic linear plant: 30 effects as filtered functions of a random input, 3 nuisance columns.
    fn features(seed: u64) -> (Layout, Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let mut rng = generator(seed, 99);
        let layout = Layout { series: vec![Series { stretch: 0, output: 0, first: 0, rows: 0..N }], outputs: 1 };
        let mut u: Vec<f64> = (0..N).map(|_| StandardNormal.sample(&mut rng)).collect();
        let filter = |x: &mut Vec<f64>, a: f64| {
            for n in 1..N {
                x[n] += a * x[n - 1];
            }
        };
        filter(&mut u, 0.8);
        let mut own = vec![u.clone(), vec![1.0; N]];
        let mut lagged = u.clone();
        filter(&mut lagged, 0.9);
        own.push(lagged);
        let mut effects: Vec<Vec<f64>> = Vec::new();
        for i in 0..30 {
            let knee = 0.2 * f64::from(i);
            let mut f: Vec<f64> = u
                .iter()
                .enumerate()
                .map(|(n, u)| match i % 4 {
                    0 => (u - knee).max(0.0),
                    1 => u.powi(1 + i / 4) / 10f64.powi(i / 4),
                    2 => n as f64 / N as f64 * (u.abs() - knee).max(0.0),
                    _ => (u * (1.0 + knee)).tanh(),
                })
                .collect();
            filter(&mut f, 0.7);
            effects.push(f);
        }
        effects.push((0..N).map(|n| (n as f64 / N as f64).powi(2)).collect());
        (layout, own, effects)
    }

    fn noise(kind: usize, seed: u64) -> Vec<f64> {
        let mut rng = generator(seed, 7);
        let mut e: Vec<f64> = (0..N).map(|_| StandardNormal.sample(&mut rng)).collect();
        match kind {
            0 => {}
            1 => (1..N).for_each(|n| e[n] += 0.9 * e[n - 1]),
            2 => (2..N).for_each(|n| e[n] += 1.7 * e[n - 1] - 0.9 * e[n - 2]),
            _ => {
                // Process noise through a resonance plus a little measurement noise: an ARMA process, not an AR one.
                (2..N).for_each(|n| e[n] += 1.9 * e[n - 1] - 0.95 * e[n - 2]);
                let scale = (norm2(&e) / N as f64).sqrt();
                for v in &mut e {
                    let w: f64 = StandardNormal.sample(&mut rng);
                    *v += 0.1 * scale * w;
                }
            }
        }
        e
    }

    fn p_value(e: &[f64], seed: u64) -> f64 {
        let (layout, own, effects) = features(seed);
        tested(&layout, &own, &effects, e, seed).p_value
    }

    /// The same seen by two sensors of one machine: the noise acts inside it, each sensor adds a little, and each effect is in both.
    fn p_value_of_two(seed: u64) -> f64 {
        let (one, own, effects) = features(seed);
        let twice = |x: &Vec<f64>| [x.clone(), x.iter().map(|v| 0.7 * v).collect()].concat();
        let mut layout = Layout { outputs: 2, ..one };
        layout.series.push(Series { stretch: 0, output: 1, first: 0, rows: N..2 * N });
        let [own, effects] = [own, effects].map(|list| list.iter().map(twice).collect::<Vec<_>>());
        let (common, added) = (noise(0, seed), [noise(0, seed + 1000), noise(0, seed + 2000)].concat());
        let e: Vec<f64> = twice(&common).iter().zip(&added).map(|(c, a)| c + 0.1 * a).collect();
        tested(&layout, &own, &effects, &e, seed).p_value
    }

    /// An effect of twenty samples where the noise is thirty times as large as elsewhere, or where that is as large as everywhere: fifty lines of frequency
    /// there find among so few samples what a few of them follow.
    #[test]
    fn noise_that_is_large_where_an_effect_is_makes_none() {
        let (layout, own, _) = features(1);
        let there = |n: usize| n % 50 == 7;
        let effects: Vec<Vec<f64>> = (0..50)
            .map(|i| (0..N).map(|n| if there(n) { (0.1 * f64::from(i) * n as f64).sin() } else { 0.0 }).collect())
            .collect();
        let check = |large: f64, strength: f64, unequal: bool, told: bool| {
            for seed in 1..5 {
                let mut e = noise(0, seed);
                e.iter_mut().enumerate().filter(|(n, _)| there(*n)).for_each(|(_, e)| *e *= large);
                e.iter_mut().zip(&effects[20]).for_each(|(e, f)| *e += strength * f);
                let test = tested(&layout, &own, &effects, &e, seed);
                assert_eq!((test.unequal, test.tells(0.02)), (unequal, told), "{large} {strength} {seed}: {test:?}");
            }
        };
        check(30.0, 0.0, true, false);
        check(1.0, 0.0, false, false);
        check(1.0, 4.0, false, true);
        check(30.0, 400.0, true, true);
    }

    fn tested(layout: &Layout, own: &[Vec<f64>], effects: &[Vec<f64>], e: &[f64], seed: u64) -> SurrogateTest {
        let mut r0 = e.to_vec();
        Projector::new(own.to_vec()).remove(&mut r0);
        let whitener: Whitener = layout.fit_noise(&r0, 16, &ForcePaths::default());
        let own = Projector::new(own.iter().map(|c| whitener.apply(layout, c)));
        let mut r = whitener.apply(layout, e);
        own.remove(&mut r);
        let groups: Vec<FeatureGroup> = effects
            .iter()
            .filter_map(|f| FeatureGroup::new(std::slice::from_ref(f), layout, &whitener, &own))
            .collect();
        let refs: Vec<Contender<'_>> = groups.iter().map(|group| Contender { group, handicap: 0.0 }).collect();
        surrogate_test(&refs, layout, &own, &r, TestOptions { alpha: 0.05, seed, may_be_noise: true })
    }

    #[test]
    fn false_alarms_come_at_the_nominal_rate_under_four_noises() {
        for kind in 0..4 {
            let alarms = (0..60).filter(|&s| p_value(&noise(kind, s), s) < 0.05).count();
            // Nominal 3 of 60; more than 8 has probability below 1 %.
            assert!(alarms <= 8, "noise {kind}: {alarms} of 60 alarms at 5 %");
        }
    }

    #[test]
    fn noise_that_two_outputs_share_is_no_alarm() {
        let alarms = (0..60).filter(|&s| p_value_of_two(s) < 0.05).count();
        assert!(alarms <= 8, "{alarms} of 60 alarms at 5 %");
    }

    #[test]
    fn effects_half_as_large_as_the_noise_are_seen() {
        for (effect, seed) in [(0usize, 3u64), (3, 4), (9, 5), (30, 6)] {
            let (_, own, effects) = features(seed);
            let mut f = effects[effect].clone();
            Projector::new(own).remove(&mut f);
            let scale = 0.5 / (norm2(&f) / N as f64).sqrt();
            let e: Vec<f64> = noise(0, seed).iter().zip(&f).map(|(e, f)| e + scale * f).collect();
            let p = p_value(&e, seed);
            assert!(p < 0.01, "effect {effect}: p = {p}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_test_for_any_number_of_threads() {
        let e = noise(1, 1);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| p_value(&e, 1))
        };
        assert_eq!(run(1).to_bits(), run(3).to_bits());
    }

    #[test]
    fn the_correlation_time_is_that_of_all_outputs() {
        let wave: Vec<f64> = (0..N).map(|n| (std::f64::consts::TAU * n as f64 / 80.0).cos()).collect();
        let white = noise(0, 5);
        let series = |i: usize| Series { stretch: 0, output: i, first: 0, rows: i * N..(i + 1) * N };
        let one = Layout { series: vec![series(0)], outputs: 1 };
        // Where the cosine is 0.1, and where it is 0.2.
        assert_eq!(correlation_time(&one, &wave), 19);
        let both = Layout { series: vec![series(0), series(1)], outputs: 2 };
        let stacked = |a: &[f64], b: &[f64]| [a, b].concat();
        let found = [stacked(&wave, &white), stacked(&white, &wave)].map(|r| correlation_time(&both, &r));
        assert!(found[0] == found[1] && (15..=19).contains(&found[0]), "{found:?}");
        assert_eq!(correlation_time(&both, &stacked(&wave, &vec![0.0; N])), 19);
    }
}
