//! Hysteresis of an actuator whose loop widens with the rate.

use super::plays::Plays;
use crate::mechanism::{Block, Family, Grid, Mechanism, Need, Purpose, anywhere, log_grid};
use crate::slot::Place;

/// Hysteresis of an actuator whose loop widens with the rate.
pub static RATE_DEPENDENT_HYSTERESIS: Mechanism = Mechanism {
    id: "rate_dependent_hysteresis",
    family: Family::ActuatorHysteresis,
    block: Block::Hysteresis,
    places: &[Place::Input],
    applies: anywhere,
    already: &["lag(play(u, R), P)"],
    law: |_, purpose| {
        // Plays in series with a lag do to first order what thresholds that grow with the rate do, each play by a lag of its own where they
        // grow in proportion; only sharp recordings tell the difference. The rate is that of the way from the sample before: a central
        // difference is nearly blind to what turns at every sample, and such inputs widen the loop most.
        let plays = Plays(purpose);
        let wide = |r: &str| format!("play(u, {r}*(1 + lambda*abs(u - delay(u, h_u))/h_u))");
        match purpose {
            Purpose::Screening | Purpose::Refit => plays
                .law(plays.sum(|r| format!("lag(play(u, {r}), tau)")))
                .shape("tau", "h", log_grid(0.5, 50.0, 4))
                .within(0.05, 1000.0),
            Purpose::Form(_) => plays
                .law(plays.sum(wide))
                .shape("lambda", "h/u", Grid::Values(vec![0.5, 5.0]))
                .within(0.0, 1000.0)
                .constant("h_u", "h", Grid::Values(vec![1.0])),
        }
    },
    contains: &["prandtl_ishlinskii", "backlash"],
    confusable: &["prandtl_ishlinskii", "actuator_lag", "viscoelastic"],
    needs: &[Need::Turns(12), Need::Band(4.0)],
    sentence: "The actuator {place} has a hysteresis loop that widens with the rate: its plays carry {share} of the gain[ and lag by {tau}].",
    signature: "The loop widens with the frequency but does not vanish at slow rates.",
    reference: "M. Al Janaideh, S. Rakheja, C.-Y. Su, An analytical generalized Prandtl-Ishlinskii model inversion, IEEE/ASME Trans. Mechatron. 16 (2011) 734-744; W. T. Ang, P. K. Khosla, C. N. Riviere (2007)",
};
