//! Backlash, how a play begins, and the free play of a coupling.

mod backlash;

use super::{Form, Grid, Law, Purpose, log_steps};
use crate::slot::Slot;

pub use backlash::BACKLASH;

/// Why neither name of it is firm.
const ONE_LAW: &str = "between two parts the free play of a spring and the backlash of a coupling are one law";

/// Free play in what connects two parts, in its dead-zone form: no force within this half-width of the middle. A gear has backlash, a spring a clearance, and
/// who looks at a shaft calls it the one or the other.
pub(super) fn in_a_coupling(slot: &Slot, purpose: Purpose, width: &'static str) -> Law {
    let gap = Grid::Reach("x", log_steps(0.02, 0.7, 6));
    let open = |text: String| {
        let law = Law::force(text).shape(width, "x", gap.clone()).within(0.0, 3.0).neutral(0.0);
        law.told_from(f64::INFINITY, "x", ONE_LAW)
    };
    let missing = format!("k*max(min(x, {width}), -{width})");
    match purpose {
        Purpose::Screening => Law::force(format!("-w*{missing}")).weight().shape(width, "x", gap),
        // What damps in the contact of the teeth does nothing between them.
        Purpose::Form(Form::Other) if slot.has("c") => open(format!("-{missing} - c*v*step({width} - abs(x))")),
        Purpose::Refit | Purpose::Form(_) => open(format!("-{missing}")),
    }
}

/// A play of this half-width over `signal`, as text, that an input which came from `from` has moved by the first sample. Of its own a play came from 0: it
/// begins without a width, where that input has left it. The first time is the time delayed by the whole recording, `T_r`.
pub(super) fn moved_play(signal: &str, radius: &str, from: &str) -> String {
    let later = "sign(t - delay(t, T_r))";
    format!("play({signal} + (1 - {later})*max(min({from} - {signal}, {radius}), -{radius}), {radius}*{later})")
}

#[cfg(test)]
mod tests {
    use hysid_plant::{Compiled, Drive, Run, Simulation};

    use super::*;
    use crate::mechanism::conformance::slot_where;
    use crate::mechanism::stiffness::SPRING_CLEARANCE;
    use crate::slot::Place;

    #[test]
    fn between_two_parts_neither_name_is_firm() {
        for mechanism in [&BACKLASH, &SPRING_CLEARANCE] {
            let slot = slot_where(mechanism, |slot| slot.place == Place::Connection).unwrap();
            for (_, law) in mechanism.forms(&slot) {
                let never = law.parameters.iter().filter_map(|p| p.told_from.as_ref()).any(|t| t.1 == f64::INFINITY);
                assert!(never, "{}", mechanism.id);
            }
        }
    }

    /// A play that came from somewhere answers as one whose memory stood there: closed form, sample by sample.
    #[test]
    fn a_moved_play_begins_where_its_memory_stood() {
        let (radius, duration) = (1.5, 2.0);
        let input: Vec<f64> = (0..200).map(|i| 4.0 * (0.07 * f64::from(i) + 1.0).cos()).collect();
        for from in [-9.0, 0.0, 1.9, 2.5, 9.0] {
            let law = moved_play("u", "r", "w_s");
            let text = format!(
                "[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_V\"\n[parameters]\nr = {{ value = {radius}, fixed = true }}\nw_s = {{ value = {from:?}, fixed = true }}\n\
                 T_r = {{ value = {duration}, fixed = true }}\n[outputs]\ny_V = \"{law}\"\n"
            );
            let compiled = Compiled::new(&Simulation::parse(&text, "play.sim.toml").unwrap()).unwrap();
            let drive = Drive::new(3.0, 0.01, input.len(), vec![input.clone()]).unwrap();
            let found = compiled.simulate(&Run::new(&drive, &compiled.theta())).outputs.swap_remove(0);
            let mut memory = from;
            for (u, y) in input.iter().zip(found) {
                memory = f64::min(u + radius, f64::max(u - radius, memory));
                assert!((y - memory).abs() < 1e-12, "from {from} at {u}: {y} for {memory}");
            }
        }
    }
}
