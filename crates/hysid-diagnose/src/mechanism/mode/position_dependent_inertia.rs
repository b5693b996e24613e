//! An inertia that depends on the position.

use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose};
use crate::slot::{OWN_VELOCITY, Place, Slot};

/// An inertia that depends on the position.
pub static POSITION_DEPENDENT_INERTIA: Mechanism = Mechanism {
    id: "position_dependent_inertia",
    family: Family::Inertia,
    block: Block::Inertia,
    places: &[Place::Force],
    applies: |slot| {
        (slot.has("turn") || slot.has("x") && slot.has_own_coordinate()) && !slot.shows("x*v^2") && !slot.mass_varies()
    },
    already: &[],
    law: |slot, purpose| {
        // A crank's inertia comes back with each turn, mostly twice, an eccentric arm's once.
        match purpose {
            _ if !slot.has("rad") => with_the_square(slot),
            Purpose::Form(Form::Other) if slot.has("x") => with_the_square(slot),
            Purpose::Screening => {
                let waves = Grid::Waves(angle(slot), vec![2.0, 1.0], 0.5);
                over_the_turn(slot, "n_w").shape("n_w", "1", waves).within(1e-4, 4.0)
            }
            Purpose::Form(Form::Few) => over_the_turn(slot, "1"),
            _ => over_the_turn(slot, "2"),
        }
    },
    contains: &[],
    confusable: &["cubic_stiffness"],
    needs: &[Need::Levels("x", 1.5)],
    sentence: "The moving mass {place} depends on the position[: it grows with the square of the displacement by {m_1}][: it swings by {m_w} to either side as it turns].",
    signature: "The resonance falls with the amplitude, and more at high frequency; what turns is pulled once or twice a turn, more so the faster it turns.",
    reference: "A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, Wiley (1979), sec. 4.2",
};

/// Half the change of the mass with the position, times the squared velocity, is the force that goes with it: that square.
fn squared_velocity(slot: &Slot) -> &'static str {
    if slot.has(OWN_VELOCITY) { "v*v_own" } else { "v^2" }
}

/// The angle in radians.
fn angle(slot: &Slot) -> &'static str {
    slot.angle().unwrap_or("rad*x")
}

/// `m_1*x^2` more.
fn with_the_square(slot: &Slot) -> Law {
    let measure = format!("{}/x^2", slot.mass_measure());
    Law::inertia(format!("m_1*x*{}", squared_velocity(slot)), "m_1*x^2").amplitude("m_1", measure, -0.1, 2.0)
}

/// A wave of so many periods a turn, at any phase, with nothing more where the angle is zero.
fn over_the_turn(slot: &Slot, periods: &str) -> Law {
    let angle = format!("{periods}*{}", angle(slot));
    let force = format!("0.5*{periods}*rad*(m_c*sin({angle}) + m_s*cos({angle}))*{}", squared_velocity(slot));
    Law::inertia(force, format!("m_c*(1 - cos({angle})) + m_s*sin({angle})"))
        .amplitude("m_c", slot.mass_measure(), -0.4, 2.0)
        .silent()
        .amplitude("m_s", slot.mass_measure(), -0.9, 0.9)
        .silent()
        .report("m_w", slot.mass_measure(), "sqrt(m_c^2 + m_s^2)")
}
