//! A mechanism's law at one slot, as text in the language of simulation files.
//!
//! The text may use the symbols that the [`Slot`](crate::slot::Slot) offers (`x`, `v`, `u`, `y`, `p`, `k`, `m`, ...) and the
//! law's own parameters and states. Own names that the simulation already uses are given a number when the law is written
//! into it, so the text can be read as the physics.
//!
//! A `measure` is text as well: `F/x^3` says both the unit of a parameter and its natural size on a recording (the rms of the
//! force over the cubed rms of the displacement). `T` is the recording's duration, `h` its sampling period, both in seconds.

use super::form::{Form, Purpose};
use super::grid::Grid;

/// How the law's text enters the simulation at its slot.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// A force that resists: taken from the force of a motion, added to the output of a static force law.
    Force(String),
    /// An external force: the opposite sign.
    Drive(String),
    /// A rate taken from the derivative of a store.
    Outflow(String),
    /// What is added to each output that sees a motion, in their order.
    Outputs(Vec<String>),
    /// An expression that replaces the input, the parameter, the output or the half-widths of the slot.
    Replace(String),
    /// The acceleration becomes (force - `force`)/(mass + `mass`).
    Inertia {
        /// Added to what resists.
        force: String,
        /// Added to the mass.
        mass: String,
    },
    /// The flow separation that the simulation has as a function of the angle: `by` stands in its place, in which `steady` is what stood
    /// there and `ahead` the same at the angle `at`.
    Separation {
        /// The angle that decides, in place of `x`.
        at: String,
        /// What stands for the function.
        by: String,
    },
}

/// What a law's parameter is to the fit.
#[derive(Debug, Clone, PartialEq)]
pub enum Role {
    /// Zero is the baseline.
    Amplitude,
    /// Has no effect while the amplitudes are zero; tried on a grid.
    Shape(Grid),
    /// Set once from the recording, then fixed.
    Constant(Grid),
}

/// A parameter of a law.
#[derive(Debug, Clone, PartialEq)]
pub struct LawParameter {
    /// Its name in the law.
    pub name: String,
    /// Its unit and natural size.
    pub measure: String,
    /// What it is to the fit.
    pub role: Role,
    /// Smallest and largest value: in multiples of the measure. `None`: taken from the grid.
    pub range: Option<(f64, f64)>,
    /// A further lower bound: that many times another measure. Keeps a law within what the integration step can follow.
    pub floor: Option<(String, f64)>,
    /// Below that many times another measure the law looks like one of another kind, in words: nothing is firm there.
    pub told_from: Option<(String, f64, &'static str)>,
    /// Whether it is a displacement up to which the law is elastic: nothing is firm where that is longer than the travel of `x`.
    pub elastic: bool,
    /// The value at which the rewritten simulation is the baseline whatever the others are, in multiples of the measure.
    pub neutral: Option<f64>,
    /// Whether it is reported under its own name.
    pub reported: bool,
    /// Whether least squares alone cannot move it: a time of change, a period, a knee that few samples reach.
    pub searched: bool,
}

/// A state that a law adds.
#[derive(Debug, Clone, PartialEq)]
pub struct LawState {
    /// Its name in the law.
    pub name: String,
    /// Its unit.
    pub measure: String,
    /// Its derivative.
    pub derivative: String,
    /// Where it starts.
    pub start: Start,
}

/// Where an added state starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// At rest.
    Zero,
    /// As the state that this symbol of the slot stands for; at zero where it stands for something else.
    Like(&'static str),
    /// Where the recording says.
    Free,
}

/// A number that is reported although it is not a parameter of the law.
#[derive(Debug, Clone, PartialEq)]
pub struct Derived {
    /// Its name in the report.
    pub name: String,
    /// Its unit.
    pub measure: String,
    /// Its value, from the law's parameters and the slot's symbols `k`, `c`, `m`.
    pub value: String,
}

/// What the amplitudes of a law's screening form are to each other, which decides what is fitted first: see
/// [`Mechanism::fitted_first`](super::Mechanism::fitted_first).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Amplitudes {
    /// Parts of one law.
    Together,
    /// What it does above and what it does below.
    OfTwoSides,
    /// Laws of one name, each a form of its own with this amplitude: the columns are screened one by one.
    Apart,
    /// The share of a law that is there or not: less than the whole of it is what something blurs.
    Share,
}

