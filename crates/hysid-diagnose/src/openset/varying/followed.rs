//! What a parameter may follow: a recorded input, or a state of the simulation, as a reaction's rate does the temperature.

use hysid_plant::{Expr, Simulation, State, Unit};

use super::course::Series;
use crate::model::along;
use crate::model::base::Base;
use crate::openset::sites::OTHERS;
use crate::openset::terms::held_beyond;
use crate::slot::{Place, Structure, is_turn};
use crate::text::number;

/// How a parameter follows a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// In proportion.
    Straight,
    /// As its square.
    Squared,
    /// Along a curve of second degree, as a viscosity does a temperature.
    Curved,
}

impl Way {
    /// Each of them.
    pub const ALL: [Self; 3] = [Self::Straight, Self::Squared, Self::Curved];
}

/// An input or a state.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// Its symbol.
    pub symbol: String,
    /// Whether it is a state, and no input.
    pub state: bool,
    unit: Option<Unit>,
    /// As it is written: a state not further than it was seen to go.
    text: String,
}

/// A signal that parameters may follow, counted from its mean in multiples of its standard deviation.
#[derive(Debug)]
pub struct Signal {
    quantity: Quantity,
    /// The parts that move, where it is a coordinate or the velocity of one.
    moved: Option<Vec<String>>,
    mean: f64,
    deviation: f64,
    /// Standard deviation of its square from zero.
    spread: f64,
    /// The signal and its square, both without their means.
    pub courses: [Series; 2],
}

/// A signal, its square or both, counted from the mean in multiples of the standard deviation.
#[derive(Debug, Clone, PartialEq)]
pub struct Followed {
    /// What is followed.
    pub quantity: Quantity,
    /// How it is followed.
    pub way: Way,
    mean: f64,
    deviation: f64,
    /// The courses of a parameter that follows it, each with an amplitude of its own.
    pub courses: Vec<Series>,
}

impl Signal {
    /// All that a parameter of a fitted simulation may follow: what is recorded besides the one input that drives it, the states, but no prescribed motion. A
    /// parameter that follows that is a curved law, which has terms of its own ([`Self::leads`]).
    pub fn all(base: &Base<'_>) -> Vec<Self> {
        let simulation = base.model.simulation();
        let structure = Structure::of(simulation);
        let motion = motion_in(&structure, &[Place::ForceLaw]);
        let several = simulation.inputs.len() > 1;
        let inputs = simulation.inputs.iter().enumerate().filter(|(_, u)| several && !motion.contains(&u.symbol));
        let recorded = |i: usize| base.model.data().stretches.iter().map(|s| s.drive.inputs()[i].clone()).collect();
        let inputs = inputs.filter_map(|(i, u)| Self::new(simulation, &u.symbol, recorded(i)));
        let states = simulation.states.iter().map(|s| &s.name).filter(|name| !is_turn(simulation, name)).take(OTHERS);
        let states: Vec<&String> = states.collect();
        let meanings: Vec<Expr> = states.iter().map(|s| Expr::symbol(*s)).collect();
        let simulated = along(base, &meanings).unwrap_or_default();
        let own = motion_in(&structure, &[Place::Force, Place::Connection]);
        let parts = structure.slots.iter().filter(|s| s.place == Place::Force);
        let parts: Vec<String> = parts.filter_map(|s| Some(s.label.strip_prefix("state:")?.to_owned())).collect();
        let of_state = |(name, x): (&String, Series)| {
            let moved = own.contains(name).then(|| parts.clone());
            Some(Self { moved, ..Self::new(simulation, name, x)? })
        };
        inputs.chain(states.into_iter().zip(simulated).filter_map(of_state)).collect()
    }

    /// `None` where the signal does not move.
    fn new(simulation: &Simulation, symbol: &str, mut series: Series) -> Option<Self> {
        let state = simulation.state(symbol).is_some();
        let unit = simulation.unit_of(symbol).filter(|u| !u.is_none());
        let text = if state { held_beyond(Expr::symbol(symbol), &series) } else { Expr::symbol(symbol) };
        let (mean, deviation) = moments(&series);
        series.iter_mut().flatten().for_each(|x| *x = (*x - mean) / deviation);
        let square: Series = series.iter().map(|s| s.iter().map(|x| x * x - 1.0).collect()).collect();
        let power = |(z, square): (&f64, &f64)| power(mean, deviation, *z, *square);
        let powers = series.iter().zip(&square).map(|(z, s)| z.iter().zip(s).map(power).collect());
        let spread = moments(&powers.collect()).1;
        let moves = deviation > 1e-9 * mean.abs() && deviation.is_finite();
        moves.then(|| Self {
            quantity: Quantity { symbol: symbol.to_owned(), state, unit, text: text.to_string() },
            moved: None,
            mean,
            deviation,
            spread,
            courses: [series, square],
        })
    }

