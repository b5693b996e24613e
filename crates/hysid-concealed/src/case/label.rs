//! The label of a case: what is concealed, in the words of the catalogue, and where it may rightly be found.

use serde::Serialize;

use crate::body::Kind;
use crate::design::Design;
use crate::excite::Excitation;
use crate::input::Hold;
use crate::law::{Effect, Law, Place};
use crate::noise::Noise;

/// What sort of case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, PartialOrd, Ord, Hash)]
#[serde(rename_all = "snake_case")]
pub enum Group {
    /// Nothing is missing.
    Control,
    /// One effect of the catalogue.
    Single,
    /// Two effects of different families.
    Pair,
    /// Three effects of different families.
    Triple,
    /// One effect that the catalogue does not have.
    Outside,
}

/// One concealed effect as the label tells it.
#[derive(Debug, Clone, Serialize)]
pub struct Concealed {
    /// Mechanism.
    pub mechanism: &'static str,
    /// Family.
    pub family: &'static str,
    /// Slots that are right: the true one first, then those that no recording of this plant can tell from it.
    pub slots: Vec<String>,
    /// Mechanisms (with family) that are the same law on this plant.
    pub same: Vec<(&'static str, &'static str)>,
    /// Parameters by name.
    pub parameters: Vec<(&'static str, f64)>,
}

/// The label of a case.
#[derive(Debug, Clone, Serialize)]
pub struct Label {
    /// Name of the folder.
    pub id: String,
    /// Sort of case.
    pub group: Group,
    /// Plant.
    pub plant: Kind,
    /// Excitation of the estimation record.
    pub excitation: Excitation,
    /// Course of the command between samples.
    pub hold: Hold,
    /// Samples to estimate from.
    pub samples: usize,
    /// Sampling period in seconds.
    pub period: f64,
    /// Kind of noise.
    pub noise: Noise,
    /// Noise over rms of the output.
    pub noise_level: f64,
    /// Standard deviation of the noise on each output.
    pub sigma: Vec<f64>,
    /// Bits of the converter.
    pub bits: u32,
    /// Difficulty asked for; 0 for a control.
    pub dnr_asked: f64,
    /// Difficulty reached.
    pub dnr: f64,
    /// What is concealed.
    pub effects: Vec<Concealed>,
    /// True parameters of the plant.
    pub theta: Vec<(&'static str, f64)>,
    /// Parameters that the simulation file declares.
    pub declared: Vec<(&'static str, f64)>,
    /// Draws that were thrown away before this one.
    pub rejected: usize,
}

/// The label of an effect.
pub(super) fn concealed(design: &Design, e: &Effect) -> Concealed {
    let kind = design.kind;
    let input = format!("input:{}", kind.input_symbol());
    let output = format!("output:{}", kind.outputs()[0]);
    let plant = kind.plant_slot(e.dof);
    let mut slots = vec![match e.law.place() {
        Place::Input => input.clone(),
        Place::Plant => plant.clone(),
        Place::Parameter => format!("parameter:{}", kind.parameters()[e.theta]),
        Place::Output => output.clone(),
        Place::Disturbance => "disturbance".into(),
    }];
    let rubs = matches!(kind, Kind::Drive | Kind::ClosedDrive);
    let linear = !matches!(kind, Kind::Drive | Kind::ClosedDrive | Kind::Pendulum | Kind::Wing);
    // Linear time-invariant blocks commute: before or after a linear plant is the same thing.
    let commutes = matches!(
        e.law,
        Law::Delay | Law::ActuatorLag | Law::SensorLag | Law::LogCreep | Law::InputOffset | Law::OutputOffset
    );
    if linear && commutes && !kind.prescribed() {
        slots.extend([input.clone(), output]);
    }
    let forced = rubs && e.law == Law::AsymmetricFriction;
    if forced || matches!(e.law, Law::InputOffset | Law::BackEmf) || (linear && e.law == Law::OutputOffset) {
        slots.extend([input, plant]);
    }
    let mut unique: Vec<String> = Vec::new();
    for s in slots {
        if !unique.contains(&s) {
            unique.push(s);
        }
    }
    let same = match e.law {
        // On a plant that slides with F_c sgn v, friction that differs by 2 F_a between the directions is F_c sgn v and the constant force
        // F_a, sticking included: the same machine as with an offset of the command.
        Law::AsymmetricFriction if rubs => vec![("input_offset", "bias")],
        Law::InputOffset if rubs => vec![("asymmetric_friction", "dry_friction")],
        // Dahl's law is Bouc and Wen's with gamma = 0 and n = 1.
        Law::Dahl => vec![("bouc_wen", "hysteretic_spring")],
        // Relays whose weight depends on the distance of their thresholds only are a sum of plays; skewed ones are Preisach's model as it
        // stands in the books.
        Law::Preisach => vec![("prandtl_ishlinskii", "actuator_hysteresis")],
        Law::AsymmetricHysteresis => vec![("preisach", "actuator_hysteresis")],
        Law::SquareRootDamping => vec![("power_law_damping", "nonlinear_damping")],
        Law::InputOffset if linear => vec![("output_offset", "bias")],
        Law::OutputOffset if linear => vec![("input_offset", "bias")],
        Law::ActuatorLag if linear => vec![("sensor_lag", "signal_path_lag")],
        Law::SensorLag if linear => vec![("actuator_lag", "signal_path_lag")],
        _ => Vec::new(),
    };
    Concealed {
        mechanism: e.law.name(),
        family: e.law.family(),
        slots: unique,
        same,
        parameters: e.law.parameters().iter().copied().zip(e.p.iter().copied()).collect(),
    }
}
