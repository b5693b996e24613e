//! A parameter that varies as a simulation: what it is multiplied by stands in the equations.

use std::f64::consts::TAU;

use hysid_plant::{Expr, Function, Parameter, Simulation};

use super::course::{Course, phases};
use super::modulation::multiply;
use super::varying::Varying;
use super::written::REACH;

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

/// The simulations in which a parameter oscillates, amplitudes and frequency unknown, or follows a signal, each by a factor of another form; none for a walk,
/// since another recording sees another one.
pub fn with_course(simulation: &Simulation, found: &Varying) -> Vec<Simulation> {
    let forms: &[Factor] = match &found.course {
        Course::Walk(_) => &[],
        Course::Line(_) => &[Factor::Sum],
        Course::Follows(_) => &[Factor::Sum, Factor::Exponential],
    };
    forms.iter().filter_map(|form| with_factor(simulation, found, *form)).collect()
}

fn with_factor(simulation: &Simulation, found: &Varying, form: Factor) -> Option<Simulation> {
    let mut written = simulation.clone();
    let texts = match &found.course {
        Course::Line(f) => {
            let frequency = written.fresh_symbol("s");
            let (w, far) = (TAU * f, TAU * CYCLES / found.length_s);
            written.parameters.push(Parameter::new(&frequency, w).within(w - far, w + far));
            phases(&frequency).to_vec()
        }
        Course::Walk(_) | Course::Follows(_) => found.texts.clone(),
    };
    let mut sum: Option<Expr> = None;
    for (text, amplitude) in texts.iter().zip(&found.amplitudes) {
        let course = Expr::parse(text).ok()?;
        let name = written.fresh_symbol("g");
        let reach = REACH * found.size;
        written.parameters.push(Parameter::new(&name, *amplitude).within(-reach, reach));
        let part = Expr::symbol(&name) * course;
        sum = Some(match sum {
            Some(sum) => sum + part,
            None => part,
        });
    }
    let factor = match form {
        Factor::Sum => Expr::Number(1.0) + sum?,
        Factor::Exponential => Expr::call(Function::Exp, sum?),
    };
    multiply(&mut written, &found.symbol, &factor);
    Some(written)
}