/// A law at one slot: see the module.
#[derive(Debug, Clone, PartialEq)]
pub struct Law {
    /// How it enters the simulation.
    pub change: Change,
    /// Its parameters.
    pub parameters: Vec<LawParameter>,
    /// The states that it adds.
    pub states: Vec<LawState>,
    /// What is reported besides the parameters.
    pub derived: Vec<Derived>,
    /// No finite values of the parameters make it the baseline.
    pub never_baseline: bool,
    /// It is the sum of two other mechanisms of the catalogue: alone it says no more than they do together.
    pub sum_of_others: bool,
    /// What its amplitudes are to each other.
    pub amplitudes: Amplitudes,
}

impl Law {
    fn new(change: Change) -> Self {
        Self {
            change,
            parameters: Vec::new(),
            states: Vec::new(),
            derived: Vec::new(),
            never_baseline: false,
            sum_of_others: false,
            amplitudes: Amplitudes::Together,
        }
    }

    /// A force that resists.
    pub fn force(text: impl Into<String>) -> Self {
        Self::new(Change::Force(text.into()))
    }

    /// An external force.
    pub fn drive(text: impl Into<String>) -> Self {
        Self::new(Change::Drive(text.into()))
    }

    /// A loss of a store.
    pub fn outflow(text: impl Into<String>) -> Self {
        Self::new(Change::Outflow(text.into()))
    }

    /// What stands instead of the slot's input, parameter or output.
    pub fn replace(text: impl Into<String>) -> Self {
        Self::new(Change::Replace(text.into()))
    }

    /// What each output that sees the motion gets besides.
    pub fn outputs(texts: Vec<String>) -> Self {
        Self::new(Change::Outputs(texts))
    }

    /// A mass that is not constant and the force that comes with it.
    pub fn inertia(force: impl Into<String>, mass: impl Into<String>) -> Self {
        Self::new(Change::Inertia { force: force.into(), mass: mass.into() })
    }

    /// What stands instead of the separation that the simulation has as a function of its angle.
    pub fn separation(at: impl Into<String>, by: impl Into<String>) -> Self {
        Self::new(Change::Separation { at: at.into(), by: by.into() })
    }

    /// The weight `w` of a screening form; not reported.
    #[must_use]
    pub fn weight(self) -> Self {
        self.weights(&["w"])
    }

    /// Several such weights.
    #[must_use]
    pub fn weights(self, names: &[&str]) -> Self {
        names.iter().fold(self, |law, name| law.amplitude(*name, "1", -2.0, 2.0).silent())
    }

    /// An amplitude between `low` and `high` (multiples of `measure`).
    #[must_use]
    pub fn amplitude(self, name: impl Into<String>, measure: impl Into<String>, low: f64, high: f64) -> Self {
        self.with(name.into(), measure.into(), Role::Amplitude).within(low, high).neutral(0.0)
    }

    /// A shape parameter.
    #[must_use]
    pub fn shape(self, name: impl Into<String>, measure: impl Into<String>, grid: Grid) -> Self {
        self.with(name.into(), measure.into(), Role::Shape(grid))
    }

    /// A parameter that the recording sets and nothing fits: the first value of its grid.
    #[must_use]
    pub fn constant(self, name: impl Into<String>, measure: impl Into<String>, grid: Grid) -> Self {
        self.with(name.into(), measure.into(), Role::Constant(grid))
    }

    /// A shape parameter that only sharp recordings tell: at the first of these multiples of its measure until the finer form has it fitted,
    /// so that no recording pays for what it cannot tell.
    #[must_use]
    pub fn detail(self, purpose: Purpose, name: &str, measure: &str, values: Vec<f64>, range: (f64, f64)) -> Self {
        match purpose {
            Purpose::Form(Form::Finer) => self.shape(name, measure, Grid::Values(values)).within(range.0, range.1),
            _ => self.constant(name, measure, Grid::Values(values)),
        }
    }

    fn with(mut self, name: String, measure: String, role: Role) -> Self {
        self.parameters.push(LawParameter {
            name,
            measure,
            role,
            range: None,
            floor: None,
            told_from: None,
            elastic: false,
            neutral: None,
            reported: true,
            searched: false,
        });
        self
    }

    fn last(mut self, change: impl FnOnce(&mut LawParameter)) -> Self {
        if let Some(parameter) = self.parameters.last_mut() {
            change(parameter);
        }
        self
    }

