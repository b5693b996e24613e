//! A parameter that varies as a simulation: what it is multiplied by stands in the equations.

use std::f64::consts::TAU;

use hysid_plant::{Expr, Function, Parameter, Simulation};

use super::course::{Course, phases};
use super::modulation::multiply;
use super::{LikelyVariation, Variation};
use crate::model::Values;
use crate::openset::written::REACH;

/// Share of a cycle over the recording by which a frequency may move from where the periodogram found it.
const CYCLES: f64 = 0.75;

/// How a parameter is multiplied by what it follows.
#[derive(Debug, Clone, Copy)]
enum Factor {
    /// By one and a sum of the courses.
    Sum,
    /// By the exponential of that sum, which has the same slope: what is positive stays so, however far it goes.
    Exponential,
}

/// A parameter that varies, as it can be written.
#[derive(Debug, Clone)]
pub struct WrittenVariation {
    what: Variation,
    /// Share of the residual's power that each of its courses explains on the tangent.
    err: Vec<f64>,
    /// The simulation with it, by factors of several forms.
    pub forms: Vec<Form>,
}

/// A simulation with a parameter that varies.
#[derive(Debug, Clone)]
pub struct Form {
    /// With the courses in its equations.
    pub simulation: Simulation,
    /// The parameter of an oscillation that is its angular frequency.
    frequency: Option<String>,
    /// The parameters that are the courses' amplitudes.
    amplitudes: Vec<String>,
}

impl WrittenVariation {
    /// With amplitudes and frequency unknown; `None` for a walk, since another recording sees another one.
    pub fn new(simulation: &Simulation, found: &LikelyVariation) -> Option<Self> {
        let factors: &[Factor] = match &found.what.course {
            Course::Walk(_) => &[],
            Course::Line(_) => &[Factor::Sum],
            Course::Follows(_) => &[Factor::Sum, Factor::Exponential],
        };
        let forms: Vec<Form> = factors.iter().filter_map(|factor| Form::new(simulation, found, *factor)).collect();
        (!forms.is_empty()).then(|| Self { what: found.what.clone(), err: found.err.clone(), forms })
    }

    /// What varies as one of the forms was fitted, with the shares of its courses on the tangent.
    pub fn fitted(&self, form: &Form, values: &Values) -> Option<(Variation, &[f64])> {
        let value = |name: &String| values.parameters.get(name).copied();
        let amplitudes: Vec<f64> = form.amplitudes.iter().map(value).collect::<Option<_>>()?;
        let mut what = Variation { amplitudes, ..self.what.clone() };
        if let Some(w) = form.frequency.as_ref().and_then(value) {
            what.texts = phases(&format!("{w:.8}")).to_vec();
            what.course = Course::Line(w / TAU);
        }
        Some((what, &self.err))
    }
}

impl Form {
    fn new(simulation: &Simulation, found: &LikelyVariation, factor: Factor) -> Option<Self> {
        let mut written = simulation.clone();
        let (frequency, texts) = match &found.what.course {
            Course::Line(f) => {
                let frequency = written.fresh_symbol("s");
                let (w, far) = (TAU * f, TAU * CYCLES / found.length_s);
                written.parameters.push(Parameter::new(&frequency, w).within(w - far, w + far));
                let texts = phases(&frequency).to_vec();
                (Some(frequency), texts)
            }
            Course::Walk(_) | Course::Follows(_) => (None, found.what.texts.clone()),
        };
        let mut sum: Option<Expr> = None;
        let mut amplitudes = Vec::new();
        for (text, amplitude) in texts.iter().zip(&found.what.amplitudes) {
            let course = Expr::parse(text).ok()?;
            let name = written.fresh_symbol("g");
            let reach = REACH * found.what.size;
            written.parameters.push(Parameter::new(&name, *amplitude).within(-reach, reach));
            let part = Expr::symbol(&name) * course;
            amplitudes.push(name);
            sum = Some(match sum {
                Some(sum) => sum + part,
                None => part,
            });
        }
        let factor = match factor {
            Factor::Sum => Expr::Number(1.0) + sum?,
            Factor::Exponential => Expr::call(Function::Exp, sum?),
        };
        multiply(&mut written, &found.what.symbol, &factor);
        Some(Self { simulation: written, frequency, amplitudes })
    }
}
