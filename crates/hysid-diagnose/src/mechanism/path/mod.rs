//! Delay and lag of the signal path: one family, for on a linear plant nothing tells them apart.

mod actuator_lag;
mod delay;
mod sensor_lag;

pub use actuator_lag::ACTUATOR_LAG;
pub use delay::DELAY;
pub use sensor_lag::SENSOR_LAG;

use super::{Form, Grid, Law, Purpose, log_grid};

/// Shortest time constant of a lag that is written as a state, in samples: the integration must follow it.
pub(super) const FASTEST: f64 = 0.4;

/// Shortest time constant of a lag, in samples: under a held input a hundredth of a sample still shows.
pub(super) const SHORTEST: f64 = 0.001;

/// What a lag of `signal` that is empty at the first sample lacks of one that is settled there. The first value of anything is that value delayed
/// by the whole recording, `T_r`; where the time constant is far below an integration step this is larger than it should be.
pub(super) fn emptiness(signal: &str, tau: &str) -> String {
    format!("delay({signal}, T_r)*exp(-(t - delay(t, T_r))/{tau})")
}

/// The recording's duration as a constant of a law, for [`emptiness`].
pub(super) fn with_duration(law: Law) -> Law {
    law.constant("T_r", "T", Grid::Values(vec![1.0])).silent()
}

/// A first-order lag of `signal`, settled at the first sample; in other forms it is empty there, as after switching on, or starts where the
/// recording says.
fn first_order(signal: &str, purpose: Purpose) -> Law {
    let law = match purpose {
        Purpose::Screening => Law::replace(format!("{signal} + w*(lag({signal}, tau) - {signal})")).weight(),
        Purpose::Form(Form::Finer) => {
            Law::replace("s_l").state("s_l", signal, format!("({signal} - s_l)/tau")).starting_free()
        }
        Purpose::Form(Form::Unsettled) => {
            with_duration(Law::replace(format!("lag({signal}, tau) - {}", emptiness(signal, "tau"))))
        }
        Purpose::Refit | Purpose::Form(_) => Law::replace(format!("lag({signal}, tau)")),
    };
    let fastest = if purpose == Purpose::Form(Form::Finer) { FASTEST } else { SHORTEST };
    law.shape("tau", "h", log_grid(0.5, 50.0, 6)).within(fastest, 2000.0)
}
