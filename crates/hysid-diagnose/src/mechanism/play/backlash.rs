//! Backlash in the drive, the transmission or the sensor's coupling.

use crate::mechanism::{Block, Family, Grid, Law, Mechanism, Need, Purpose, log_steps};
use crate::slot::Place;

/// Backlash in the drive, the transmission or the sensor's coupling.
pub static BACKLASH: Mechanism = Mechanism {
    id: "backlash",
    family: Family::Play,
    block: Block::Hysteresis,
    places: &[Place::Input, Place::Between, Place::Sensor, Place::Connection],
    applies: |slot| slot.place != Place::Connection || slot.has("k"),
    already: &["play(u, R)", "play(u + P, R)", "play(y, R)", "max(min(x, P), Q)"],
    law: |slot, purpose| {
        let signal = match slot.place {
            Place::Input | Place::Between => "u",
            Place::Sensor => "y",
            // Between two masses the dead-zone form: no force inside the gap of the coupling.
            _ => {
                let gap = Grid::Reach("x", log_steps(0.02, 0.7, 6));
                return match purpose {
                    Purpose::Screening => Law::force("-w*k*max(min(x, r), -r)").weight().shape("r", "x", gap),
                    Purpose::Refit | Purpose::Form(_) => {
                        Law::force("-k*max(min(x, r), -r)").shape("r", "x", gap).within(0.0, 3.0).neutral(0.0)
                    }
                };
            }
        };
        let width = Grid::Reach(signal, log_steps(0.005, 0.5, 6));
        match purpose {
            Purpose::Screening => {
                Law::replace(format!("{signal} + w*(play({signal}, r) - {signal})")).weight().shape("r", signal, width)
            }
            Purpose::Refit | Purpose::Form(_) => {
                Law::replace(format!("play({signal}, r)")).shape("r", signal, width).within(0.0, 3.0).neutral(0.0)
            }
        }
    },
    contains: &[],
    confusable: &["delay", "coulomb_friction", "quantisation", "spring_clearance"],
    needs: &[Need::Turns(6)],
    sentence: "There is backlash {place}: {r} to each side; the simulation has none.",
    signature: "Flat stretches at every turning point; a phase lag that does not depend on the frequency and grows as the amplitude falls.",
    reference: "M. Nordin, P.-O. Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38 (2002) 1633-1649",
};