    /// Bounds of the last parameter, in multiples of its measure.
    #[must_use]
    pub fn within(self, low: f64, high: f64) -> Self {
        self.last(|p| p.range = Some((low, high)))
    }

    /// A further lower bound of the last parameter: `times` the size of another measure.
    #[must_use]
    pub fn at_least(self, times: f64, measure: &str) -> Self {
        let floor = Some((measure.to_owned(), times));
        self.last(|p| p.floor = floor)
    }

    /// Below `times` the size of another measure the last parameter makes the law look like one of another kind, in words.
    #[must_use]
    pub fn told_from(self, times: f64, measure: &str, below: &'static str) -> Self {
        let told_from = Some((measure.to_owned(), times, below));
        self.last(|p| p.told_from = told_from)
    }

    /// The last parameter is a displacement up to which the law is elastic: beyond the travel of `x` it makes the law look like one of another kind.
    #[must_use]
    pub fn elastic(self) -> Self {
        self.last(|p| p.elastic = true)
    }

    /// The value of the last parameter at which the simulation is the baseline, in multiples of its measure.
    #[must_use]
    pub fn neutral(self, value: f64) -> Self {
        self.last(|p| p.neutral = Some(value))
    }

    /// Leaves the last parameter out of the report.
    #[must_use]
    pub fn silent(self) -> Self {
        self.last(|p| p.reported = false)
    }

    /// The last parameter is searched line by line: least squares alone cannot move it.
    #[must_use]
    pub fn searched(self) -> Self {
        self.last(|p| p.searched = true)
    }

    /// What its amplitudes are to each other.
    #[must_use]
    pub fn with_amplitudes(mut self, amplitudes: Amplitudes) -> Self {
        self.amplitudes = amplitudes;
        self
    }

    /// It is the sum of two other mechanisms of the catalogue.
    #[must_use]
    pub fn sum_of_others(mut self) -> Self {
        self.sum_of_others = true;
        self
    }

    /// States that no finite values of the parameters make it the baseline.
    #[must_use]
    pub fn never_baseline(mut self) -> Self {
        self.never_baseline = true;
        self
    }

    /// A state that starts at rest.
    #[must_use]
    pub fn state(mut self, name: impl Into<String>, measure: impl Into<String>, derivative: impl Into<String>) -> Self {
        self.states.push(LawState {
            name: name.into(),
            measure: measure.into(),
            derivative: derivative.into(),
            start: Start::Zero,
        });
        self
    }

    /// A pure number that follows the displacement and relaxes over this much of it: the rate with the velocity in it, over the displacement.
    ///
    /// Where a sample's travel is twice that or more, the state relaxes over half of it: faster than that no integration with a step follows,
    /// and no sample shows. Near a reversal, where the law is seen, it stands as it is.
    #[must_use]
    pub fn relaxing(self, name: &str, rate: &str, over: &str) -> Self {
        self.constant("s_h", "h", Grid::Values(vec![0.5])).silent().state(
            name,
            "1",
            format!("({rate})/max({over}, s_h*abs(v))"),
        )
    }

    /// The last state starts as the state behind `symbol`.
    #[must_use]
    pub fn starting_like(mut self, symbol: &'static str) -> Self {
        if let Some(state) = self.states.last_mut() {
            state.start = Start::Like(symbol);
        }
        self
    }

    /// The last state starts where the recording says.
    #[must_use]
    pub fn starting_free(mut self) -> Self {
        if let Some(state) = self.states.last_mut() {
            state.start = Start::Free;
        }
        self
    }

    /// A force whose size follows the slot's `control`, the input that the simulation's own damping follows there.
    #[must_use]
    pub fn controlled(mut self) -> Self {
        if let Change::Force(text) = &mut self.change {
            *text = format!("({text})*(1 + b_c*control)");
            return self.shape("b_c", "1/control", Grid::Values(vec![0.0, 0.5, 4.0])).within(-0.5, 50.0);
        }
        self
    }

    /// Reports a number made of the parameters; a parameter of the same name is then left out of the report.
    #[must_use]
    pub fn report(mut self, name: impl Into<String>, measure: impl Into<String>, value: impl Into<String>) -> Self {
        let name = name.into();
        if let Some(own) = self.parameters.iter_mut().find(|p| p.name == name) {
            own.reported = false;
        }
        self.derived.push(Derived { name, measure: measure.into(), value: value.into() });
        self
    }
}
