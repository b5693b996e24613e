//! What a stop does beside its stiffness: it damps as long as it is touched, and never pulls.
//!
//! References: K. H. Hunt, F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. Appl. Mech. 42 (1975) 440-445
//! (the damping grows with the depth); W. Goldsmith, Impact, Arnold (1960) (a spring and a dashpot side by side).

use crate::mechanism::{Form, Grid, Law, Purpose};
use crate::slot::Slot;

/// How the contact of a stop is written.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Contact {
    /// A spring.
    Spring,
    /// A spring whose force grows with the speed of approach.
    Growing,
    /// A spring with a dashpot beside it.
    Dashpot,
}

impl Contact {
    /// At a slot that has a velocity the forms have a damping.
    pub(super) fn of(slot: &Slot, purpose: Purpose) -> Self {
        match purpose {
            Purpose::Form(Form::Finer) if slot.has("v") => Self::Growing,
            Purpose::Form(Form::Other) if slot.has("v") => Self::Dashpot,
            _ => Self::Spring,
        }
    }

    /// The depth of the contact where there is one, and what the speed of approach makes of it.
    pub(super) fn pressed(self, depth: &str, approach: &str) -> String {
        match self {
            Self::Spring => format!("max({depth}, 0)"),
            Self::Growing => format!("max({depth}, 0)*max(1 + chi*({approach}), 0)"),
            Self::Dashpot => format!("step({depth})*max({depth} + tau_c*({approach}), 0)"),
        }
    }

    /// The law with the parameter of the damping.
    pub(super) fn law(self, law: Law) -> Law {
        match self {
            Self::Spring => law,
            Self::Growing => law.shape("chi", "1/v", Grid::Values(vec![0.02, 0.3])).within(0.0, 20.0),
            Self::Dashpot => law.shape("tau_c", "x/v", Grid::Values(vec![0.003, 0.05])).within(0.0, 3.0),
        }
    }
}
