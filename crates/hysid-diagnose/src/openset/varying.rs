//! Parameters that are not constant: a parameter or an input gain that wanders, that oscillates at a frequency of its own, or that follows a recorded input or a
//! state.
//!
//! No feature of the catalogue need resemble what such a parameter does, and a noise model that was fitted to the residual takes it for noise. So each
//! modulation is judged by its evidence with a noise model of its own, under the noise of the fit and, where that is coloured, from white
//! noise. A walk pays for what the recording settles of it ([`Wander`]); an oscillation pays for two amplitudes, and for the lines and parameters among
//! which it was found; what follows a signal for one, along a curve for two, and for the signals and parameters.

use hysid_linalg::dot;
use hysid_plant::Simulation;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::MOST_TERMS;
use super::course::{COURSES, Course, Series, Time};
use super::followed::{Signal, Way};
use super::modulation::{Modulated, modulated};
use super::regress::regress;
use super::view::View;
use crate::evidence::{Wander, Whitener, lines, norm2};
use crate::file::TermRecord;
use crate::mechanism::SLOW;
use crate::model::Count;
use crate::model::base::{Base, MAX_AR, NoiseKind, log_likelihood, spared};
use crate::random::generator;
use crate::text::number;

/// Lines of each parameter whose responses are taken, and of these how many are judged with a noise model of their own.
const LINES: (usize, usize) = (4, 2);
/// Scores of noise against which those of the residual are held, and the stream that it is drawn from.
const NOISES: usize = 7;
const STREAM: u64 = 0x7 << 56;
/// Walks, and parameters that follow a signal, that are judged with a noise model of their own.
const WALKS: usize = 2;
const FOLLOWING: usize = 2;
/// Rounds of amplitudes and noise by turns.
const ROUNDS: usize = 3;

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
pub struct Varying {
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

impl Varying {
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

/// A modulation before it is judged with a noise model of its own.
struct Candidate {
    symbol: usize,
    course: Course,
    columns: Vec<Vec<f64>>,
    gain: f64,
}

/// The parameter that varies most likely, judged with a noise model of its own; none where nothing can be modulated. Behind a walk, which cannot be written,
/// the likeliest that does not walk; behind one that follows a signal the other ways in which it may: which one is right shows once it stands in the
/// equations.
pub fn varying(base: &Base<'_>, kind: NoiseKind, noises: &[Whitener]) -> Vec<Varying> {
    let mut all = all(base, kind, noises).unwrap_or_default();
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut kept: Vec<Varying> = Vec::new();
    for other in all {
        let stands_behind = |one: &Varying| match (&one.what.course, &other.what.course) {
            (Course::Walk(_), course) => !matches!(course, Course::Walk(_)),
            (Course::Follows(f), Course::Follows(g)) => {
                one.what.symbol == other.what.symbol && f.symbol == g.symbol && f.way != g.way
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
fn all(base: &Base<'_>, kind: NoiseKind, noises: &[Whitener]) -> Option<Vec<Varying>> {
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
    let mut all: Vec<Varying> = Vec::new();
    for noise in noises {
        let view = View::new(base, noise);
        let mut found = likely_walks(&view, kind, &of_walks);
        found.extend(likely_lines(base, &view, &machine, &time, symbols.len()));
        found.extend(likely_to_follow(&view, &pairs));
        let among = (symbols.as_slice(), Way::ALL.len() * pairs.len());
        all.extend(found.into_iter().filter_map(|candidate| judged(base, kind, noise, among, &time, candidate, none)));
    }
    Some(all)
}

/// The parameters whose walk explains most under this noise.
fn likely_walks(view: &View<'_>, kind: NoiseKind, of_walks: &[Option<Vec<Vec<f64>>>]) -> Vec<Candidate> {
    let variance = norm2(&view.r) / view.r.len().max(1) as f64;
    let weight = kind.share() / variance.max(f64::MIN_POSITIVE);
    let one = |(symbol, columns): (usize, &Option<Vec<Vec<f64>>>)| {
        let columns = columns.as_ref()?;
        let (gain, scale) = Wander::new(&view.of(columns), &view.r, weight).mean_gain();
        Some(Candidate { symbol, course: Course::Walk(scale), columns: columns.clone(), gain })
    };
    let mut found: Vec<Candidate> = of_walks.iter().enumerate().filter_map(one).collect();
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found.truncate(WALKS);
    found
}

/// A parameter that may follow a signal, with the responses to the signal's courses.
struct Pair<'s> {
    symbol: usize,
    signal: &'s Signal,
    responses: [Vec<f64>; 2],
}

impl Pair<'_> {
    /// The responses to what is followed this way.
    fn columns(&self, way: Way) -> Vec<Vec<f64>> {
        self.signal.responses(way, [&self.responses[0], &self.responses[1]])
    }
}

/// Every symbol with every signal that it may follow.
fn pairs<'s>(
    simulation: &Simulation,
    machine: &Modulated<'_>,
    symbols: &[String],
    signals: &'s [Signal],
) -> Vec<Pair<'s>> {
    let pairs = signals.iter().flat_map(|s| (0..symbols.len()).map(move |i| (i, s)));
    let pairs: Vec<(usize, &Signal)> = pairs.filter(|(i, s)| s.leads(simulation, &symbols[*i])).collect();
    let courses = |(i, s): &(usize, &Signal)| s.courses.clone().map(|c| (*i, c));
    let requests: Vec<(usize, Series)> = pairs.iter().flat_map(courses).collect();
    let mut responses = machine.responses(&requests).into_iter();
    let of = |(symbol, signal): (usize, &'s Signal)| {
        let (one, two) = (responses.next()?, responses.next()?);
        Some(Pair { symbol, signal, responses: [one?, two?] })
    };
    pairs.into_iter().filter_map(of).collect()
}

/// The parameters that explain most under this noise where they follow a signal.
fn likely_to_follow(view: &View<'_>, pairs: &[Pair<'_>]) -> Vec<Candidate> {
    // The signal itself or its square is a curve, too.
    let gain = |pair: &Pair<'_>| view.free_gain(&pair.columns(Way::Curved));
    let mut gains: Vec<(f64, &Pair<'_>)> = pairs.par_iter().map(|pair| (gain(pair), pair)).collect();
    gains.sort_by(|a, b| b.0.total_cmp(&a.0));
    gains.truncate(FOLLOWING);
    let candidate = |(gain, pair): (f64, &Pair<'_>), way: Way| {
        let course = Course::Follows(pair.signal.followed(way));
        Candidate { symbol: pair.symbol, course, columns: pair.columns(way), gain }
    };
    gains.into_iter().flat_map(|likely| Way::ALL.map(|way| candidate(likely, way))).collect()
}

/// The lines of the parameters' scores that explain most under this noise.
fn likely_lines(
    base: &Base<'_>,
    view: &View<'_>,
    machine: &Modulated<'_>,
    time: &Time,
    symbols: usize,
) -> Vec<Candidate> {
    let period_s = base.model.data().period_s;
    let mut rng = generator(0, STREAM);
    let white = (0..NOISES).map(|_| (0..view.r.len()).map(|_| StandardNormal.sample(&mut rng)).collect::<Vec<f64>>());
    let all: Vec<Vec<f64>> = std::iter::once(view.r.clone()).chain(white).collect();
    let Some(scores) = machine.scores(view.noise, &all) else { return Vec::new() };
    let mut wanted: Vec<(usize, Course)> = Vec::new();
    for symbol in 0..symbols {
        let series: Option<Series> = scores.iter().map(|s| time.together(s.get(symbol)?, period_s)).collect();
        let Some((score, noises)) = series.as_ref().and_then(|s| s.split_first()) else { continue };
        wanted.extend(lines(score, noises, LINES.0).iter().map(|l| (symbol, Course::Line(l.cycles / period_s))));
    }
    let requests: Vec<(usize, Series)> =
        wanted.iter().flat_map(|(symbol, line)| time.courses(line).into_iter().map(move |c| (*symbol, c))).collect();
    let responses = machine.responses(&requests);
    let mut found: Vec<Candidate> = wanted
        .iter()
        .zip(responses.chunks(2))
        .filter_map(|((symbol, course), pair)| {
            let columns: Vec<Vec<f64>> = pair.iter().cloned().collect::<Option<_>>()?;
            let (symbol, course) = (*symbol, course.clone());
            Some(Candidate { symbol, course, gain: view.free_gain(&columns), columns })
        })
        .collect();
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found.truncate(LINES.1);
    found
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
) -> Option<Varying> {
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
        left = layout.fit_noise(&after, 0, &[]);
    }
    for _ in 0..ROUNDS {
        if let Course::Walk(scale) = &mut course {
            let view = View::new(base, &left);
            *scale = Wander::new(&view.of(&columns), &view.r, share).mean_gain().1;
        }
        let (_, after) = regress(base, &picked, &left, None, course.precision(share));
        left = layout.fit_noise(&after, order, &base.paths);
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
    Some(Varying {
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
