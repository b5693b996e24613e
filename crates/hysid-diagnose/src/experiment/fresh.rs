//! Simulations on inputs that were not recorded: what they answer, and what is lost there if the set that is written is not the true one.
//!
//! A set of effects that was fitted to a small residual may do anything where the recording has not been: a spring that pushes, on a drive that
//! nothing holds, is small until the drive goes there. Sets that are as likely tell how much hangs on the choice: should one of them be the
//! truth, writing the likeliest set brings its distance from the truth, and writing nothing brings the baseline's. It is written where its
//! expected loss is well below that of writing nothing. Inputs are the recorded ones mirrored (each about the middle of its range) and reversed in
//! time, which have the same levels and the same band, and lead elsewhere; and twice as large, where a spring that softens by a power of the displacement
//! pushes. They begin as they were recorded and fade over, so that nothing hangs on how states begin. The set itself is among the truths too, with each
//! strength that the recording hardly tells at the ends of its interval.
//!
//! Reference: J. O. Berger, Statistical Decision Theory and Bayesian Analysis, 2nd ed., Springer (1985), ch. 4.

use hysid_plant::{Drive, Initial, Simulation};
use hysid_signal::range;

use crate::data::DataSet;
use crate::evidence::norm2;
use crate::model::base::{Base, QUANTILE};
use crate::model::hypothesis::{Hypothesis, Setting};
use crate::model::{Model, Values};
use crate::refit::Problem;
use crate::verdict::trifles::adds_trifles;
use crate::verdict::weigh::Contest;

/// Share that a set may have on average of what it and nothing would lose. Below a half: the truth may be none of the sets that were fitted.
const WORTH: f64 = 0.3;
/// What is left out of a fresh input before it is judged: one part of so many.
const RUN_IN: usize = 5;
/// Rivals that are asked, and the least probability of one.
const RIVALS: usize = 8;
const LIKELY: f64 = 0.005;

/// Share of itself within which a strength must be known (standard deviation) not to be asked.
const KNOWN: f64 = 0.25;
/// Share of the set's probability that it has with strengths that are known worse at the ends of their intervals, all of these together.
const SHARE: f64 = 0.5;

/// Squares that an end of an interval may cost, over what it costs where the tangents hold; halvings of the way to it.
const STILL: f64 = 1.5;
const HALVINGS: i32 = 6;

/// The fitted simulation as it starts anew: where the document says, free states where they were found at the start of the longest recording.
pub fn started(base: &Base<'_>) -> Simulation {
    started_at(base, &base.fit.theta)
}

/// The same with other values of its unknowns.
fn started_at(base: &Base<'_>, theta: &[f64]) -> Simulation {
    let mut document = base.model.document(theta);
    let (longest, found) = (base.model.data().longest(), base.model.values(theta).initials);
    for state in document.states.iter_mut().filter(|s| s.initial == Initial::Free) {
        let start = longest.and_then(|at| found.get(&(at, state.name.clone())).copied());
        state.initial = Initial::Number(start.unwrap_or(0.0));
    }
    document
}

