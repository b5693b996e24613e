//! A weight: of an arm or a pendulum, or of what rises and falls.

use crate::mechanism::{Block, Family, Form, Law, Mechanism, Need, Purpose};
use crate::slot::Place;

/// A weight: of an arm or a pendulum, or of what rises and falls.
pub static GRAVITY: Mechanism = Mechanism {
    id: "gravity",
    family: Family::Gravity,
    block: Block::Restoring,
    places: &[Place::Force],
    // Where an input acts on the part, a constant force is an offset of that input.
    applies: |slot| slot.angle().is_some() || (!slot.has_constant() && !slot.is_driven()),
    already: &["sin(rad*x)", "sin(x)", "sin(P*x)", "sin(x*P)", "sin(x + P)", "sin(x - P)", "cos(x)", "cos(x + P)"],
    law: |slot, purpose| {
        // What turns and is out of balance is pulled as an arm is.
        let Some(angle) = slot.angle() else { return Law::force("G").amplitude("G", "F", -2.0, 2.0) };
        // An angle is mostly counted from where the arm hangs or from where it is level.
        let one = |name: &str, wave: &str, phase: &str| {
            Law::force(format!("{name}*{wave}({angle})"))
                .amplitude(name, "F", -2.0, 2.0)
                .silent()
                .report("G", "F", format!("abs({name})"))
                .report("phi", "1", phase)
        };
        match purpose {
            Purpose::Form(Form::Other) => return one("G_s", "sin", "atan2(0, G_s)"),
            Purpose::Form(Form::Few) => return one("G_c", "cos", "atan2(G_c, 0)"),
            _ => {}
        }
        // An input may be counted from what holds the arm at the zero of its angle.
        let level =
            if purpose == Purpose::Form(Form::Finer) { format!("(cos({angle}) - 1)") } else { format!("cos({angle})") };
        Law::force(format!("G_s*sin({angle}) + G_c*{level}"))
            .amplitude("G_s", "F", -2.0, 2.0)
            .silent()
            .amplitude("G_c", "F", -2.0, 2.0)
            .silent()
            .report("G", "F", "sqrt(G_s^2 + G_c^2)")
            .report("phi", "1", "atan2(G_c, G_s)")
    },
    contains: &[],
    confusable: &[
        "input_offset",
        "cubic_stiffness",
        "quadratic_stiffness",
        "gap_stop",
        "bilinear_stiffness",
        "position_dependent_inertia",
    ],
    needs: &[Need::Angle(0.3)],
    sentence: "A weight pulls {place}: {G}[ at most, as the sine of the angle plus {phi} rad]; the simulation has none.",
    signature: "For small swings a stiffness and an offset; for large ones softening.",
    reference: "A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, Wiley (1979), ch. 2",
};
