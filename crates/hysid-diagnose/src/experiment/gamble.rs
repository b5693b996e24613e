//! What is lost where the set of effects that is written is not the true one.
//!
//! A set of effects that was fitted to a small residual may do anything where the recording has not been: a spring that pushes, on a drive that
//! nothing holds, is small until the drive goes there. Sets that are as likely tell how much hangs on the choice: should one of them be the
//! truth, writing the likeliest set brings its distance from the truth, and writing nothing brings the baseline's. It is written where its
//! expected loss on inputs that were not recorded ([`super::fresh`]) is well below that of writing nothing, else one that is nearly as likely and loses less.
//! The set itself is among the truths too, with each strength that the recording hardly tells at the ends of its interval.
//!
//! Reference: J. O. Berger, Statistical Decision Theory and Bayesian Analysis, 2nd ed., Springer (1985), ch. 4.

use hysid_plant::{Drive, Simulation};

use super::fresh::{Change, answered, apart, changed, doubled, mirror_image, reversed, started, started_at};
use crate::evidence::norm2;
use crate::model::base::QUANTILE;
use crate::model::hypothesis::{Hypothesis, Setting};
use crate::refit::Problem;
use crate::verdict::trifles::adds_trifles;
use crate::verdict::weigh::Contest;

/// Share that a set may have on average of what it and nothing would lose. Below a half: the truth may be none of the sets that were fitted.
const WORTH: f64 = 0.3;
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

/// Share of the winner's probability from which on another set may be written in its place, and how many are asked.
const AS_LIKELY: (f64, usize) = (0.5, 3);

/// The set that is written where the winner would be a gamble, of those that are nearly as likely: the one by which the least is lost should it not be the
/// true one (a stop in the place of a spring of the fifth power, which goes far astray where an input is doubled). `None` where each of them is one.
pub fn safest(
    setting: &Setting<'_>,
    contest: &Contest<'_, '_>,
    may_be_written: impl Fn(usize) -> bool,
) -> Option<usize> {
    let Contest { pool, probability, winner, .. } = *contest;
    let likely = |&i: &usize| i != winner && probability[i] > AS_LIKELY.0 * probability[winner];
    let mut others: Vec<usize> = (1..pool.len()).filter(likely).collect();
    others.sort_by(|&a, &b| probability[b].total_cmp(&probability[a]));
    let asked = others.into_iter().take(AS_LIKELY.1).filter(|&i| may_be_written(i));
    let losses = asked.map(|i| (loss(setting, &Contest { winner: i, ..*contest }), i));
    let least = losses.min_by(|a, b| a.0.total_cmp(&b.0));
    least.filter(|(loss, _)| *loss <= WORTH).map(|(_, i)| i)
}

/// The expected share of the loss that the winner has where it is too large for the winner to be written: that would be a gamble.
pub fn gamble(setting: &Setting<'_>, contest: &Contest<'_, '_>) -> Option<f64> {
    Some(loss(setting, contest)).filter(|loss| *loss > WORTH)
}

/// The expected share of the loss that the winner has, on whichever of the fresh inputs it is largest; 0 where it has no rival.
fn loss(setting: &Setting<'_>, contest: &Contest<'_, '_>) -> f64 {
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
        return 0.0;
    }
    let (nothing, best) = (started(&pool[0].base), started(&pool[winner].base));
    let noise: Vec<f64> = pool[winner].base.whitener.models.iter().map(|m| m.noise_rms()).collect();
    [mirror_image, reversed, doubled]
        .into_iter()
        .filter_map(|change: Change| {
            let drive = changed(setting.data, change)?;
            expected_share(&nothing, (own, &best), &rivals, &drive, setting.substeps, &noise)
        })
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::fresh::tests::drive;
    use crate::model::{Model, Values};

    /// Runs a check on an oscillator with this cubic spring: without effects, and with each of these fitted.
    fn with_fits<T>(cube: f64, effects: &[&str], check: impl FnOnce(&Setting<'_>, &[Hypothesis<'_>]) -> T) -> T {
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
        let fitted = |id: &&str| {
            let found = screen(&none.base, &setting.original, &[], &evidence, &|m, _| m.id == *id);
            refit(&setting, &none, &found[0]).unwrap()
        };
        let fitted: Vec<_> = effects.iter().map(fitted).collect();
        let pool: Vec<_> = std::iter::once(none).chain(fitted).collect();
        check(&setting, &pool)
    }

    /// What `uncertain` says of a cubic spring that is fitted where there is this one, as the values of its strength.
    fn strengths_of(cube: f64) -> (f64, Vec<f64>) {
        with_fits(cube, &["cubic_stiffness"], |_, pool| {
            let h = &pool[1];
            let name = &h.effects[0].written.amplitudes[0].name;
            let values = uncertain(h).iter().map(|s| s.parameter(name).unwrap().value).collect();
            (h.base.values().parameters[name], values)
        })
    }

    #[test]
    fn of_sets_that_are_as_likely_the_one_that_goes_less_far_astray_is_written() {
        // Where the input is doubled a fifth power goes far beyond a cube, and a stop between the two.
        with_fits(2e4, &["cubic_stiffness", "quintic_stiffness", "gap_stop"], |setting, pool| {
            let with = |probability: &[f64], may_be_written: &dyn Fn(usize) -> bool| {
                let contest = Contest { pool, weighed: &[], probability, winner: 2 };
                (gamble(setting, &contest).is_some(), safest(setting, &contest, may_be_written))
            };
            let alike = [0.0, 0.33, 0.34, 0.33];
            assert_eq!(with(&alike, &|_| true), (true, Some(3)));
            assert_eq!(with(&alike, &|i| i != 3), (true, None), "the cube is a gamble, too");
            assert_eq!(with(&[0.0, 0.1, 0.7, 0.2], &|_| true), (false, None), "none is nearly as likely");
        });
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
}
