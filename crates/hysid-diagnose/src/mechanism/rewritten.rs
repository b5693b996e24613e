//! A simulation with a mechanism in it: what a rewriting returns.

use hysid_plant::{Expr, Simulation, Unit};

use super::{Grid, Purpose};

/// Lines that lie within the spacing of a shape that is one: a fit from any of them may have ended in the minimum of another.
const LOBES: f64 = 3.0;

/// A parameter whose zero is the baseline.
#[derive(Debug, Clone, PartialEq)]
pub struct Amplitude {
    /// Its name in the rewritten simulation.
    pub name: String,
    /// Its natural size on this recording, above zero: where the effect is as large as the signals allow.
    pub size: f64,
}

/// A parameter that shapes the effect and has no influence while the amplitudes are zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Its name in the rewritten simulation.
    pub name: String,
    /// The values to try, in ascending order.
    pub grid: Vec<f64>,
    /// Those of them to which the residual itself pointed beside those that are tried on any recording.
    pub pointed: Vec<f64>,
    /// Whether least squares alone cannot move it.
    pub searched: bool,
    /// What of the recording the values were taken from.
    pub places: Places,
    /// That over which lines are told from each other: the recording's duration for frequencies, the travel for periods of the position.
    pub over: f64,
    /// The value below which the law looks like one of another kind on this recording, and that kind in words.
    pub told_from: Option<(f64, &'static str)>,
    /// The travel beyond which a law that is elastic up to this displacement is a curved spring on this recording.
    pub travel: Option<f64>,
}

/// What a loop is that yields at a longer way than the recording goes.
const NEVER_YIELDS: &str =
    "a loop that does not yield on the whole way that the recording goes is hardly more than a curved spring there";

impl Shape {
    /// What the law looks like at a value on this recording where that is one of another kind, in words.
    pub fn confused(&self, value: f64) -> Option<&'static str> {
        let elastic = self.travel.filter(|travel| value > *travel).map(|_| NEVER_YIELDS);
        elastic.or_else(|| self.told_from.filter(|(from, _)| value < *from).map(|(_, below)| below))
    }

    /// How far a value may be from the next that the recording tells from it: between two lines a whole cycle more or less, else the spacing of the grid.
    pub fn spacing(&self, value: f64) -> f64 {
        let lines = match self.places {
            Places::Lines => 1.0 / self.over,
            Places::Turns => value * value / self.over,
            Places::Any | Places::Moments => 0.0,
        };
        let above = self.grid.partition_point(|g| *g <= value).clamp(1, self.grid.len().max(2) - 1);
        let of_grid = || self.grid.get(above).zip(self.grid.get(above - 1)).map_or(0.0, |(high, low)| high - low);
        if lines > 0.0 && lines.is_finite() { LOBES * lines } else { of_grid() }
    }
}

/// What of a recording the values of a shape point to: an effect that is looked for at many places is found at one of them by chance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Places {
    /// Nothing in particular.
    Any,
    /// Moments.
    Moments,
    /// Lines of the residual's spectrum.
    Lines,
    /// Lines of its spectrum over the position.
    Turns,
}

impl Places {
    pub(super) fn of(grid: &Grid) -> Self {
        match grid {
            Grid::Times(_) => Self::Moments,
            Grid::Peaks(_) => Self::Lines,
            Grid::Turns(..) => Self::Turns,
            _ => Self::Any,
        }
    }
}

/// What `diagnosis.json` reports of an effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Reported {
    /// The name in the report.
    pub name: String,
    /// The unit, where the simulation settles it.
    pub unit: Option<Unit>,
    /// The value, over the parameters of the rewritten simulation.
    pub value: Expr,
}

/// A simulation with an effect in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Rewritten {
    /// The simulation; the effect's amplitudes are zero in it, its shapes stand in the middle of their grids.
    pub simulation: Simulation,
    /// The parameters whose zero is the baseline. Their signs of plausibility are the bounds in the simulation.
    pub amplitudes: Vec<Amplitude>,
    /// The parameters on grids.
    pub shapes: Vec<Shape>,
    /// Values at which the simulation is the baseline; empty where no finite value is.
    pub neutral: Vec<(String, f64)>,
    /// Whether each amplitude is a law of its own.
    pub apart: bool,
    /// Whether the equations are linear in the amplitudes.
    pub linear: bool,
    /// What is reported.
    pub report: Vec<Reported>,
    /// States that were added.
    pub states: Vec<String>,
    /// Whether the law is the sum of two others of the catalogue.
    pub sum_of_others: bool,
    /// Which form of the law it is.
    pub purpose: Purpose,
}

