//! What a search taught of the simulation itself, so that it must be made once more: better parameters than those that the calibration found,
//! or an effect that the integration steps are too long for.
//!
//! Refits begin where the calibration ended and may leave its local minimum by a small effect that explains nothing; that effect would have the
//! whole gain for itself. Steps are chosen for the simulation without effects: a lag within a sampling period, a stop or an elastic contact asks
//! for shorter ones, and the set with the smallest error of integration would win and not the true one.

use rayon::prelude::*;

use super::fair::{explains_no_less, recalibrated};
use super::global::{MOST_SUBSTEPS, calm};
use crate::evidence::{Whitener, norm2};
use crate::model::base::Base;
use crate::model::hypothesis::{Hypothesis, Setting};

/// Sets, the likeliest first, that are asked.
const ASKED: usize = 3;
/// Log likelihood that better parameters must gain at least, and as a share of what the best set explains: what is far below that changes no
/// comparison.
const BETTER: (f64, f64) = (2.0, 0.05);
/// Log likelihood that the error of integration may cost.
const ERROR: f64 = 2.0;

/// Size of a derivative, over that with half as long steps, at which it is none.
const EXPLODED: f64 = 10.0;
/// Iterations of a fit that tells whether shorter steps ask for shorter ones yet.
const STIFFER: usize = 10;
/// Times that the likeliest sets take once more of what the whole search took.
const FITS: f64 = 0.5;

/// How far a search is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Done {
    /// Effects were fitted alone.
    Singles,
    /// All of it.
    Whole,
}

impl Done {
    /// How many times as long a whole search takes.
    fn whole(self) -> f64 {
        match self {
            Self::Singles => 3.0,
            Self::Whole => 1.0,
        }
    }
}

/// What is done otherwise in the next search.
pub struct Lesson<'d> {
    /// Integration steps in each sampling period.
    pub substeps: usize,
    /// The calibrated simulation.
    pub base: Base<'d>,
    /// Whether only the likeliest sets are fitted once more, for want of time.
    pub only_fits: bool,
    /// Whether only the steps change: the likeliest sets fitted with them tell whether the search was misled.
    pub steps_only: bool,
    /// For the user while it runs.
    pub doing: &'static str,
    /// For the user afterwards.
    pub note: String,
}

impl Lesson<'_> {
    /// For the user afterwards, where only the likeliest sets were fitted once more.
    pub fn fitted_note(&self) -> String {
        format!("the likeliest sets were fitted once more with {}", in_words(self.substeps))
    }
}

/// So many integration steps in words.
fn in_words(substeps: usize) -> String {
    format!("{substeps} integration steps in each sampling period, which the likeliest effects need")
}

