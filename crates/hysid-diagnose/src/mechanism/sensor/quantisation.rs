//! A sensor with coarse steps.

use crate::mechanism::{Amplitudes, Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, anywhere};
use crate::slot::Place;

/// A sensor with coarse steps.
pub static QUANTISATION: Mechanism = Mechanism {
    id: "quantisation",
    family: Family::SensorNonlinearity,
    block: Block::Output,
    places: &[Place::Sensor],
    applies: anywhere,
    already: &["floor(y/P + Q)"],
    law: |_, purpose| match purpose {
        Purpose::Screening => Law::replace("y + w*(q*floor(y/q + 0.5) - y)")
            .weight()
            .shape("q", "y", Grid::Resolution)
            .with_amplitudes(Amplitudes::Share),
        Purpose::Form(Form::Soft) => blurred(),
        Purpose::Refit | Purpose::Form(_) => Law::replace("q*floor(y/q + 0.5)").constant("q", "y", Grid::Resolution),
    },
    contains: &[],
    confusable: &["backlash"],
    needs: &[Need::Steps],
    sentence: "The sensor {place} has steps of {q}; the simulation's output is continuous.",
    signature: "Repeated values; a residual that is uniform within half a step.",
    reference: "B. Widrow, I. Kollár, Quantization Noise, Cambridge University Press (2008)",
};

/// What a converter shows in the mean of a signal with noise of `d_q` steps (rms) before it: a stair whose edges are as wide as the noise, here logistic
/// ones (within a hundredth and a half of a step of those of Gaussian noise). Noise of more than two thirds of a step leaves nothing of the stair.
fn blurred() -> Law {
    let edge = |off: &str| format!("tanh((y/q - floor(y/q) {off})/(1.175*d_q))");
    let edges = ["- 0.5", "- 1.5", "+ 0.5"].map(edge).join(" + ");
    Law::replace(format!("q*(floor(y/q) + 0.5 + 0.5*({edges}))"))
        .constant("q", "y", Grid::Resolution)
        .shape("d_q", "1", Grid::Values(vec![0.15, 0.3]))
        .within(0.03, 0.7)
        .silent()
        .report("n_q", "y", "d_q*q")
}

#[cfg(test)]
mod tests {
    use hysid_plant::{Compiled, Drive, Run, Simulation};
    use statrs::distribution::{ContinuousCDF, Normal};

    use super::*;
    use crate::mechanism::Change;

    /// The mean of a rounded signal under Gaussian noise is the sum over all edges of the share of the noise that passes them.
    #[test]
    fn a_blurred_stair_is_the_mean_of_what_is_rounded() {
        let Change::Replace(law) = blurred().change else { panic!("a sensor's law replaces what it shows") };
        let signal: Vec<f64> = (0..400).map(|i| -1.0 + 0.005 * f64::from(i)).collect();
        for noise in [0.03, 0.1, 0.25, 0.4] {
            let text = format!(
                "[time]\ncolumn = \"t_s\"\n[inputs]\ny = \"y\"\n[parameters]\nq = {{ value = 0.4, fixed = true }}\nd_q = {{ value = {noise}, fixed = true }}\n[outputs]\nshown = \"{law}\"\n"
            );
            let simulation = Simulation::parse(&text, "test.sim.toml").unwrap();
            let drive = Drive::new(0.0, 1.0, signal.len(), vec![signal.clone()]).unwrap();
            let shown = Compiled::new(&simulation).unwrap().simulate(&Run::new(&drive, &[0.4, noise]));
            let before = Normal::new(0.0, noise).unwrap();
            for (y, found) in signal.iter().zip(&shown.outputs[0]) {
                let steps = y / 0.4;
                let passed = |k: i32| before.cdf(steps - f64::from(k) - 0.5) - if k < 0 { 1.0 } else { 0.0 };
                let mean = 0.4 * (-20..20).map(passed).sum::<f64>();
                assert!((found - mean).abs() < 0.015 * 0.4, "{found} for {mean} at {y} under noise of {noise} steps");
            }
        }
    }
}
