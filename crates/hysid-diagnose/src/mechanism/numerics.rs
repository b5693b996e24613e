//! The simulation's own numerics as the cause of a mismatch: not a rewriting at a slot but a set of variants to compare.
//!
//! Step size, the value of an input between samples, half a sample of time shift and the sharpness of a smoothed friction
//! law change a simulation without any physics. If a variant fits the recording clearly better than the calibrated baseline,
//! that is to be said before physics is blamed.

use hysid_plant::{Expr, Function, Hold, Memory, Parameter, Simulation};

use crate::mechanism::{Block, Family, Law, Mechanism};
use crate::slot::Structure;

/// The simulation's own numerics: step, hold, clock, smoothing.
pub static SOLVER_ARTEFACT: Mechanism = Mechanism {
    id: "solver_artefact",
    family: Family::Numerics,
    block: Block::Input,
    places: &[],
    applies: |_| false,
    already: &[],
    // Never written: it stands at no slot.
    law: |_, _| Law::replace("u"),
    contains: &[],
    confusable: &["stribeck_friction", "delay"],
    needs: &[],
    sentence: "The difference comes from the simulation's own numerics: {place}.",
    signature: "Looks like Stribeck friction, a delay of half a sample or additional damping.",
    reference: "measured for this catalogue: a friction law smoothed three times too wide was taken for Stribeck friction",
};

/// A change of the numerics that leaves the physics as it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// What was changed, for people.
    pub what: &'static str,
    /// The changed simulation.
    pub simulation: Simulation,
}

impl Variant {
    /// Log odds against it, which its evidence has to pay for.
    pub fn odds_against(&self) -> f64 {
        if self.what == SHORTER { UNSTATED } else { 0.0 }
    }
}

/// The place of a smoothed friction law taken by one that sticks.
const STICKS: &str = "friction that sticks in the place of a smoothed law";
/// A smoothed friction law made sharper, which can be done again.
pub const SHARPER: &str = "smoothed friction three times as sharp";

/// Euler's explicit method in the place of the equations.
const EXPLICIT: &str = "explicit steps of a sampling period, as a machine that is emulated takes them";
/// The same with shorter steps, of a length that is fitted.
const SHORTER: &str = "explicit steps of a part of a sampling period, as a machine that is emulated takes them";
/// Log odds against an emulated machine whose steps have a length that nobody states: what lags a little fits it, too.
const UNSTATED: f64 = 5.0;
/// Share of the sampling period from which the length of such steps is fitted.
const FIRST_SHARE: f64 = 0.25;

/// The variants of a simulation whose outputs are to be compared with its own.
///
/// `period_s` is the recording's sampling period. Outputs that come half a sample late are made with `delay`; shorter integration steps are no
/// variant, since the search asks for them itself where a fit needs them.
pub fn variants(simulation: &Simulation, period_s: f64) -> Vec<Variant> {
    let mut held = simulation.clone();
    held.time.hold = match held.time.hold {
        Hold::Linear => Hold::Zero,
        Hold::Zero => Hold::Linear,
    };
    let what = match held.time.hold {
        Hold::Zero => "it interpolates inputs that are held between samples",
        Hold::Linear => "it holds inputs that go on between samples",
    };
    let mut found = vec![Variant { what, simulation: held }];
    let half = Expr::Number(period_s / 2.0);
    let mut late = simulation.clone();
    for output in &mut late.outputs {
        output.expression = output.expression.clone().delay(half.clone());
    }
    if late.validate().is_ok() {
        found.push(Variant { what: "outputs half a sample late", simulation: late });
    }
    // Of an input such a step sees one value.
    let mut in_steps = simulation.clone();
    in_steps.time.hold = Hold::Zero;
    let whole = explicit(&in_steps, Expr::Number(period_s));
    found.extend(whole.map(|simulation| Variant { what: EXPLICIT, simulation }));
    found.extend(shorter(simulation, period_s).map(|simulation| Variant { what: SHORTER, simulation }));
    let slots = Structure::of(simulation).slots;
    let sharpened = |sticks: bool| {
        let mut other = simulation.clone();
        other.map_equations(|e| {
            let steps = e.map(&mut |e| match e {
                Expr::Call(Function::Tanh, arguments) if uses_state(simulation, &arguments) => {
                    if sticks {
                        Expr::Call(Function::Sign, arguments)
                    } else {
                        Expr::Call(Function::Tanh, arguments.into_iter().map(|a| Expr::Number(3.0) * a).collect())
                    }
                }
                other => other,
            });
            // Signs that are smoothed otherwise are told by the velocity in them.
            slots.iter().fold(steps, |e, slot| slot.sharpened(&e, sticks))
        });
        (other != *simulation).then_some(other)
    };
    // However sharp a smoothed law is, it creeps where the machine sticks, and the sharper it is, the more steps it needs.
    for (what, sticks) in [(STICKS, true), (SHARPER, false)] {
        found.extend(sharpened(sticks).map(|simulation| Variant { what, simulation }));
    }
    found
}

