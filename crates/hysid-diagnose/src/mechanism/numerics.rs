//! The simulation's own numerics as the cause of a mismatch: not a rewriting at a slot but a set of variants to compare.
//!
//! Step size, the value of an input between samples, half a sample of time shift and the sharpness of a smoothed friction
//! law change a simulation without any physics. If a variant fits the recording clearly better than the calibrated baseline,
//! that is to be said before physics is blamed.

use hysid_plant::{Expr, Function, Hold, Memory, Simulation};

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

/// The place of a smoothed friction law taken by one that sticks.
const STICKS: &str = "friction that sticks in the place of a smoothed law";
/// A smoothed friction law made sharper, which can be done again.
pub const SHARPER: &str = "smoothed friction three times as sharp";

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
        Hold::Zero => "inputs held between samples",
        Hold::Linear => "inputs interpolated between samples",
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

fn uses_state(simulation: &Simulation, arguments: &[Expr]) -> bool {
    arguments.iter().any(|a| !contains_memory(a) && simulation.states.iter().any(|s| a.uses(&s.name)))
}

fn contains_memory(expr: &Expr) -> bool {
    let mut found = false;
    expr.visit(&mut |e| found |= matches!(e, Expr::Memory(Memory::Lag | Memory::Delay, _)));
    found
}
