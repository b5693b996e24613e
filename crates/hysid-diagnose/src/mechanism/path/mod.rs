//! Delay and lag of the signal path: one family, for on a linear plant nothing tells them apart.

mod actuator_lag;
mod delay;
mod sensor_lag;

pub use actuator_lag::ACTUATOR_LAG;
pub use delay::DELAY;
pub use sensor_lag::SENSOR_LAG;

use super::{Form, Law, Purpose, log_grid};

/// Shortest time constant of a lag that is written as a state, in samples: the integration must follow it.
pub(super) const FASTEST: f64 = 0.4;

/// Shortest time constant of a lag, in samples: under a held input a hundredth of a sample still shows.
pub(super) const SHORTEST: f64 = 0.001;

/// A first-order lag of `signal`, settled at the first sample; in its finer form it starts where the recording says, as after switching on.
fn first_order(signal: &str, purpose: Purpose) -> Law {
    let law = match purpose {
        Purpose::Screening => Law::replace(format!("{signal} + w*(lag({signal}, tau) - {signal})")).weight(),
        Purpose::Form(Form::Finer) => {
            Law::replace("s_l").state("s_l", signal, format!("({signal} - s_l)/tau")).starting_free()
        }
        Purpose::Refit | Purpose::Form(_) => Law::replace(format!("lag({signal}, tau)")),
    };
    let fastest = if purpose == Purpose::Form(Form::Finer) { FASTEST } else { SHORTEST };
    law.shape("tau", "h", log_grid(0.5, 50.0, 6)).within(fastest, 2000.0)
}