/// The differential equation that explicit steps of this length follow but for terms of their square, `x' = f(x - h/2 f(x, u), u)`, where inputs go on between
/// samples with `u - h/2 u'` in their place; `None` where there is no state, or a memory that knows nothing of steps.
///
/// Reference: E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, 2nd ed. (2006), sec. IX.1 (modified equations).
fn explicit(simulation: &Simulation, step: Expr) -> Option<Simulation> {
    if simulation.is_static() || simulation.states.iter().any(|s| s.derivative.has_memory()) {
        return None;
    }
    let half = step / Expr::Number(2.0);
    let goes_on = simulation.time.hold == Hold::Linear;
    let earlier = |e: Expr| match &e {
        Expr::Symbol(name) => match simulation.state(name) {
            Some(state) => e - half.clone() * state.derivative.clone(),
            None if goes_on && simulation.input(name).is_some() => e.clone() - half.clone() * e.derivative_of_input(),
            None => e,
        },
        _ => e,
    };
    let mut other = simulation.clone();
    other.states.iter_mut().for_each(|s| s.derivative = s.derivative.map(&mut |e| earlier(e)));
    other.validate().is_ok().then_some(other)
}

/// [`explicit`] with steps shorter than a sampling period, whose length is a parameter.
fn shorter(simulation: &Simulation, period_s: f64) -> Option<Simulation> {
    let mut other = simulation.clone();
    let step = Parameter::new(other.fresh_symbol("h_e"), FIRST_SHARE * period_s).within(0.0, period_s);
    let symbol = Expr::Symbol(step.name.clone());
    other.parameters.push(step);
    explicit(&other, symbol)
}

fn uses_state(simulation: &Simulation, arguments: &[Expr]) -> bool {
    arguments.iter().any(|a| !contains_memory(a) && simulation.states.iter().any(|s| a.uses(&s.name)))
}

fn contains_memory(expr: &Expr) -> bool {
    let mut found = false;
    expr.visit(&mut |e| found |= matches!(e, Expr::Memory(Memory::Lag | Memory::Delay, _)));
    found
}

#[cfg(test)]
mod tests {
    use hysid_plant::{Compiled, Drive, Run};

    use super::*;

    /// A pendulum under a torque in steps, emulated by Euler's method, against its equations and against the variant.
    #[test]
    fn what_explicit_steps_do_is_followed_but_for_a_tenth() {
        let (h, n) = (0.01, 2000);
        let text = "[time]\nperiod_s = 0.01\nhold = \"zero\"\n[inputs]\nu = \"u_Nm\"\n[parameters]\nb = { value = 0.4, min = 0.0 }\n[states]\n\
                    q = { derivative = \"w\", initial = 0.0 }\nw = { derivative = \"u - 9*sin(q) - b*w\", initial = 0.0 }\n[outputs]\nq_rad = \"q\"\n";
        let simulation = Simulation::parse(text, "pendulum.sim.toml").unwrap();
        let u: Vec<f64> = (0..n).map(|i| if (i / 150) % 2 == 0 { 3.0 } else { -2.0 }).collect();
        let compare = |parts: usize, variant: &Simulation| {
            let (mut q, mut w) = (0.0_f64, 0.0_f64);
            let step = h / parts as f64;
            let emulated = u.iter().map(|u| {
                let now = q;
                for _ in 0..parts {
                    (q, w) = (q + step * w, w + step * (u - 9.0 * q.sin() - 0.4 * w));
                }
                now
            });
            let emulated: Vec<f64> = emulated.collect();
            let off = |simulation: &Simulation| {
                let compiled = Compiled::new(simulation).unwrap();
                let drive = Drive::new(0.0, h, n, vec![u.clone()]).unwrap();
                let run = compiled.simulate(&Run::new(&drive, &compiled.theta()));
                run.outputs[0].iter().zip(&emulated).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
            };
            assert!(off(variant) < 0.1 * off(&simulation), "{} {}", off(variant), off(&simulation));
        };
        compare(1, &explicit(&simulation, Expr::Number(h)).unwrap());
        // The length that the fit starts from is a quarter.
        compare(4, &shorter(&simulation, h).unwrap());
    }
}
