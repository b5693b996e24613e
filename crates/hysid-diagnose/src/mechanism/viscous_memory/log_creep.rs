//! Creep that goes on for decades of time.

use crate::mechanism::path::{emptiness, with_duration};
use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, anywhere};
use crate::slot::Place;

/// Creep that goes on for decades of time.
pub static LOG_CREEP: Mechanism = Mechanism {
    id: "log_creep",
    family: Family::LinearMemory,
    block: Block::Hysteresis,
    places: &[Place::Input, Place::Sensor],
    applies: anywhere,
    already: &["lag(u, P)", "lag(y, P)"],
    law: |slot, purpose| {
        // The logarithm of time as three relaxations, a decade apart until the recording tells how far, or as six.
        let s = if slot.place == Place::Sensor { "y" } else { "u" };
        // An actuator that is switched on has not crept yet.
        let (fresh, settled) = match purpose {
            Purpose::Form(Form::Unsettled) => (true, Purpose::Refit),
            Purpose::Form(Form::FinerUnsettled) => (true, Purpose::Form(Form::Finer)),
            other => (false, other),
        };
        // A sharp one tells the ripple of three from the line of more.
        let more = purpose == Purpose::Form(Form::Spaced);
        let count = if more { 6 } else { 3 };
        let relaxations = (0..count).map(|i| {
            let tau = match i {
                0 => "tau_1".to_owned(),
                1 => "(rho*tau_1)".to_owned(),
                _ => format!("(rho^{i}*tau_1)"),
            };
            if fresh { format!("lag({s}, {tau}) - {}", emptiness(s, &tau)) } else { format!("lag({s}, {tau})") }
        });
        let sum = relaxations.collect::<Vec<_>>().join(" + ");
        let law = Law::replace(format!("{s} + gamma*log10(rho)*({sum} - {count}*{s})"))
            .amplitude("gamma", "1", 0.0, 0.3)
            .shape("tau_1", "T", Grid::Values(vec![0.001, 0.003, 0.01]))
            .within(0.0001, 0.1);
        let law = if more {
            law.shape("rho", "1", Grid::Values(vec![3.0])).within(1.5, 10.0)
        } else {
            law.detail(settled, "rho", "1", vec![10.0], (3.0, 30.0))
        };
        if fresh { with_duration(law) } else { law }
    },
    contains: &[],
    confusable: &["sensor_drift", "parameter_drift", "viscoelastic"],
    needs: &[Need::Rest("u")],
    sentence: "The response {place} creeps on for decades of time: {gamma} per decade.",
    signature: "A slow drift after every step, equal in each decade of time.",
    reference: "H. Jung, D.-G. Gweon, Creep characteristics of piezoelectric actuators, Rev. Sci. Instrum. 71 (2000) 1896-1900",
};