/// A set with each of its effects' strengths that the recording hardly tells at the ends of what it may be, the other unknowns as they follow it: a stop that
/// was touched once is deep where an input goes on.
fn uncertain(h: &Hypothesis<'_>) -> Vec<Simulation> {
    let base = &h.base;
    let (theta, k, covariance, bounds) =
        (&base.fit.theta, base.fit.theta.len(), base.covariance(), base.model.bounds());
    let strengths = h.effects.iter().flat_map(|e| &e.written.amplitudes);
    let places = strengths.filter_map(|a| base.model.place_of(&a.name));
    let unknown = places.filter(|&i| covariance[i * (k + 1)].sqrt() > KNOWN * theta[i].abs());
    let layout = &base.model.data().layout;
    let error = |theta: &[f64]| {
        let residual = base.model.residual(theta)?;
        Some(norm2(&base.whitener.apply(layout, &residual)))
    };
    let most = norm2(&base.whitener.apply(layout, &base.fit.residual)) + STILL * QUANTILE.powi(2) * base.variance();
    unknown
        .flat_map(|i| {
            let variance = covariance[i * (k + 1)];
            // Along a valley that bends the tangents lead too far: less of the way where the recording refutes its end.
            let ends = [-QUANTILE, QUANTILE].map(|times| {
                let end = (theta[i] + times * variance.sqrt()).clamp(bounds[i].0, bounds[i].1);
                let moved = |end: f64| -> Vec<f64> {
                    let follow = |j: usize| {
                        let x = theta[j] + covariance[i * k + j] / variance * (end - theta[i]);
                        if x.is_finite() { x.clamp(bounds[j].0, bounds[j].1) } else { theta[j] }
                    };
                    (0..k).map(follow).collect()
                };
                let ways = (0..HALVINGS).map(|n| moved(theta[i] + 0.5_f64.powi(n) * (end - theta[i])));
                ways.into_iter().find(|theta| error(theta).is_some_and(|e| e <= most))
            });
            ends.into_iter().flatten().map(|theta| started_at(base, &theta)).collect::<Vec<_>>()
        })
        .collect()
}

/// An input as a data set, with what a simulation answers to it as its outputs; `None` where it diverges.
pub fn answered(document: &Simulation, drive: &Drive, substeps: usize) -> Option<DataSet> {
    let silent = vec![vec![0.0; drive.len()]; document.outputs.len()];
    let empty = DataSet::of_drive(drive.clone(), silent, drive.period_s());
    let mut fixed = document.clone();
    fixed.parameters.iter_mut().for_each(|p| p.fixed = true);
    let model = Model::new(&fixed, &empty, substeps).ok()?;
    let y = model.predict(&model.theta(&Values::default()))?;
    Some(empty.with_outputs(y))
}

/// The squared distance of two answers to one input after the run-in, each output in units of its noise.
pub(super) fn apart(a: &DataSet, b: &DataSet, noise: &[f64]) -> f64 {
    let outputs = a.stretches[0].outputs.iter().zip(&b.stretches[0].outputs).zip(noise);
    let squares = outputs.map(|((a, b), noise)| {
        a.iter().zip(b).skip(a.len() / RUN_IN).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / noise.powi(2)
    });
    squares.sum()
}

/// The share that writing a set has of what is lost by it and by writing nothing: 0 where nothing is lost by the set, a half where both lose the
/// same; `None` where neither loses anything.
fn share(written: f64, not: f64) -> Option<f64> {
    let share = written / (written + not);
    share.is_finite().then_some(share)
}

/// The expected share of the loss that `set` has on this drive, if the truth is `set` with a probability of `own` and one of the rivals with
/// theirs; `noise` is that of each output. Each truth has its share, so that a rival which goes far astray there does not outweigh all the others.
/// One where the set diverges, `None` where no set differs from the simulation as it is.
fn expected_share(
    nothing: &Simulation,
    (own, set): (f64, &Simulation),
    rivals: &[(f64, Simulation)],
    drive: &Drive,
    substeps: usize,
    noise: &[f64],
) -> Option<f64> {
    let baseline = answered(nothing, drive, substeps)?;
    let Some(best) = answered(set, drive, substeps) else { return Some(1.0) };
    let truths = rivals.iter().filter_map(|(probability, rival)| {
        // A rival that diverges where the set does not is refuted by any machine that survives the input.
        let truth = answered(rival, drive, substeps)?;
        share(apart(&best, &truth, noise), apart(&baseline, &truth, noise)).map(|share| (*probability, share))
    });
    let own = share(0.0, apart(&baseline, &best, noise)).map(|share| (own, share));
    let (all, of_set) =
        own.into_iter().chain(truths).fold((0.0, 0.0), |(all, of), (p, share)| (all + p, of + p * share));
    (all > 0.0).then(|| of_set / all)
}

