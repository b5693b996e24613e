//! A simulation on a data set: what is unknown in it, its residual, its tangents.
//!
//! Unknown are the parameters that are not fixed (shared by all stretches), the free initial states of each stretch, and, for a stretch
//! that begins in the middle of a recording, the initial values of all states: what an effect remembers there is as unknown as the motion.

mod adjoint;
mod along;
pub mod base;
mod course;
pub mod force;
mod growth;
pub mod hold;
pub mod hypothesis;
mod predicting;
mod unknowns;

use hysid_plant::{
    Compiled, Direction, Initial, Linearisation, Observer, Response, Run, Sensitivity, Simulation, Start,
};
use rayon::prelude::*;

use crate::data::{DataSet, Stretch};
use crate::refit::Problem;
pub use along::along;
use predicting::Corrections;
pub use unknowns::{Count, Unknown, Values};

/// A compiled simulation on a data set.
#[derive(Debug)]
pub struct Model<'d> {
    compiled: Compiled,
    data: &'d DataSet,
    unknowns: Vec<Unknown>,
    bounds: Vec<(f64, f64)>,
    /// For each stretch: whether it starts as the document says.
    from_document: Vec<bool>,
    substeps: usize,
    /// What corrects the states of each stretch; none where the simulation runs free.
    observers: Vec<Corrections>,
}

/// `[output][sample]` of one stretch.
pub type Outputs = Vec<Vec<f64>>;

impl<'d> Model<'d> {
    /// The simulation on the data.
    ///
    /// # Errors
    /// What compiling finds.
    pub fn new(simulation: &Simulation, data: &'d DataSet, substeps: usize) -> Result<Self, hysid_plant::Error> {
        let compiled = Compiled::new(simulation)?;
        let mut unknowns: Vec<Unknown> = compiled.estimated().into_iter().map(Unknown::Parameter).collect();
        let mut bounds: Vec<(f64, f64)> = unknowns
            .iter()
            .map(|u| match u {
                Unknown::Parameter(i) => (compiled.parameters()[*i].lower(), compiled.parameters()[*i].upper()),
                Unknown::Initial { .. } => (f64::NEG_INFINITY, f64::INFINITY),
            })
            .collect();
        let mut from_document = Vec::new();
        for (stretch, s) in data.stretches.iter().enumerate() {
            let first = s.samples.start == 0;
            from_document.push(first);
            for (state, st) in simulation.states.iter().enumerate() {
                if st.initial == Initial::Free || !first {
                    unknowns.push(Unknown::Initial { stretch, state });
                    bounds.push((f64::NEG_INFINITY, f64::INFINITY));
                }
            }
        }
        Ok(Self { compiled, data, unknowns, bounds, from_document, substeps: substeps.max(1), observers: Vec::new() })
    }

    /// The same with other integration steps in each sampling period, running free.
    pub fn with_substeps(&self, substeps: usize) -> Option<Self> {
        Self::new(self.simulation(), self.data, substeps).ok()
    }

    /// The document.
    pub fn simulation(&self) -> &Simulation {
        self.compiled.simulation()
    }