/// What the sets taught that were fitted so far, in this setting of a search that `setting` began with; `None` where the next search would be the
/// same, or where there is no time for it (which is remembered, as is what a search left out whose time is up already).
pub fn lesson<'d>(
    setting: &Setting<'d>,
    judged: &Setting<'d>,
    none: &Hypothesis<'d>,
    pool: &[Hypothesis<'d>],
    done: Done,
) -> Option<Lesson<'d>> {
    let budget = setting.budget;
    if !budget.affords(0.0) {
        return None;
    }
    let mut order: Vec<&Hypothesis<'d>> = pool.iter().filter(|h| !h.effects.is_empty()).collect();
    order.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    order.truncate(ASKED);
    let explained = order.first()?.log_evidence - none.log_evidence;
    let better = order
        .iter()
        .filter_map(|h| returned(judged, none, h))
        .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))
        .filter(|b| b.log_likelihood - none.base.log_likelihood > BETTER.0.max(BETTER.1 * explained));
    let now = setting.substeps;
    let needed = needed(setting, &order, done);
    // Half of the time does not depend on the steps.
    let affordable = |steps: usize| budget.affords(done.whole() * (1 + steps) as f64 / (1 + now) as f64);
    let mut substeps = needed;
    while substeps > now && !affordable(substeps) {
        substeps = (substeps / 2).max(now);
    }
    // A part of the steps is not enough to tell sets apart; the likeliest of them can still be fitted with all.
    let only_fits = done == Done::Whole && better.is_none() && substeps < needed && budget.affords(FITS);
    if only_fits {
        substeps = needed;
    }
    let finer = substeps > now;
    if !finer && (better.is_none() || !affordable(now)) {
        if needed > now || better.is_some() {
            budget.not_again();
        }
        return None;
    }
    let steps = in_words(substeps);
    let parameters = "the first calibration had ended in a local minimum: beside an effect parameters were reached that fit better without it too, and the search was made once more from there";
    let (doing, note) = match (&better, finer) {
        (None, _) => ("searching once more with shorter steps", format!("the search was made once more with {steps}")),
        (Some(_), false) => ("searching once more from better parameters", parameters.to_owned()),
        (Some(_), true) => {
            ("searching once more from better parameters with shorter steps", format!("{parameters}, with {steps}"))
        }
    };
    let next = Setting { substeps, ..if only_fits { judged } else { setting }.clone() };
    let base = better.as_ref().unwrap_or(&none.base);
    let noise = (next.noise == judged.noise).then_some(&base.whitener);
    let base = recalibrated(&next, base, noise)?;
    Some(Lesson { substeps, base, only_fits, steps_only: better.is_none(), doing, note })
}

/// The simulation without effects, fitted from where its parameters are beside those of a set; `None` where that leaves a much larger plain error.
///
/// Alone parameters bend to the walk on which a small random force takes what integrates, and what they leave of it looks white; beside an effect that takes
/// the walk they stay where they belong, and the force shows in what the simulation leaves there.
fn returned<'d>(setting: &Setting<'d>, none: &Hypothesis<'d>, h: &Hypothesis<'d>) -> Option<Base<'d>> {
    let values = h.base.values();
    let fit = |noise: &Whitener| setting.fit(&setting.original, &values, Some(noise), 2, 20);
    let forced =
        || setting.noise_at(&setting.original, &values).filter(|noise| noise.is_driven() && !none.base.driven());
    let fits = [fit(&none.base.whitener), forced().and_then(|noise| fit(&noise))];
    let best = fits.into_iter().flatten().max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))?;
    explains_no_less(&best, &none.base).then_some(best)
}

/// Integration steps in each sampling period that the likeliest sets need. What steps are too long for is fitted as stiff as they bear: with those that it asks for
/// it may grow stiffer and ask for more, which would cost another search, and costs a fit here.
fn needed(setting: &Setting<'_>, sets: &[&Hypothesis<'_>], done: Done) -> usize {
    let asked = sets.iter().map(|h| enough(setting, h)).max().unwrap_or(setting.substeps);
    if done == Done::Whole || asked <= setting.substeps {
        return asked;
    }
    let finer = Setting { substeps: asked, ..setting.clone() };
    let stiffer = |h: &&Hypothesis<'_>| {
        let base = finer.fit(h.base.model.simulation(), &h.base.values(), Some(&h.base.whitener), 1, STIFFER)?;
        Some(enough(&finer, &finer.hypothesis(h.effects.clone(), base)))
    };
    sets.par_iter().filter_map(stiffer).max().map_or(asked, |more| more.max(asked))
}

