//! The share of the force and the colours of both noises, by likelihood.
//!
//! The share is searched over decades by steps that shrink, from the best of the pole before; scales are profiled.

use std::sync::Arc;

use super::{Driven, differenced, first_scale};
use crate::evidence::projector::norm2;
use crate::evidence::response::{Colours, Course, Filter, ForcePath, Moved};

/// Poles of a coloured noise's autoregression: samples of memory double from one to the next.
const POLES: [f64; 4] = [0.5, 0.75, 0.88, 0.94];
/// Decades between the first guesses of the share of the force, and where the search ends.
const DECADES: (f64, f64) = (1.0, 0.25);
/// The same between guesses of the memory of the sensor's noise.
const MEMORY: f64 = 0.3;
/// Log likelihood by which a force may trail another model before its colour, or its course, is not asked for.
const HOPELESS: f64 = 150.0;
/// Log likelihood that the way from row to row gains at the share by the mean one or a tenth of it, before it is looked into.
const MATTERS: f64 = 0.5;
/// Decades of the share of the force in the output's power that are searched.
const RANGE: (f64, f64) = (-3.0, 9.0);
/// Shares of a force, in the power of the sensor's noise, that are tried before any other where nothing else speaks for one.
const HINTS: [f64; 2] = [0.03, 0.5];
/// Rows of the longest stretch that a scale of the response is taken from.
const SCALE_ROWS: usize = 4000;

/// A point of the search: where it is, the log likelihood there, and what comes with it.
pub(in crate::evidence) type Point<T> = (f64, f64, T);

/// The best share of a force of some colours: its decade, log likelihood and the standard deviation of the sensor's innovations.
#[derive(Clone, Copy)]
struct Found {
    decade: f64,
    likelihood: f64,
    sigma: f64,
    colours: Colours,
}

impl Found {
    /// Its likelihood less a price for each coefficient.
    fn score(&self, price: f64) -> f64 {
        self.likelihood - price * self.colours.coefficients() as f64
    }
}

/// One way of a force to stretches of a residual: the mean one, or its course from row to row.
#[derive(Clone, Copy)]
struct Way<'a> {
    path: &'a ForcePath,
    course: Option<&'a Arc<Course>>,
    stretches: &'a [&'a [f64]],
    /// Rows of the longest stretch.
    rows: usize,
    /// The output's variance for a white force of unit variance.
    white: f64,
}

impl Driven {
    /// The process noise of these stretches of one residual by this way, with its log likelihood; colours where they pay `price` for each coefficient,
    /// looked for where a white one comes near the likelihood `most` of another model. The `course` from row to row is asked for where the best by the mean way comes
    /// near it.
    pub fn fit(
        path: &ForcePath,
        course: impl FnOnce() -> Option<Arc<Course>>,
        stretches: &[&[f64]],
        price: f64,
        most: f64,
    ) -> Option<(Self, f64)> {
        let mean = Way::mean(path, stretches)?;
        let found = mean.best(price, most, 0.0)?;
        let course = if found.likelihood < most - HOPELESS { None } else { course() };
        let along = course.as_ref().and_then(|course| {
            let way = Way { course: Some(course), ..mean };
            // Where the way matters, the share and the colours by the mean one do better along it already, or a smaller share: what shows much here and there
            // the mean way takes for much everywhere.
            let at = way.likelihood(found.colours)?;
            let likely = |decade: f64| at(decade).is_some_and(|(here, _)| here > found.likelihood + MATTERS);
            if !likely(found.decade) && !likely(found.decade - DECADES.0) {
                return None;
            }
            let along = way.best(price, most, found.decade)?;
            (along.likelihood > way.only_unequal(along.colours)?).then_some((way, along))
        });
        let (way, found) = along.filter(|(_, along)| along.score(price) > found.score(price)).unwrap_or((mean, found));
        Some((way.noise(&found)?, found.likelihood))
    }

    /// Whether a little of a white force is likelier than the likelihood `most` of a model without one.
    pub fn hinted(path: &ForcePath, stretches: &[&[f64]], most: f64) -> bool {
        let way = Way::mean(path, stretches);
        let likelihood = way.as_ref().and_then(|way| way.likelihood(Colours::WHITE));
        likelihood.is_some_and(|at| HINTS.into_iter().any(|share| at(share.log10()).is_some_and(|(l, _)| l > most)))
    }
}