/// The expected share of the loss that the winner has where it is too large for the winner to be written: that would be a gamble.
pub fn gamble(setting: &Setting<'_>, contest: &Contest<'_, '_>) -> Option<f64> {
    let Contest { pool, probability, winner, .. } = *contest;
    let likely = |&i: &usize| i != winner && probability[i] > LIKELY && !pool[i].effects.is_empty();
    // What a law that is nearly right leaves of itself is no truth, and goes anywhere on a larger input: with it a set says what it says without.
    let (same, mut rivals): (Vec<usize>, Vec<usize>) =
        (1..pool.len()).filter(likely).partition(|&i| adds_trifles(pool, i, winner));
    let of_winner = probability[winner] + same.iter().map(|&i| probability[i]).sum::<f64>();
    rivals.sort_by(|&a, &b| probability[b].total_cmp(&probability[a]));
    let mut rivals: Vec<(f64, Simulation)> =
        rivals.into_iter().take(RIVALS).map(|i| (probability[i], started(&pool[i].base))).collect();
    let itself = uncertain(&pool[winner]);
    let (each, own) = match itself.len() {
        0 => (0.0, of_winner),
        n => (SHARE * of_winner / n as f64, (1.0 - SHARE) * of_winner),
    };
    rivals.extend(itself.into_iter().map(|s| (each, s)));
    if rivals.is_empty() {
        return None;
    }
    let (nothing, best) = (started(&pool[0].base), started(&pool[winner].base));
    let noise: Vec<f64> = pool[winner].base.whitener.models.iter().map(|m| m.noise_rms()).collect();
    [mirror_image, reversed, doubled]
        .into_iter()
        .filter_map(|change: Change| {
            let drive = changed(setting.data, change)?;
            expected_share(&nothing, (own, &best), &rivals, &drive, setting.substeps, &noise)
        })
        .max_by(f64::total_cmp)
        .filter(|loss| *loss > WORTH)
}

/// What makes another input of a recorded one.
pub(super) type Change = fn(&[f64]) -> Vec<f64>;

/// The input of the longest recording with this change, which it fades into; `None` where there is none.
pub(super) fn changed(data: &DataSet, change: Change) -> Option<Drive> {
    let recorded = &data.stretches[data.longest()?].drive;
    let inputs = recorded.inputs().iter().map(|u| faded(u, &change(u))).collect();
    Drive::new(recorded.start_s(), recorded.period_s(), recorded.len(), inputs).ok()
}

/// The first series, which gives way to the second over the first half of the run-in: a start is as it was recorded.
fn faded(from: &[f64], to: &[f64]) -> Vec<f64> {
    let length = (from.len() / (2 * RUN_IN)).max(1) as f64;
    let share = |n: usize| (n as f64 / length).min(1.0);
    from.iter().zip(to).enumerate().map(|(n, (a, b))| a + share(n) * (b - a)).collect()
}

/// A series from its end to its beginning.
pub(super) fn reversed(u: &[f64]) -> Vec<f64> {
    u.iter().rev().copied().collect()
}

/// A series mirrored about the middle of its range.
pub(super) fn mirror_image(u: &[f64]) -> Vec<f64> {
    about_the_middle(u, -1.0)
}

/// A series twice as far from the middle of its range.
pub(super) fn doubled(u: &[f64]) -> Vec<f64> {
    about_the_middle(u, 2.0)
}

