//! An input with a curved characteristic.

use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, anywhere};
use crate::slot::Place;

/// An input with a curved characteristic.
pub static INPUT_POLYNOMIAL: Mechanism = Mechanism {
    id: "input_polynomial",
    family: Family::InputNonlinearity,
    block: Block::Input,
    places: &[Place::Input, Place::Between, Place::Command],
    applies: anywhere,
    already: &["u^2", "u^3", "u*u", "u*abs(u)"],
    law: |_, purpose| {
        // Through zero; or about the point of operation, where the simulation's gain holds: about zero such a curve has an offset, which
        // would count as an effect of its own.
        let middle = purpose == Purpose::Form(Form::Other);
        let law = Law::replace(if middle { "u + b_2*(u - u_o)^2 + b_3*(u - u_o)^3" } else { "u + b_2*u^2 + b_3*u^3" })
            .amplitude("b_2", "1/u", -1.0, 1.0)
            .amplitude("b_3", "1/u^2", -1.0, 1.0);
        if middle { law.constant("u_o", "u", Grid::SignedQuantiles("u", vec![0.5])) } else { law }
    },
    contains: &[],
    confusable: &["quadratic_stiffness", "input_saturation"],
    needs: &[Need::Levels("u", 1.3)],
    sentence: "The input acts along a curve {place}: a quadratic part of {b_2}, a cubic one of {b_3}.",
    signature: "Even harmonics with the spectrum of the input, filtered by the plant.",
    reference: "S. A. Billings, S. Y. Fakhouri, Identification of systems containing linear dynamic and static nonlinear elements, Automatica 18 (1982) 15-26 (Hammerstein)",
};
