//! Parameters that are not constant: a parameter or an input gain that wanders, that oscillates at a frequency of its own, or that follows a recorded input or a
//! state.
//!
//! No feature of the catalogue need resemble what such a parameter does, and a noise model that was fitted to the residual takes it for noise. So each
//! modulation is judged by its evidence with a noise model of its own, under the noise of the fit and, where that is coloured, from white
//! noise. A walk pays for what the recording settles of it ([`Wander`]); an oscillation pays for two amplitudes, and for the lines and parameters among
//! which it was found; what follows a signal for one, along a curve for two, and for the signals and parameters.

pub mod course;
pub mod followed;
mod likely;
pub mod modulation;
pub mod written;

use hysid_linalg::dot;
use rayon::prelude::*;

use super::MOST_TERMS;
use super::regress::regress;
use super::view::View;
use crate::evidence::{Wander, Whitener, norm2};
use crate::file::TermRecord;
use crate::mechanism::SLOW;
use crate::model::Count;
use crate::model::base::{Base, MAX_AR, NoiseKind, log_likelihood, spared};
use crate::text::number;
use course::{COURSES, Course, Series, Time};
use followed::{Signal, Way};
use likely::{Candidate, likely_lines, likely_to_follow, likely_walks, pairs};
use modulation::{Modulated, modulated};

/// Rounds of amplitudes and noise by turns, and the log likelihood below which another one is not worth it.
const ROUNDS: (usize, f64) = (3, 0.1);

/// What varies, and how.
#[derive(Debug, Clone)]
pub struct Variation {
    /// The parameter's symbol, or that of an input whose gain varies.
    pub symbol: String,
    /// Whether it is an input.
    pub input: bool,
    /// How it varies.
    pub course: Course,
    /// The courses over time, as factors of the parameter's own value, for an amplitude of one.
    pub texts: Vec<String>,
    /// Their amplitudes.
    pub amplitudes: Vec<f64>,
    /// Standard deviation of the modulation over the recording.
    pub size: f64,
}

/// A parameter that varies, on the tangent of a fitted simulation.
pub struct LikelyVariation {
    /// What varies, and how.
    pub what: Variation,
    /// The responses to its courses.
    pub columns: Vec<Vec<f64>>,
    /// What the amplitudes' scale weighs in a regression of whitened rows.
    pub precision: f64,
    /// Share of the residual's power that each explains.
    pub err: Vec<f64>,
    /// Length of the recording, in seconds.
    pub length_s: f64,
    /// The noise of what is left.
    pub left: Whitener,
    /// Log evidence that it adds.
    pub gain: f64,
    /// What of it is paid for the choice among parameters, lines and inputs.
    pub choice: f64,
    /// What it would be more if the coefficients that it spares the noise model counted, as they do for a set of effects.
    spares: f64,
}

impl LikelyVariation {
    /// The log evidence beside a set with an effect that changes in time too: that what is slow is no noise neither has to show. What follows an input is
    /// no noise at all, and what it spares the noise model counts as for an effect; a walk and a line may be a part of the noise that the set leaves.
    pub fn gain_as_a_rival(&self) -> f64 {
        self.gain
            + match self.what.course {
                Course::Walk(_) => SLOW,
                Course::Line(_) => 0.0,
                Course::Follows(_) => self.spares,
            }
    }
}

impl Variation {
    /// In words.
    pub fn words(&self) -> String {
        let what = if self.input { "the gain of the input" } else { "the parameter" };
        let how = match &self.course {
            Course::Follows(signal) => signal.words(self.amplitudes.first().copied().unwrap_or(0.0)),
            Course::Walk(_) => {
                format!("wanders slowly in time, by {} % of its value (rms)", number(100.0 * self.size))
            }
            Course::Line(f) => {
                let share = 100.0 * norm2(&self.amplitudes).sqrt();
                format!("oscillates in time at {} Hz, by {} % of its value", number(*f), number(share))
            }
        };
        format!("{what} `{}` {how}", self.symbol)
    }

    /// Its place.
    pub fn slot(&self) -> String {
        format!("{}:{}", if self.input { "input" } else { "parameter" }, self.symbol)
    }

    /// Its courses as terms, the one that explains most first, with these shares of the residual's power.
    pub fn terms(&self, err: &[f64]) -> Vec<TermRecord> {
        let term = |((text, &coefficient), &err)| TermRecord {
            term: format!("{}*{text}", self.symbol),
            slot: self.slot(),
            coefficient,
            err,
        };
        let mut terms: Vec<TermRecord> = self.texts.iter().zip(&self.amplitudes).zip(err).map(term).collect();
        terms.sort_by(|a, b| b.err.total_cmp(&a.err));
        terms.truncate(MOST_TERMS);
        terms
    }
}

/// The parameter that varies most likely, judged with a noise model of its own; none where nothing can be modulated. Behind a walk, which cannot be written,
/// the likeliest that does not walk; behind one that follows a signal the other ways in which it may: which one is right shows once it stands in the
/// equations.
pub fn varying(base: &Base<'_>, kind: NoiseKind, noises: &[Whitener]) -> Vec<LikelyVariation> {
    let mut all = all(base, kind, noises).unwrap_or_default();
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut kept: Vec<LikelyVariation> = Vec::new();
    for other in all {
        let stands_behind = |one: &LikelyVariation| match (&one.what.course, &other.what.course) {
            (Course::Walk(_), course) => !matches!(course, Course::Walk(_)),
            (Course::Follows(f), Course::Follows(g)) => {
                one.what.symbol == other.what.symbol && f.quantity.symbol == g.quantity.symbol && f.way != g.way
            }
            _ => false,
        };
        if kept.iter().all(stands_behind) {
            kept.push(other);
        }
    }
    kept
}