    /// Its square from zero in multiples of the standard deviation of that, by its two courses or by the responses to them.
    fn squared(&self, [z, square]: [&[f64]; 2]) -> Vec<f64> {
        let Self { mean, deviation, spread, .. } = self;
        z.iter().zip(square).map(|(z, s)| power(*mean, *deviation, *z, *s) / spread).collect()
    }

    /// What parameters follow that follow it this way.
    pub fn followed(&self, way: Way) -> Followed {
        let Self { quantity, mean, deviation, spread, courses: [z, square], .. } = self;
        let (mean, deviation, courses) = match way {
            Way::Straight => (*mean, *deviation, vec![z.clone()]),
            Way::Squared => {
                let powers = z.iter().zip(square).map(|(z, s)| self.squared([z, s])).collect();
                (mean * mean + deviation * deviation, *spread, vec![powers])
            }
            Way::Curved => (*mean, *deviation, self.courses.to_vec()),
        };
        Followed { quantity: quantity.clone(), way, mean, deviation, courses }
    }

    /// The responses to what is followed this way, of those to the two courses.
    pub fn responses(&self, way: Way, [one, two]: [&[f64]; 2]) -> Vec<Vec<f64>> {
        match way {
            Way::Straight => vec![one.to_vec()],
            Way::Squared => vec![self.squared([one, two])],
            Way::Curved => vec![one.to_vec(), two.to_vec()],
        }
    }

    /// Whether a parameter or an input may follow it. One that stands among the forces on what moves, and nowhere else, and follows the motion is a curved law:
    /// a damping that is stronger near the ends of a travel, where the speed is low, is what a dry friction looks like.
    pub fn leads(&self, simulation: &Simulation, symbol: &str) -> bool {
        let Some(parts) = &self.moved else { return self.quantity.symbol != symbol };
        let is_force = |s: &State| !s.derivative.uses(symbol) || parts.contains(&s.name);
        simulation.outputs.iter().any(|o| o.expression.uses(symbol)) || !simulation.states.iter().all(is_force)
    }
}

/// What the coordinates and velocities at slots of these places are made of.
fn motion_in(structure: &Structure, places: &[Place]) -> Vec<String> {
    let slots = structure.slots.iter().filter(|s| places.contains(&s.place));
    let quantities = slots.flat_map(|s| ["x", "v"].map(|n| s.quantity(n))).flatten();
    quantities.flat_map(|q| q.expression.symbols()).collect()
}

/// The square from zero, but for its mean, of what is so many deviations from its mean, with the square of that less one.
fn power(mean: f64, deviation: f64, z: f64, square: f64) -> f64 {
    deviation * (2.0 * mean * z + deviation * square)
}

/// Mean and standard deviation.
fn moments(series: &Series) -> (f64, f64) {
    let count = series.iter().map(Vec::len).sum::<usize>().max(1) as f64;
    let mean = series.iter().flatten().sum::<f64>() / count;
    (mean, (series.iter().flatten().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt())
}

impl Followed {
    /// The courses as they are written.
    pub fn texts(&self) -> Vec<String> {
        let Self { quantity: Quantity { text, .. }, mean, deviation, .. } = self;
        let power = if self.way == Way::Squared { "^2" } else { "" };
        let straight = format!("({text}{power} - {mean})/{deviation}");
        let bend = (self.way == Way::Curved).then(|| format!("(({straight})^2 - 1)"));
        std::iter::once(straight).chain(bend).collect()
    }

    /// What it does to a parameter with this amplitude of the first course, in words.
    pub fn words(&self, amplitude: f64) -> String {
        let rises = if amplitude < 0.0 { "falls" } else { "rises" };
        let Quantity { symbol, state, unit, .. } = &self.quantity;
        let what = format!("{} `{symbol}`", if *state { "state" } else { "input" });
        let share = number(100.0 * (amplitude / self.deviation).abs());
        let power = if self.way == Way::Squared { 2 } else { 1 };
        let each = unit.as_ref().map_or("unit of it".into(), |u| u.power(power).to_string());
        let by = format!("by {share} % of its value for each {each}");
        match self.way {
            Way::Straight => format!("{rises} with the {what}, {by}"),
            Way::Squared => format!("{rises} with the square of the {what}, {by}"),
            Way::Curved => format!("{rises} with the {what} along a curve, {by} at its mean"),
        }
    }
}

#[cfg(test)]
mod tests;
