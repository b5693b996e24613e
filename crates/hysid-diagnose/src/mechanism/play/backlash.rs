//! Backlash in the drive, the transmission or the sensor's coupling.

use super::{in_a_coupling, moved_play};
use crate::mechanism::path::with_duration;
use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, log_steps};
use crate::slot::Place;

/// Backlash in the drive, the transmission or the sensor's coupling.
pub static BACKLASH: Mechanism = Mechanism {
    id: "backlash",
    family: Family::Play,
    block: Block::Hysteresis,
    places: &[Place::Input, Place::Between, Place::Command, Place::Sensor, Place::Connection],
    applies: |slot| slot.place != Place::Connection || (slot.has("k") && slot.turns()),
    already: &["play(u, R)", "play(u + P, R)", "play(y, R)", "max(min(x, P), Q)"],
    law: |slot, purpose| {
        let signal = match slot.place {
            Place::Input | Place::Between | Place::Command => "u",
            Place::Sensor => "y",
            _ => return in_a_coupling(slot, purpose, "r"),
        };
        let width = Grid::Reach(signal, log_steps(0.005, 0.5, 6));
        let wide = |text: String| Law::replace(text).shape("r", signal, width.clone()).within(0.0, 3.0).neutral(0.0);
        match purpose {
            Purpose::Screening => {
                Law::replace(format!("{signal} + w*(play({signal}, r) - {signal})")).weight().shape("r", signal, width)
            }
            // In the middle of its band. On a drive that integrates the difference stays.
            Purpose::Form(Form::Unsettled) => with_duration(wide(moved_play(signal, "r", signal))),
            // One that was moving already.
            Purpose::Form(Form::FinerUnsettled) => with_duration(wide(moved_play(signal, "r", "w_s")))
                .shape("w_s", signal, Grid::Values(vec![-2.0, 0.0, 2.0]))
                .within(-10.0, 10.0)
                .silent(),
            Purpose::Refit | Purpose::Form(_) => wide(format!("play({signal}, r)")),
        }
    },
    contains: &[],
    confusable: &["delay", "coulomb_friction", "quantisation", "spring_clearance"],
    needs: &[Need::Turns(6)],
    sentence: "There is backlash {place}: {r} to each side; the simulation has none.",
    signature: "Flat stretches at every turning point; a phase lag that does not depend on the frequency and grows as the amplitude falls.",
    reference: "M. Nordin, P.-O. Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38 (2002) 1633-1649",
};