/// The parameters that may vary one way or another; `None` where nothing can be modulated.
fn all(base: &Base<'_>, kind: NoiseKind, noises: &[Whitener]) -> Option<Vec<LikelyVariation>> {
    let all = modulated(base);
    let time = Time::of(base)?;
    let data = base.model.data().with_still_inputs(all.len());
    let mut machine = Modulated::new(base, &all, &data)?;
    let symbols = machine.keep_of_motion(all);
    if symbols.is_empty() {
        return None;
    }
    let courses = time.courses(&Course::Walk(1.0));
    let requests: Vec<(usize, Series)> =
        (0..symbols.len()).flat_map(|i| courses.iter().map(move |w| (i, w.clone()))).collect();
    let of_walks: Vec<Option<Vec<Vec<f64>>>> =
        machine.responses(&requests).chunks(COURSES).map(|some| some.iter().cloned().collect()).collect();
    let signals = Signal::all(base);
    let pairs = pairs(base.model.simulation(), &machine, &symbols, &signals);
    let none = kind.share() * View::new(base, &base.whitener).log_likelihood(base);
    let mut all: Vec<LikelyVariation> = Vec::new();
    for noise in noises {
        let view = View::new(base, noise);
        let mut found = likely_walks(&view, kind, &of_walks);
        found.extend(likely_lines(base, &view, &machine, &time, symbols.len()));
        found.extend(likely_to_follow(&view, &pairs));
        let among = (symbols.as_slice(), Way::ALL.len() * pairs.len());
        let judge = |candidate| judged(base, kind, noise, among, &time, candidate, none);
        all.par_extend(found.into_par_iter().filter_map(judge));
    }
    Some(all)
}

/// A candidate with a noise model of its own, beside the log likelihood of `none`. It is one of so many symbols, and pairs of a symbol and what it follows.
fn judged(
    base: &Base<'_>,
    kind: NoiseKind,
    noise: &Whitener,
    (symbols, pairs): (&[String], usize),
    time: &Time,
    candidate: Candidate,
    none: f64,
) -> Option<LikelyVariation> {
    let Candidate { symbol, mut course, columns, .. } = candidate;
    let data = base.model.data();
    let layout = &data.layout;
    let share = kind.share();
    let order = if kind == NoiseKind::Coloured { MAX_AR } else { 0 };
    let picked: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let mut left = noise.clone();
    if matches!(course, Course::Walk(_)) && left.order() == 0 {
        // White noise of the size of the whole residual would leave little for the walk to explain.
        let (_, after) = regress(base, &picked, &left, None, 0.0);
        left = layout.white_noise(&after);
    }
    let mut reached = f64::NEG_INFINITY;
    for _ in 0..ROUNDS.0 {
        if let Course::Walk(scale) = &mut course {
            let view = View::new(base, &left);
            *scale = Wander::new(&view.of(&columns), &view.r, share).mean_gain().1;
        }
        let (_, after) = regress(base, &picked, &left, None, course.precision(share));
        left = layout.fit_noise(&after, order, &base.paths);
        let likelihood = left.log_likelihood(layout, &after);
        if likelihood < reached + ROUNDS.1 {
            break;
        }
        reached = likelihood;
    }
    let (amplitudes, after) = regress(base, &picked, &left, None, course.precision(share));
    let view = View::new(base, &left);
    let white = view.of(&columns);
    let among = (symbols.len() as f64).ln();
    let free = |lasting: usize| {
        let price = kind.price(base.model.count().lasting, Count { lasting, passing: 0 }, data.rows());
        (share * (log_likelihood(data, &left, &after) + spared(data, &left, &base.whitener)), price)
    };
    let ((likelihood, price), choice) = match course {
        Course::Walk(_) => {
            let gain = Wander::new(&white, &view.r, share).mean_gain().0;
            ((share * view.log_likelihood(base) + gain, SLOW), among)
        }
        Course::Line(_) => (free(2), (time.samples().max(2) as f64).ln() + among),
        Course::Follows(_) => (free(amplitudes.len()), (pairs.max(1) as f64).ln()),
    };
    let credited = |noise: &Whitener| share * spared(data, noise, &base.whitener);
    let total = norm2(&view.r).max(f64::MIN_POSITIVE);
    let err = white.iter().zip(&amplitudes).map(|(c, a)| a * dot(c, &view.r) / total).collect();
    let symbol = symbols.get(symbol)?.clone();
    let input = base.model.simulation().inputs.iter().any(|u| u.symbol == symbol);
    let (texts, size) = (time.texts(&course), time.deviation(&course, &amplitudes));
    Some(LikelyVariation {
        precision: course.precision(share),
        what: Variation { symbol, input, course, texts, amplitudes, size },
        columns,
        err,
        length_s: time.length,
        gain: likelihood - none - price - choice,
        choice,
        spares: credited(&base.whitener) - credited(&left),
        left,
    })
}

#[cfg(test)]
pub(crate) mod tests;