    /// The data.
    pub fn data(&self) -> &'d DataSet {
        self.data
    }

    /// What is unknown, in the order of every `theta` here.
    pub fn unknowns(&self) -> &[Unknown] {
        &self.unknowns
    }

    /// How many they are.
    pub fn count(&self) -> Count {
        let passes = |u: &&Unknown| matches!(u, Unknown::Initial { stretch, .. } if !self.from_document[*stretch]);
        let passing = self.unknowns.iter().filter(passes).count();
        Count { lasting: self.unknowns.len() - passing, passing }
    }

    /// Integration steps in each sampling period.
    pub fn substeps(&self) -> usize {
        self.substeps
    }

    /// The unknown that is this parameter, by its place in `theta`.
    pub fn place_of(&self, parameter: &str) -> Option<usize> {
        let index = self.compiled.parameter_index(parameter)?;
        self.unknowns.iter().position(|u| *u == Unknown::Parameter(index))
    }

    /// The name of the parameter at a place of `theta`; `None` for an initial value.
    pub fn name_of(&self, place: usize) -> Option<&str> {
        match self.unknowns.get(place)? {
            Unknown::Parameter(i) => self.compiled.parameters().get(*i).map(|p| p.name.as_str()),
            Unknown::Initial { .. } => None,
        }
    }

    /// The run of a stretch with these parameters (in the document's order) and this start.
    pub fn run_of<'a>(&'a self, stretch: usize, parameters: &'a [f64], start: &'a [f64]) -> Run<'a> {
        let start = if self.from_document[stretch] { Start::Document(start) } else { Start::States(start) };
        let s = &self.data.stretches[stretch];
        let run = Run::new(&s.drive, parameters).from(start).with_substeps(self.substeps);
        match self.observers.get(stretch) {
            Some(o) => run.observing(Observer { gain: &o.gain, measured: &o.measured }),
            None => run,
        }
    }

    /// The outputs of every stretch; the second value is the (stretch, sample) of the first divergence, if any.
    pub fn simulate(&self, theta: &[f64]) -> (Vec<Outputs>, Option<(usize, usize)>) {
        let (responses, diverged) = self.responses(theta);
        (responses.into_iter().map(|r| r.outputs).collect(), diverged)
    }

    /// Outputs and states of every stretch.
    pub fn responses(&self, theta: &[f64]) -> (Vec<Response>, Option<(usize, usize)>) {
        let parameters = self.parameters(theta, &[]);
        let responses: Vec<Response> = (0..self.data.stretches.len())
            .map(|s| {
                let start = self.start_of(s, theta);
                self.compiled.simulate(&self.run_of(s, &parameters, &start))
            })
            .collect();
        let diverged = responses.iter().enumerate().find_map(|(s, r)| r.diverged.map(|n| (s, n)));
        (responses, diverged)
    }

    /// The stacked prediction; `None` where it diverges.
    pub fn predict(&self, theta: &[f64]) -> Option<Vec<f64>> {
        let (outputs, diverged) = self.simulate(theta);
        if diverged.is_some() {
            return None;
        }
        let stack = self.data.stack(&outputs);
        stack.iter().all(|x| x.is_finite()).then_some(stack)
    }

    /// The derivatives of the stacked prediction by some of the unknowns (places in `theta`), with the prediction itself.
    pub fn tangents(&self, theta: &[f64], places: &[usize]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        self.tangents_with(theta, places, &[Vec::new()]).pop().flatten()
    }

    /// As [`Model::tangents`], for each of several settings of fixed parameters: run together they cost little more than one.
    pub fn tangents_with(
        &self,
        theta: &[f64],
        places: &[usize],
        settings: &[Vec<(String, f64)>],
    ) -> Vec<Option<(Vec<f64>, Vec<Vec<f64>>)>> {
        let parameters: Vec<Vec<f64>> = settings.iter().map(|set| self.parameters(theta, set)).collect();
        let runs: Vec<_> = (0..self.data.stretches.len())
            .into_par_iter()
            .map(|s| {
                let start = self.start_of(s, theta);
                let runs: Vec<Run<'_>> = parameters.iter().map(|p| self.run_of(s, p, &start)).collect();
                let mut directions = Vec::new();
                let mut wanted = Vec::new();
                for (c, &place) in places.iter().enumerate() {
                    match self.unknowns[place] {
                        Unknown::Parameter(i) => {
                            directions.push(Direction::Parameter(i));
                            wanted.push(c);
                        }
                        Unknown::Initial { stretch, state } if stretch == s => {
                            directions.push(Direction::Initial(state));
                            wanted.push(c);
                        }
                        Unknown::Initial { .. } => {}
                    }
                }
                (self.compiled.sensitivities_many(&runs, &directions), wanted)
            })
            .collect();
        (0..settings.len()).map(|i| self.stacked(places.len(), runs.iter().map(|(all, c)| (&all[i], c)))).collect()
    }

    /// The stacked prediction with its derivatives, from a run of each stretch with the columns that its tangents belong to.
    fn stacked<'r>(
        &self,
        columns: usize,
        runs: impl Iterator<Item = (&'r Sensitivity, &'r Vec<usize>)>,
    ) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        let rows = self.data.rows();
        let mut prediction = vec![0.0; rows];
        let mut columns = vec![vec![0.0; rows]; columns];
        for (s, (sensitivity, wanted)) in runs.enumerate() {
            if sensitivity.response.diverged.is_some() {
                return None;
            }
            for series in self.data.layout.series.iter().filter(|x| x.stretch == s) {
                prediction[series.rows.clone()]
                    .copy_from_slice(&self.data.rows_of(series, &sensitivity.response.outputs[series.output]));
                for (tangent, &c) in sensitivity.tangents.iter().zip(wanted) {
                    columns[c][series.rows.clone()]
                        .copy_from_slice(&self.data.rows_of(series, &tangent[series.output]));
                }
            }
        }
        if prediction.iter().any(|x| !x.is_finite()) {
            return None;
        }
        for column in &mut columns {
            column.iter_mut().filter(|x| !x.is_finite()).for_each(|x| *x = 0.0);
        }
        Some((prediction, columns))
    }

    /// The stacked tangent responses to signals, each added at a place by itself (one series for each stretch); `None` where
    /// one is not finite.
    pub fn responses_to(&self, theta: &[f64], signals: &[(hysid_plant::Slot, &[Vec<f64>])]) -> Vec<Option<Vec<f64>>> {
        let parameters = self.parameters(theta, &[]);
        let mut outputs = vec![Vec::new(); signals.len()];
        for s in 0..self.data.stretches.len() {
            let start = self.start_of(s, theta);
            let run = self.run_of(s, &parameters, &start);
            let directions: Vec<Direction<'_>> = signals
                .iter()
                .map(|(place, series)| {
                    Direction::Injection(hysid_plant::Injection {
                        slot: *place,
                        series: series.get(s).map(Vec::as_slice).unwrap_or_default(),
                    })
                })
                .collect();
            let sensitivity = self.compiled.sensitivities(&run, &directions);
            if sensitivity.response.diverged.is_some() {
                return vec![None; signals.len()];
            }
            outputs.iter_mut().zip(sensitivity.tangents).for_each(|(all, tangent)| all.push(tangent));
        }
        let stack = |outputs: Vec<Outputs>| Some(self.data.stack(&outputs)).filter(|s| s.iter().all(|x| x.is_finite()));
        outputs.into_iter().map(stack).collect()
    }

    /// The equations linearised at `instants` of the stretches, evenly spread over all samples; empty where the run diverges.
    pub fn linearised(&self, theta: &[f64], instants: usize) -> Vec<Linearisation> {
        let (responses, diverged) = self.responses(theta);
        let all = self.data.samples();
        if diverged.is_some() || all == 0 {
            return Vec::new();
        }
        let parameters = self.parameters(theta, &[]);
        (0..instants)
            .filter_map(|i| {
                let mut n = (2 * i + 1) * all / (2 * instants);
                let (stretch, response) = self.data.stretches.iter().zip(&responses).find(|(s, _)| {
                    let here = n < s.len();
                    n -= if here { 0 } else { s.len() };
                    here
                })?;
                Some(self.beside(&parameters, stretch, response, n))
            })
            .collect()
    }

    /// The equations linearised at a sample of a stretch's response, with these parameters (in the document's order).
    fn beside(&self, parameters: &[f64], stretch: &Stretch, response: &Response, sample: usize) -> Linearisation {
        let x: Vec<f64> = response.states.iter().map(|s| s[sample]).collect();
        let u: Vec<f64> = stretch.drive.inputs().iter().map(|s| s[sample]).collect();
        self.compiled.linearise(parameters, &x, &u)
    }

    /// The simulation with these values in it (initial values stay as the document has them).
    pub fn document(&self, theta: &[f64]) -> Simulation {
        let mut simulation = self.simulation().clone();
        for (p, x) in simulation.parameters.iter_mut().zip(self.parameters(theta, &[])) {
            p.value = x;
        }
        simulation
    }
}

impl Problem for Model<'_> {
    fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }

    fn residual(&self, theta: &[f64]) -> Option<Vec<f64>> {
        let mut p = self.predict(theta)?;
        p.iter_mut().zip(&self.data.y).for_each(|(p, y)| *p = y - *p);
        Some(p)
    }

    fn tangent(&self, theta: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        let places: Vec<usize> = (0..self.unknowns.len()).collect();
        let (mut p, columns) = self.tangents(theta, &places)?;
        p.iter_mut().zip(&self.data.y).for_each(|(p, y)| *p = y - *p);
        Some((p, columns))
    }
}
