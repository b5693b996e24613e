//! An input that does nothing while it is small.

use crate::mechanism::{Amplitudes, Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, anywhere, log_steps};
use crate::slot::Place;

/// An input that does nothing while it is small.
pub static DEAD_ZONE: Mechanism = Mechanism {
    id: "dead_zone",
    family: Family::InputNonlinearity,
    block: Block::Input,
    places: &[Place::Input, Place::Prescribed, Place::Between, Place::Command],
    applies: anywhere,
    already: &["max(min(u, P), Q)", "max(u - P, 0)"],
    law: |_, purpose| {
        let width = Grid::Reach("u", log_steps(0.01, 0.5, 5));
        let missing = |law: Law, name: &str| law.shape(name, "u", width.clone()).within(0.0, 3.0).neutral(0.0);
        let held = |text: &str| missing(Law::replace(text), "d_z");
        match purpose {
            Purpose::Screening => Law::replace("u - w_p*max(min(u, d_z), 0) - w_n*min(max(u, -d_z), 0)")
                .weights(&["w_p", "w_n"])
                .shape("d_z", "u", width)
                .with_amplitudes(Amplitudes::OfTwoSides),
            // A spool that overlaps on one side, or more on one than on the other.
            Purpose::Form(Form::Other) => held("u - max(min(u, d_z), 0)"),
            Purpose::Form(Form::Few) => held("u - min(max(u, -d_z), 0)"),
            Purpose::Form(Form::Finer) => missing(held("u - max(min(u, d_z), -d_n)"), "d_n"),
            Purpose::Refit | Purpose::Form(_) => held("u - max(min(u, d_z), -d_z)"),
        }
    },
    contains: &[],
    confusable: &["coulomb_friction", "input_polynomial"],
    needs: &[Need::Levels("u", 1.3), Need::Below("u", 0.2)],
    sentence: "The input does nothing below {d_z}[ (and {d_n} on the other side)] {place}; the simulation has no dead zone.",
    signature: "No response to small inputs; the missing part of the input is a clipped copy of it.",
    reference: "G. Tao, P. V. Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, Wiley (1996)",
};

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::mechanism::Signals;

    #[test]
    fn what_is_never_small_has_an_offset_and_no_dead_zone() {
        let offered = |u: &[f64]| {
            let signals = Signals::new(0.01, 0.0, BTreeMap::from([("u".to_owned(), u.to_vec())]));
            DEAD_ZONE.is_written_from(&signals)
        };
        assert!(!offered(&[30.0, 70.0, 101.0, 50.0]));
        assert!(!offered(&[-30.0, -70.0, -101.0, -50.0]));
        assert!(offered(&[3.0, 70.0, 101.0, 50.0]));
        // It passes through nothing between two samples.
        assert!(offered(&[-60.0, 70.0, 101.0, 50.0]));
    }
}