/// Integration steps in each sampling period that a fitted set needs: as many as leave no error that could decide between two sets.
fn enough(setting: &Setting<'_>, h: &Hypothesis<'_>) -> usize {
    let now = h.base.model.substeps();
    let values = h.base.values();
    let predicted = |substeps: usize| {
        let m = h.base.model.with_substeps(substeps)?;
        m.predict(&m.theta(&values))
    };
    let most = MOST_SUBSTEPS.max(now);
    let Some(exact) = predicted(2 * most) else { return now };
    let wanted = [now, 2 * now, 4 * now].into_iter().map(|s| s.min(most)).find(|&s| {
        predicted(s).is_none_or(|p| {
            let off: Vec<f64> = p.iter().zip(&exact).map(|(a, b)| a - b).collect();
            0.5 * norm2(&h.base.whitener.apply(&setting.data.layout, &off)) < ERROR
        })
    });
    // What chatters shows the right outputs, and derivatives that no fit can follow.
    calm(&h.base.model, &values, wanted.unwrap_or(most), EXPLODED)
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;
    use hysid_signal::{Channel, Clock, Recording};

    use super::*;
    use crate::budget::Budget;
    use crate::data::DataSet;
    use crate::model::Values;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::calibrated;
    use crate::oscillator::{normal, rms};
    use crate::search::fitting::refit;
    use crate::search::screen::screen;

    fn data(text: &str, u: Vec<f64>, y: Vec<f64>, period_s: f64) -> (Simulation, DataSet) {
        let original = Simulation::parse(text, "test.sim.toml").unwrap();
        let channels = vec![Channel { name: "u_V".into(), samples: u }, Channel { name: "y_m".into(), samples: y }];
        let recording = Recording::new("est.csv", Clock { start_s: 0.0, period_s }, channels).unwrap();
        let data = DataSet::new(&original, &[recording], 3).unwrap();
        (original, data)
    }

    /// The simulation with one effect of the catalogue, fitted.
    fn with<'d>(setting: &Setting<'d>, none: &Hypothesis<'d>, id: &str) -> Hypothesis<'d> {
        let found = screen(&none.base, &setting.original, &[], &none.base.evidence(), &|m, _| m.id == id);
        refit(setting, none, &found[0]).unwrap()
    }

    /// Fringes, counted one too many: an offset that explains nothing stands beside the right number of them.
    #[test]
    fn parameters_reached_beside_an_effect_are_tried_without_it() {
        let u: Vec<f64> = (0..600).map(|i| 0.05 * f64::from(i)).collect();
        let mut random = normal(4);
        let mut y: Vec<f64> = u.iter().map(|u| u.sin()).collect();
        let noise = 0.05 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * random());
        let fringes = "[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_V\"\n[parameters]\nf = { value = 1.6, min = 0.1, max = 9.0 }\n\
                       [outputs]\ny_m = \"sin(f*u)\"\n";
        let (original, data) = data(fringes, u, y, 0.01);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        assert!((none.base.values().parameters["f"] - 1.0).abs() > 0.1, "no local minimum");
        let offset = with(&setting, &none, "output_offset");
        let told = |h: Hypothesis<'_>| {
            let effects = h.effects.clone();
            let right = Values { parameters: [("f".to_owned(), 1.001)].into(), ..Values::default() };
            let base = setting.fit(h.base.model.simulation(), &right, None, 2, 20).unwrap();
            let pool = [setting.hypothesis(effects, base)];
            lesson(&setting, &setting, &none, &pool, Done::Whole)
        };
        let lesson_learned = told(offset).unwrap();
        assert!((lesson_learned.base.values().parameters["f"] - 1.0).abs() < 0.01);
        assert_eq!((lesson_learned.substeps, lesson_learned.only_fits), (setting.substeps, false));
        // From where the simulation stands there is nothing to learn.
        let offset = [with(&setting, &none, "output_offset")];
        assert!(lesson(&setting, &setting, &none, &offset, Done::Whole).is_none());
        assert!(!budget.unfinished());
    }

    /// A carriage that runs with its input, on which a small random force walks, and so much of the input that was not recorded: what parameters that were
    /// reached beside an offset of the input gain without it.
    fn gained_beside_an_offset(step: f64, offset: f64, seed: u64) -> f64 {
        let mut random = normal(seed);
        let u: Vec<f64> = (0..1500).map(|i| 1.0 + 0.3 * (0.04 * f64::from(i)).sin()).collect();
        let mut x = 0.0;
        let y = (u.windows(2).map(|u| 0.5 * (u[0] + u[1])).chain([0.0]))
            .map(|mean| {
                let shown = x + 0.05 * random();
                x += 0.1 * (mean + offset) + step * random();
                shown
            })
            .collect();
        let text = "[time]\nperiod_s = 0.1\n[inputs]\nu = \"u_V\"\n[parameters]\ng = { value = 1.2, min = 0.1, max = 9.0 }\n[states]\n\
                    x = { derivative = \"g*u\", initial = \"free\" }\n[outputs]\ny_m = \"x\"\n";
        let (original, data) = data(text, u, y, 0.1);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::Coloured, &budget);
        let returned = returned(&setting, &none, &with(&setting, &none, "input_offset")).unwrap();
        returned.log_likelihood - none.base.log_likelihood
    }

    #[test]
    fn beside_an_effect_a_small_force_shows() {
        let gained = gained_beside_an_offset(4e-4, 0.0, 88);
        assert!(gained > 1.0, "{gained}");
        for offset in [0.0, 0.01] {
            let gained = gained_beside_an_offset(0.0, offset, 88);
            assert!(gained < 0.1, "{gained} by {offset}");
        }
    }

    /// A sensor that follows within an eighth of a sampling period, behind a store that needs many: one step follows the store only.
    #[test]
    fn a_lag_within_a_sampling_period_asks_for_shorter_steps() {
        let mut random = normal(5);
        let u: Vec<f64> = (0..400).map(|_| random()).collect();
        let (mut h, mut s, fine) = (0.0, 0.0, 400);
        let y = (0..u.len())
            .map(|i| {
                let shown = s + 1e-4 * random();
                for k in 0..fine {
                    let part = f64::from(k) / f64::from(fine);
                    let inflow = u[i] + (u[(i + 1).min(u.len() - 1)] - u[i]) * part;
                    h += (inflow - h) / 12.0 / f64::from(fine);
                    s += (h - s) / 0.125 / f64::from(fine);
                }
                shown
            })
            .collect();
        let store = "[time]\nperiod_s = 1.0\n[inputs]\nu = \"u_V\"\n[parameters]\nT = { value = 12.0, min = 1.0, max = 99.0 }\n\
                     [states]\nh = { derivative = \"(u - h)/T\", initial = 0.0 }\n[outputs]\ny_m = \"h\"\n";
        let (original, data) = data(store, u, y, 1.0);
        let budget = Budget::new(&|_| false);
        let (mut setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        setting.substeps = 1;
        let lag = with(&setting, &none, "sensor_lag");
        assert_eq!(
            enough(&setting, &setting.hypothesis(Vec::new(), setting.further(&none.base, None, 1, 5).unwrap())),
            1
        );
        let pool = [lag];
        let learned = lesson(&setting, &setting, &none, &pool, Done::Singles).unwrap();
        assert!(learned.substeps > 1 && !learned.only_fits, "{}", learned.note);
        // With those the same law follows the recording far better, and nearer to the true time constant.
        let tau = |h: &Hypothesis<'_>| (h.base.values().parameters["tau"] - 0.125).abs();
        let finely = Setting { substeps: learned.substeps, ..setting.clone() };
        let start = finely.hypothesis(Vec::new(), learned.base);
        let after = with(&finely, &start, "sensor_lag");
        assert!(after.base.log_likelihood > pool[0].base.log_likelihood + 5.0 * ERROR && tau(&after) < tau(&pool[0]));
        // It asks for no shorter ones then: what they would have asked for is asked for at once.
        assert_eq!(enough(&finely, &after), learned.substeps);
        // Where there is no time for the search, the likeliest sets are fitted once more at its end.
        let late = |share: f64| share < 0.4;
        let budget = Budget::new(&late);
        let hurried = Setting { budget: &budget, ..setting.clone() };
        assert!(lesson(&hurried, &hurried, &none, &pool, Done::Whole).is_some_and(|l| l.only_fits));
        assert!(!budget.unfinished());
    }
}