/// Most joint points of the shape grids.
const MOST_STARTS: usize = 96;

impl Rewritten {
    /// Every joint point of the shape grids, as (name, value) pairs; one empty point where there is no shape.
    ///
    /// Where there would be more than 96 points the longest grids are thinned first.
    pub fn starts(&self) -> Vec<Vec<(String, f64)>> {
        let mut grids: Vec<(String, Vec<f64>)> = self.shapes.iter().map(|s| (s.name.clone(), s.grid.clone())).collect();
        while grids.iter().map(|(_, g)| g.len().max(1)).product::<usize>() > MOST_STARTS {
            let Some(longest) = grids.iter_mut().map(|(_, g)| g).max_by_key(|g| g.len()) else { break };
            *longest = longest.iter().copied().step_by(2).collect();
        }
        let mut points = vec![Vec::new()];
        for (name, grid) in grids {
            let extended = points.iter().flat_map(|point: &Vec<(String, f64)>| {
                grid.iter().map(|value| {
                    let mut point = point.clone();
                    point.push((name.clone(), *value));
                    point
                })
            });
            points = extended.collect();
        }
        points
    }

    /// The names of the parameters that the effect brought, fixed ones too.
    pub fn parameters(&self, baseline: &Simulation) -> Vec<String> {
        let new = self.simulation.parameters.iter().filter(|p| baseline.parameter(&p.name).is_none());
        new.map(|p| p.name.clone()).collect()
    }

    /// The names of its amplitudes and shapes, in the order of the law.
    pub fn parameters_of(&self) -> Vec<String> {
        self.amplitudes.iter().map(|a| a.name.clone()).chain(self.shapes.iter().map(|s| s.name.clone())).collect()
    }

    /// What was allowed beforehand: the names of its amplitudes with their natural sizes, of its shapes with the lengths of their grids.
    pub fn widths(&self) -> Vec<(String, f64)> {
        let amplitudes = self.amplitudes.iter().map(|a| (a.name.clone(), a.size));
        let shapes = self.shapes.iter().map(|s| {
            let ends = (s.grid.first().copied().unwrap_or(0.0), s.grid.last().copied().unwrap_or(0.0));
            (s.name.clone(), ends.1 - ends.0)
        });
        amplitudes.chain(shapes).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_law_is_confused_below_what_tells_it_and_beyond_the_travel() {
        let shape = |told_from, travel| Shape {
            name: "z_s".into(),
            grid: vec![0.1],
            pointed: Vec::new(),
            searched: false,
            places: Places::Any,
            over: 1.0,
            told_from,
            travel,
        };
        let of = |shape: Shape| [0.05, 0.3, 1.2].map(|value| shape.confused(value).is_some());
        assert_eq!(of(shape(None, None)), [false; 3]);
        assert_eq!(of(shape(None, Some(1.0))), [false, false, true]);
        assert_eq!(of(shape(Some((0.1, "another")), Some(1.0))), [true, false, true]);
    }

    /// Between two lines that a recording just tells apart there is one cycle more over its length, one turn more over its travel.
    #[test]
    fn the_spacing_of_lines_is_that_of_whole_cycles() {
        let shape = |places, over| Shape {
            name: "p".into(),
            grid: vec![0.1, 0.2, 0.4],
            pointed: Vec::new(),
            searched: true,
            places,
            over,
            told_from: None,
            travel: None,
        };
        let (travel, period) = (500.0, 0.4);
        let next = period + shape(Places::Turns, travel).spacing(period) / LOBES;
        assert!((travel / period - travel / next - 1.0).abs() < 2e-3, "{next}");
        let (duration, frequency) = (20.0, 3.0);
        let next = frequency + shape(Places::Lines, duration).spacing(frequency) / LOBES;
        assert!((duration * next - duration * frequency - 1.0).abs() < 1e-9, "{next}");
        assert!((shape(Places::Any, duration).spacing(0.25) - 0.2).abs() < 1e-12);
        assert!((shape(Places::Moments, duration).spacing(0.5) - 0.2).abs() < 1e-12);
    }
}
