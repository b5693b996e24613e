//! Which parameters may vary, and how, on the tangent and under a given noise: walks, lines of the scores' spectra, signals that are followed.

use hysid_plant::Simulation;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::course::{Course, Series, Time};
use super::followed::{Signal, Way};
use super::modulation::Modulated;
use crate::evidence::{Wander, lines, norm2};
use crate::model::base::{Base, NoiseKind};
use crate::openset::view::View;
use crate::random::generator;

/// Lines of each parameter whose responses are taken, and of these how many are judged with a noise model of their own.
const LINES: (usize, usize) = (4, 2);
/// Scores of noise against which those of the residual are held, and the stream that it is drawn from.
const NOISES: usize = 7;
const STREAM: u64 = 0x7 << 56;
/// Walks, and parameters that follow a signal, that are judged with a noise model of their own.
const WALKS: usize = 2;
const FOLLOWING: usize = 2;

/// A modulation before it is judged with a noise model of its own.
pub struct Candidate {
    /// The number of its symbol.
    pub symbol: usize,
    /// How it varies.
    pub course: Course,
    /// The responses to the courses.
    pub columns: Vec<Vec<f64>>,
    gain: f64,
}

/// The parameters whose walk explains most under this noise.
pub fn likely_walks(view: &View<'_>, kind: NoiseKind, of_walks: &[Option<Vec<Vec<f64>>>]) -> Vec<Candidate> {
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
pub struct Pair<'s> {
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
pub fn pairs<'s>(
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
pub fn likely_to_follow(view: &View<'_>, pairs: &[Pair<'_>]) -> Vec<Candidate> {
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
pub fn likely_lines(
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
