//! Whether a recording holds the information that each concealed effect is there, and that its law is no simpler one.
//!
//! The limit is that of the whole case: with less than [`LEAST_INFORMATION`] left nobody can tell. A limit that clips a single sample, an
//! offset beside friction that is unequal in the two directions, a pinching that hardly pinches are no tests of a diagnosis.

use super::LEAST_INFORMATION;
use crate::design::Design;
use crate::law::{Effect, Law};
use crate::refit::{Scope, Target, refit};
use crate::strength::Tuned;

const ROUNDS: usize = 10;

/// `N DNR^2` of what is left when these effects, refitted with the plant, stand for the true ones.
fn left(design: &Design, tuned: &Tuned, effects: Vec<Effect>) -> Option<f64> {
    let target = Target { input: &tuned.input, y: &tuned.y };
    let fitted = refit(&design.machine(effects), target, &tuned.sigma, Scope::Effects, false, ROUNDS)?;
    Some(design.samples as f64 * fitted.rms.powi(2))
}

/// Whether each of several effects leaves a trace that the others cannot stand for.
pub(super) fn all_needed(design: &Design, tuned: &Tuned) -> bool {
    let effects = &tuned.machine.effects;
    effects.len() < 2
        || (0..effects.len()).all(|i| {
            let mut others = effects.clone();
            others.remove(i);
            left(design, tuned, others).is_none_or(|l| l >= LEAST_INFORMATION)
        })
}

/// Simpler laws of the catalogue that effects cannot be told from in this recording beside the others, refitted, where their laws have one as a
/// special case: place of the effect, and the law.
pub(super) fn simpler(design: &Design, tuned: &Tuned) -> Vec<(usize, Law)> {
    let effects = &tuned.machine.effects;
    let imitated = |(i, e): (usize, &Effect)| {
        let other = special_case(e)?;
        let law = other.law;
        let mut all = effects.clone();
        all[i] = other;
        left(design, tuned, all).filter(|l| *l < LEAST_INFORMATION).map(|_| (i, law))
    };
    effects.iter().enumerate().filter_map(imitated).collect()
}

/// The special case of an effect's law that is a law of its own, with the parameters that they share.
fn special_case(e: &Effect) -> Option<Effect> {
    let (law, p) = match e.law {
        Law::LuGre => (Law::Dahl, vec![e.p[0], e.p[3]]),
        Law::Elastoplastic => (Law::Dahl, vec![e.p[0], e.p[1]]),
        Law::Stribeck if e.p[0] != 0.0 => (Law::Coulomb, vec![e.p[0]]),
        Law::AsymmetricFriction if e.p[0] > 0.0 && e.p[1] > 0.0 => (Law::Coulomb, vec![0.5 * (e.p[0] + e.p[1])]),
        // Made weak, the time constant is a fraction of a sample and the damping of the back-EMF is the drive's own.
        Law::BackEmf => (Law::ActuatorLag, vec![e.p[1]]),
        // With beta alone and an exponent of one.
        Law::BoucWen => (Law::Dahl, vec![e.p[0], e.p[1]]),
        Law::AsymmetricBoucWen | Law::Pinching | Law::Degradation => (Law::BoucWen, e.p[..4].to_vec()),
        _ => return None,
    };
    Some(Effect { law, p, ..e.clone() })
}
