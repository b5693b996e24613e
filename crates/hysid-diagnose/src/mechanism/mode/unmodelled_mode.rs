//! A resonance that the simulation lacks.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need};
use crate::slot::{Place, Rate, Seen};

/// Damping ratio beyond which there is no resonance to speak of, which would be one and a third times its static gain: a broad one beside a first-order
/// plant imitates whatever is slow.
const BROADEST: f64 = 0.4;

/// A resonance that the simulation lacks.
pub static UNMODELLED_MODE: Mechanism = Mechanism {
    id: "unmodelled_mode",
    family: Family::ExtraMode,
    block: Block::Inertia,
    places: &[Place::Force, Place::Sensor, Place::Sensors],
    applies: |slot| slot.inputs() > 0,
    already: &[],
    law: |slot, _| {
        tuned(match slot.place {
            Place::Force => hung_on(slot.has("x"), slot.mass_measure()),
            Place::Sensors => seen_together(slot.seen()),
            _ => seen_alone(slot.inputs()),
        })
    },
    contains: &[],
    confusable: &["delay", "viscoelastic", "periodic_disturbance"],
    needs: &[Need::Band(1.5)],
    sentence: "A resonance near {f_a} is missing {place}.",
    signature: "The residual lives in a narrow band, grows in proportion to the input, and its phase flips there.",
    reference: "D. J. Ewins, Modal Testing: Theory, Practice and Application, 2nd ed. (2000)",
};

/// The law with its frequency and damping. A sharp resonance between two points of the grid shows in neither; a broad one does.
fn tuned(law: Law) -> Law {
    law.shape("f_a", "1/t", Grid::Band(25)).shape("zeta_a", "1", Grid::Values(vec![0.02, 0.15])).within(0.001, BROADEST)
}

/// A mass on a spring that hangs on the moving part: the force that accelerates it is missing there. Where only the velocity of the part is known, the
/// spring's length stands for the two places.
fn hung_on(placed: bool, mass: &str) -> Law {
    let length = if placed { "(x - x_a)" } else { "d_a" };
    let acceleration = format!("(2*pi*f_a)^2*{length} + 4*pi*f_a*zeta_a*(v - v_a)");
    let law = Law::force(format!("m_a*({acceleration})")).amplitude("m_a", mass, 0.0, 5.0);
    if placed {
        law.state("x_a", "x", "v_a").starting_like("x").state("v_a", "x/t", acceleration).starting_like("v")
    } else {
        law.state("d_a", "v*t", "v - v_a").state("v_a", "v", acceleration).starting_like("v")
    }
}

/// The states of a mode of its own beside the plant, at rest where this drives it.
fn beside_the_plant(law: Law, drive: &str, measure: &str) -> Law {
    let acceleration = format!("(2*pi*f_a)^2*({drive} - q_a) - 4*pi*f_a*zeta_a*p_a");
    law.state("q_a", measure, "p_a").state("p_a", format!("{measure}/t"), acceleration)
}

/// A mode of its own that one sensor sees, whatever drives it.
fn seen_alone(inputs: usize) -> Law {
    let drive: Vec<String> = (1..=inputs).map(|i| format!("b_{i}*u_{i}")).collect();
    let law = beside_the_plant(Law::replace("y + q_a"), &drive.join(" + "), "y");
    (1..=inputs).fold(law, |law, i| law.amplitude(format!("b_{i}"), format!("y/u_{i}"), -3.0, 3.0))
}

/// A mode of its own that each of these sensors sees: how much of it depends on where they stand, which derivative on what they measure.
fn seen_together(seen: &[Seen]) -> Law {
    let texts = (1..).zip(seen).map(|(i, seen)| match seen.rate {
        Rate::Displacement => format!("b_{i}*q_a"),
        Rate::Velocity => format!("b_{i}*p_a/(2*pi*f_a)"),
        Rate::Acceleration => format!("b_{i}*(u - q_a - 2*zeta_a*p_a/(2*pi*f_a))"),
    });
    let law = beside_the_plant(Law::outputs(texts.collect()), "u", "u");
    (1..=seen.len()).fold(law, |law, i| law.amplitude(format!("b_{i}"), format!("y_{i}/u"), -3.0, 3.0))
}
