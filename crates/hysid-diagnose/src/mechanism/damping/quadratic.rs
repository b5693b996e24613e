//! Damping by the square of the velocity.

use crate::mechanism::{Block, Family, Law, Mechanism, Need};
use crate::slot::Place;

/// Damping by the square of the velocity.
pub static QUADRATIC_DAMPING: Mechanism = Mechanism {
    id: "quadratic_damping",
    family: Family::NonlinearDamping,
    block: Block::Damping,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("v"),
    already: &["v*abs(v)", "v^2*sign(v)"],
    law: |_, _| Law::force("c_2*v*abs(v)").amplitude("c_2", "F/v^2", 0.0, 2.0),
    contains: &[],
    confusable: &["displacement_dependent_damping", "power_law_damping", "coulomb_friction"],
    needs: &[Need::Levels("v", 1.5)],
    sentence: "A drag that grows with the square of the velocity acts {place}: {c_2}.",
    signature: "Damping proportional to the amplitude; odd harmonics.",
    reference: "J. R. Morison, M. P. O'Brien, J. W. Johnson, S. A. Schaaf, The force exerted by surface waves on piles, J. Pet. Technol. 2 (1950) 149-154",
};