impl<'a> Way<'a> {
    /// The mean way; `None` where nothing finite passes.
    fn mean(path: &'a ForcePath, stretches: &'a [&'a [f64]]) -> Option<Self> {
        let rows = stretches.iter().map(|s| s.len()).max()?;
        Some(Self { path, course: None, stretches, rows, white: unit(path, 0.0, rows)? })
    }

    /// The output's variance for a force of unit variance and this pole; `None` where nothing finite passes.
    fn unit(&self, pole: f64) -> Option<f64> {
        if pole == 0.0 { Some(self.white) } else { unit(self.path, pole, self.rows) }
    }

    /// The stretches, each less what the sensor's noise before tells of it.
    fn differenced(&self, colours: Colours) -> Vec<Vec<f64>> {
        self.stretches.iter().map(|e| differenced(e, colours.sensor).into_owned()).collect()
    }

    /// Log likelihood and standard deviation of the sensor's innovations, from these for a sensor of unit variance; `None` where they are not finite.
    fn profiled(&self, squares: f64, log: f64, colours: Colours) -> Option<(f64, f64)> {
        let rows = self.stretches.iter().map(|s| s.len()).sum::<usize>() as f64;
        let variance = squares / rows;
        let first = self.stretches.len() as f64 * first_scale(colours.sensor).ln();
        let finite = variance > 0.0 && variance.is_finite();
        finite.then(|| (-0.5 * rows * (1.0 + variance.ln()) - log + first, variance.sqrt()))
    }

    /// The same by the decade of the share of the force, for these colours.
    fn likelihood(&self, colours: Colours) -> Option<impl Fn(f64) -> Option<(f64, f64)>> {
        let unit = self.unit(colours.force)?;
        let stretches = self.differenced(colours);
        let moved = match self.course {
            Some(course) => Some(Moved::new(course, colours, self.stretches)?),
            None => None,
        };
        Some(move |decade: f64| {
            let variance = 10f64.powf(decade) / unit;
            let (squares, log) = match &moved {
                Some(moved) => {
                    moved.innovations(variance, &stretches).map(|(squares, log)| (squares.iter().sum(), log))?
                }
                None => Filter::new(self.path, colours, variance, self.rows)?.innovations(&stretches),
            };
            self.profiled(squares, log, colours)
        })
    }

    /// The highest log likelihood of noise that has the sizes which a force would give it along its course, and no memory: a sensor's noise that grows with its
    /// reading is no force.
    fn only_unequal(&self, colours: Colours) -> Option<f64> {
        let unit = self.unit(colours.force)?;
        let spread = Moved::new(self.course?, colours, self.stretches)?.spread();
        let stretches = self.differenced(colours);
        let at = |decade: f64| {
            let share = 10f64.powf(decade) / unit;
            let (mut squares, mut log) = (0.0, 0.0);
            for (e, spread) in stretches.iter().flatten().zip(spread.iter().flatten()) {
                let variance = 1.0 + share * spread;
                squares += e * e / variance;
                log += 0.5 * variance.ln();
            }
            Some((self.profiled(squares, log, colours)?.0, ()))
        };
        search((0.0, DECADES.0), at).map(|(_, likelihood, ())| likelihood)
    }

    /// The best share of a force of these colours, from a decade on by steps that shrink.
    fn share(&self, colours: Colours, from: (f64, f64)) -> Option<Found> {
        let (decade, likelihood, sigma) = search(from, self.likelihood(colours)?)?;
        Some(Found { decade, likelihood, sigma, colours })
    }

    /// The best noise of one of the colours of [`POLES`], the next longer memory while that is likelier.
    fn longer(&self, white: &Found, of: impl Fn(f64) -> Colours) -> Option<Found> {
        let mut best: Option<Found> = None;
        for pole in POLES {
            let from = best.as_ref().map_or(white.decade, |b| b.decade);
            let Some(found) = self.share(of(pole), (from, 0.5 * DECADES.0)) else { break };
            if best.as_ref().is_some_and(|b| found.likelihood < b.likelihood) {
                break;
            }
            best = Some(found);
        }
        best
    }

    /// The likeliest noise, each coefficient at a price, from this decade of a white force's share.
    fn best(&self, price: f64, most: f64, decade: f64) -> Option<Found> {
        let white = self.share(Colours::WHITE, (decade, DECADES.0))?;
        let near = |found: &Found| found.likelihood >= most - HOPELESS;
        let force = if near(&white) { self.longer(&white, |force| Colours { force, sensor: 0.0 }) } else { None };
        let remembers = |sensor: f64| Colours { force: 0.0, sensor };
        let at = |sensor: f64| Some(self.likelihood(remembers(sensor))?(white.decade)?.0);
        let likely = at(POLES[0]).is_some_and(|likelihood| likelihood > white.likelihood);
        let sensor = if likely { self.longer(&white, remembers) } else { None };
        // Of a sensor's noise the memory itself is looked for: what is left of it would be in every sample.
        let sensor = sensor.map(|found| if near(&found) { self.memory(&found).unwrap_or(found) } else { found });
        let coloured = [force, sensor].into_iter().flatten();
        Some(coloured.fold(white, |best, found| if found.score(price) > best.score(price) { found } else { best }))
    }

    /// The best memory of the sensor's noise from one on.
    fn memory(&self, from: &Found) -> Option<Found> {
        let at = |sensor: f64| {
            let found = self.share(Colours { sensor, ..from.colours }, (from.decade, 0.5 * DECADES.0))?;
            Some((found.likelihood, found))
        };
        likeliest_pole(from.colours.sensor, at).map(|(_, found)| found)
    }

    /// What was found as a noise.
    fn noise(&self, found: &Found) -> Option<Driven> {
        let Found { colours, sigma, .. } = *found;
        let variance = 10f64.powf(found.decade) / self.unit(colours.force)?;
        let filter = Filter::new(self.path, colours, variance, self.rows)?;
        let moving = match self.course {
            Some(course) => Some(Arc::new(Moved::new(course, colours, self.stretches)?.filter(variance)?)),
            None => None,
        };
        let rows = self.stretches.iter().map(|s| s.len()).sum::<usize>() as f64;
        let rms = (self.stretches.iter().map(|s| norm2(s)).sum::<f64>() / rows).sqrt();
        Some(Driven { filter, moving, entry: self.path.entry(), colours, share: variance, sigma, rms })
    }
}

/// The output's variance by a path for a force of unit variance and this pole, after so many rows; `None` where nothing finite passes.
fn unit(path: &ForcePath, pole: f64, rows: usize) -> Option<f64> {
    let unit = path.variance(pole, rows.min(SCALE_ROWS));
    (unit > 0.0 && unit.is_finite()).then_some(unit)
}

/// The pole of a noise at which a log likelihood is highest, from a first one on by decades of the memory `1/(1 - pole)`: the likelihood there, with what comes with it.
pub(in crate::evidence) fn likeliest_pole<T>(start: f64, at: impl Fn(f64) -> Option<(f64, T)>) -> Option<(f64, T)> {
    let of_memory = |decade: f64| {
        let pole = 1.0 - 10f64.powf(-decade);
        if pole > 0.0 { at(pole) } else { None }
    };
    search((-(1.0 - start).log10(), MEMORY), of_memory).map(|(_, likelihood, with)| (likelihood, with))
}

/// The decade at which a log likelihood is highest, from a first one on by steps that shrink; `at` gives it with what comes with it.
pub(in crate::evidence) fn search<T>(
    (start, step): (f64, f64),
    at: impl Fn(f64) -> Option<(f64, T)>,
) -> Option<Point<T>> {
    let at = |t: f64| at(t).map(|(likelihood, with)| (t, likelihood, with));
    let mut best = at(start)?;
    let mut step = step;
    // Likelihoods below and above the best, at the present step.
    let mut beside = [f64::NAN; 2];
    while step >= DECADES.1 {
        let mut moved = false;
        for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
            while (RANGE.0..=RANGE.1).contains(&(best.0 + sign * step)) {
                let Some(trial) = at(best.0 + sign * step) else { break };
                if trial.1 <= best.1 {
                    beside[side] = trial.1;
                    break;
                }
                beside[1 - side] = best.1;
                best = trial;
                moved = true;
            }
            if moved {
                break;
            }
        }
        if step * 0.5 < DECADES.1 {
            break;
        }
        step *= 0.5;
    }
    // The vertex of the parabola through the last three.
    let bend = beside[0] + beside[1] - 2.0 * best.1;
    if bend < 0.0
        && let Some(vertex) = at(best.0 + step * (0.5 * (beside[0] - beside[1]) / bend).clamp(-0.5, 0.5))
        && vertex.1 > best.1
    {
        best = vertex;
    }
    Some(best)
}
