//! Backlash, and how a play begins.

mod backlash;

pub use backlash::BACKLASH;

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