/// A series so many times as far from the middle of its range.
fn about_the_middle(u: &[f64], times: f64) -> Vec<f64> {
    let (low, high) = range(u.iter().copied());
    let middle = 0.5 * (low + high);
    u.iter().map(|x| middle + times * (x - middle)).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A drive that nothing holds, pushed one way first, with this damping and a further force.
    pub(in crate::experiment) fn drive(damping: f64, force: &str) -> Simulation {
        let text = format!(
            "[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_N\"\n[parameters]\nb = {{ value = {damping}, min = 0.0, max = 9.0 }}\n\
             [states]\nq = {{ derivative = \"w\", initial = 0.0 }}\nw = {{ derivative = \"u - b*w{force}\", initial = 0.0 }}\n\
             [outputs]\nq_m = \"q\"\n"
        );
        Simulation::parse(&text, "drive").unwrap()
    }

    /// What `uncertain` says of a cubic spring that is fitted where there is this one, as the values of its strength.
    fn strengths_of(cube: f64) -> (f64, Vec<f64>) {
        use crate::model::base::NoiseKind;
        use crate::model::hypothesis::{calibrated, recorded};
        use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
        use crate::search::fitting::refit;
        use crate::search::screen::screen;
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let mut random = normal(6);
        let u = drive(900, &mut random);
        let mut y = respond(&u, REAL, |x, _| cube * x.powi(3));
        let noise = 0.01 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * random());
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = crate::budget::Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let evidence = none.base.evidence();
        let found = screen(&none.base, &setting.original, &[], &evidence, &|m, _| m.id == "cubic_stiffness");
        let h = refit(&setting, &none, &found[0]).unwrap();
        let name = &h.effects[0].written.amplitudes[0].name;
        let values = uncertain(&h).iter().map(|s| s.parameter(name).unwrap().value).collect();
        (h.base.values().parameters[name], values)
    }

    #[test]
    fn a_strength_that_is_hardly_known_is_taken_to_its_ends() {
        assert!(strengths_of(2e5).1.is_empty());
        let (fitted, ends) = strengths_of(0.0);
        let [low, high] = ends[..] else { panic!("{ends:?}") };
        assert!(low < fitted && fitted < high && (high + low - 2.0 * fitted).abs() < 1e-6 * (high - low), "{ends:?}");
    }

    #[test]
    fn an_end_that_the_recording_refutes_is_none() {
        crate::search::gentle::tests::with_a_spill(|_, h| {
            let residual = |document: &Simulation| {
                let model = Model::new(document, h.base.model.data(), h.base.model.substeps()).unwrap();
                norm2(&model.residual(&model.theta(&Values::default())).unwrap())
            };
            let ends = uncertain(h);
            assert!(!ends.is_empty(), "the strength is known");
            let least = residual(&started(&h.base));
            for end in &ends {
                let rise = h.base.model.data().rows() as f64 * (residual(end) / least - 1.0);
                assert!(rise < 2.0 * QUANTILE.powi(2), "{rise} {:?}", end.parameter("c_o"));
            }
        });
    }

    fn pushed() -> Drive {
        let u = (0..600).map(|n| if (n / 100) % 2 == 0 { 1.0 } else { -1.0 }).collect();
        Drive::new(0.0, 0.01, 600, vec![u]).unwrap()
    }

    /// Of writing a set, where the simulation as it is has a damping of 0.5.
    fn loss(own: f64, set: &Simulation, rivals: &[(f64, Simulation)]) -> Option<f64> {
        expected_share(&drive(0.5, ""), (own, set), rivals, &pushed(), 4, &[1.0])
    }

    #[test]
    fn nothing_is_lost_where_all_say_the_same_and_more_than_by_nothing_on_the_wrong_side() {
        let same = [(0.4, drive(0.6, ""))];
        assert!(loss(0.6, &drive(0.6, ""), &same).unwrap() < 1e-20);
        // The truth for certain is the rival: on its side of the simulation as it is a set is better than nothing, on the other it is worse.
        assert!(loss(0.0, &drive(0.6, ""), &[(1.0, drive(0.7, ""))]).unwrap() < 0.5);
        assert!(loss(0.0, &drive(0.4, ""), &[(1.0, drive(0.6, ""))]).unwrap() > 0.5);
        // Neither differs from the simulation as it is.
        assert_eq!(loss(0.5, &drive(0.5, ""), &[(0.5, drive(0.5, ""))]), None);
    }

    #[test]
    fn the_likelier_a_set_the_less_is_lost_by_it() {
        let of = |own: f64| loss(own, &drive(0.6, ""), &[(1.0 - own, drive(0.5, " - 0.3*q*abs(q)"))]).unwrap();
        let losses: Vec<f64> = [0.1, 0.3, 0.5, 0.7, 0.9].into_iter().map(of).collect();
        assert!(losses.windows(2).all(|w| w[1] < w[0]), "{losses:?}");
        assert!(losses[0] > WORTH && losses[4] < WORTH, "{losses:?}");
    }

    #[test]
    fn a_spring_that_pushes_where_the_recording_was_not_is_a_gamble() {
        let rivals = [(0.5, drive(0.55, ""))];
        assert!(loss(0.5, &drive(0.51, " + 0.4*max(q, 0)"), &rivals).unwrap() > WORTH);
        // Where it blows up.
        assert_eq!(loss(0.5, &drive(0.51, " + 4e9*max(q, 0)"), &rivals), Some(1.0));
        // A rival that does is no reason against a set.
        assert_eq!(loss(0.5, &drive(0.55, ""), &[(0.5, drive(0.51, " + 4e9*max(q, 0)"))]), Some(0.0));
    }

    #[test]
    fn dampers_that_say_the_same_part_where_the_input_is_doubled() {
        let on = |change: fn(&[f64]) -> Vec<f64>| {
            let drive_of = pushed();
            let inputs = drive_of.inputs().iter().map(|u| change(u)).collect();
            let fresh = Drive::new(0.0, 0.01, 600, inputs).unwrap();
            let (cubic, lower) = (drive(0.5, " + 0.2*w^3"), drive(0.44, ""));
            expected_share(&drive(0.5, ""), (0.5, &cubic), &[(0.5, lower)], &fresh, 4, &[1.0]).unwrap()
        };
        let (recorded, twice) = (on(<[f64]>::to_vec), on(doubled));
        assert!(recorded < WORTH && twice > WORTH, "{recorded} {twice}");
    }

    #[test]
    fn an_unlikely_rival_that_goes_far_astray_does_not_outweigh_the_rest() {
        let astray = loss(0.9, &drive(0.6, ""), &[(0.1, drive(0.5, " + 0.9*max(q, 0)"))]).unwrap();
        assert!(astray < WORTH, "{astray}");
    }

    /// A lag at the input that begins settled, and one of the sensor that begins at zero, say the same once the start is forgotten.
    #[test]
    fn how_a_state_begins_is_no_part_of_the_loss() {
        let stable = |states: &str, output: &str| {
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_N\"\n[parameters]\nb = {{ value = 9.0, min = 0.0, max = 99.0 }}\n\
                 [states]\n{states}\n[outputs]\nq_m = \"{output}\"\n"
            );
            Simulation::parse(&text, "stable").unwrap()
        };
        let nothing = stable("q = { derivative = \"u - b*q\", initial = 0.0 }", "q");
        let lags = [
            "q = { derivative = \"s - b*q\", initial = 0.0 }\ns = { derivative = \"20*(u - s)\", initial = 1.0 }",
            "q = { derivative = \"u - b*q\", initial = 0.0 }\ns = { derivative = \"20*(q - s)\", initial = 0.0 }",
        ];
        let (input, sensor) = (stable(lags[0], "q"), stable(lags[1], "s"));
        let of = expected_share(&nothing, (0.5, &input), &[(0.5, sensor)], &pushed(), 4, &[1.0]).unwrap();
        assert!(of < 1e-6, "{of}");
    }

    #[test]
    fn a_fresh_input_begins_as_it_was_recorded() {
        let recorded: Vec<f64> = (0..100).map(|n| f64::from(n) + 1.0).collect();
        for change in [mirror_image, reversed, doubled] {
            let fresh = faded(&recorded, &change(&recorded));
            assert_eq!(fresh[0], recorded[0]);
            assert_eq!(fresh[100 / RUN_IN..], change(&recorded)[100 / RUN_IN..]);
        }
    }
}
