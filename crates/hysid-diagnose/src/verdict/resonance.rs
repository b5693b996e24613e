//! Whether a resonance that is told is one that the simulation has itself.
//!
//! Another way into a mode (a torque of one axis that turns the other too) answers with the frequency and the damping of that mode, as a mode of its own does
//! which only the sensor sees.

use std::f64::consts::TAU;

use crate::mechanism::Family;
use crate::model::base::Base;
use crate::model::force::resonances;
use crate::model::hypothesis::Effect;
use crate::slot::Place;

/// Share of two half-power bandwidths together within which two resonances are one.
const ONE: f64 = 0.25;

/// Whether an effect is a resonance beside the plant that `none`, the simulation without it, has itself, as far as `fitted` knows it.
pub fn is_of_the_simulation(none: &Base<'_>, fitted: &Base<'_>, effect: &Effect) -> bool {
    if effect.mechanism.family != Family::ExtraMode || !matches!(effect.slot.place, Place::Sensor | Place::Sensors) {
        return false;
    }
    let value = |start: &str| {
        let shape = effect.written.shapes.iter().find(|s| s.name.starts_with(start))?;
        fitted.values().parameters.get(&shape.name).copied()
    };
    let (Some(f), Some(zeta)) = (value("f_a"), value("zeta_a")) else { return false };
    let told = [-zeta * TAU * f, (1.0 - zeta * zeta).max(0.0).sqrt() * TAU * f];
    resonances(&none.model, &none.fit.theta).into_iter().any(|own| are_one(own, told))
}

/// Whether two pairs of eigenvalues, by real and imaginary part, are as near as their bandwidths are wide.
fn are_one(a: [f64; 2], b: [f64; 2]) -> bool {
    (a[0] - b[0]).hypot(a[1] - b[1]) < ONE * 2.0 * (a[0].abs() + b[0].abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resonances_are_one_within_their_bandwidths() {
        // Damping ratios of 0.19 and 0.16 at 13.4 and 13.2 rad/s; sharp ones a tenth apart.
        assert!(are_one([-2.5, 13.2], [-2.1, 13.0]));
        assert!(!are_one([-0.1, 10.0], [-0.1, 11.0]) && !are_one([-2.5, 13.2], [-2.5, 26.0]));
    }
}
