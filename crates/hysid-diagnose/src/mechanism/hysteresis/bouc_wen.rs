//! A spring with a smooth rate-independent loop.

use crate::mechanism::{Block, Family, Form, Grid, Law, Mechanism, Need, Purpose, log_grid};
use crate::slot::Place;

/// A spring with a smooth rate-independent loop.
pub static BOUC_WEN: Mechanism = Mechanism {
    id: "bouc_wen",
    family: Family::HystereticSpring,
    block: Block::Hysteresis,
    places: &[Place::Force, Place::Connection, Place::ForceLaw],
    applies: |slot| slot.has("x") && slot.has("v") && !slot.loops(),
    already: &[],
    law: |_, purpose| {
        if purpose == Purpose::Form(Form::Other) {
            return stiffening();
        }
        // Wen's law in its normalised form: |z| tends to 1, beta/(beta + gamma) = b.
        Law::force("F_h*z")
            .amplitude("F_h", "F", 0.0, 2.0)
            .shape("x_y", "x", log_grid(0.1, 3.0, 5))
            .elastic()
            .within(0.02, 20.0)
            .at_least(0.2, "v*h")
            .shape("b", "1", Grid::Values(vec![0.5]))
            .within(0.3, 5.0)
            .detail(purpose, "n_z", "1", vec![1.0, 2.0], (1.0, 6.0))
            .relaxing("z", "v - abs(z)^(n_z - 1)*(b*abs(v)*z + (1 - b)*v*abs(z))", "x_y")
            .report("k_h", "F/x", "F_h/x_y")
            .report("gamma_over_beta", "1", "(1 - b)/b")
    },
    contains: &["dahl_friction"],
    confusable: &["dahl_friction", "viscoelastic", "cubic_stiffness"],
    needs: &[Need::Reversals("v", 6), Need::Levels("x", 1.5)],
    sentence: "A hysteretic spring acts {place}: it yields over {x_y} at {F_h}; the simulation has no such loop.",
    signature: "A loop that stays at any rate; softening; damping and stiffness depend on the amplitude.",
    reference: "Y.-K. Wen, Method for random vibration of hysteretic systems, J. Eng. Mech. Div. 102 (1976) 249-263; F. Ikhouane, J. Rodellar, Systems with Hysteresis, Wiley (2007)",
};

/// Wen's law where `beta + gamma < 0`: the loop stiffens on loading and z has no bound. In its normal form the sum is -1, so that `b = -beta/(beta + gamma)`.
fn stiffening() -> Law {
    Law::force("F_h*z")
        .amplitude("F_h", "F", 0.0, 20.0)
        .shape("x_y", "x", log_grid(1.0, 10.0, 3))
        .within(0.2, 50.0)
        .shape("b_s", "1", Grid::Values(vec![0.5, 2.0]))
        .within(0.0, 20.0)
        .relaxing("z", "v - b_s*abs(v)*z + (1 + b_s)*v*abs(z)", "x_y")
        .report("k_h", "F/x", "F_h/x_y")
        .report("gamma_over_beta", "1", "-(1 + b_s)/b_s")
}

#[cfg(test)]
mod tests {
    use hysid_plant::{Compiled, Drive, Run, Simulation};

    use super::*;
    use crate::mechanism::conformance::example_signals;
    use crate::slot::Structure;

    /// Along one branch the law is linear in z over the displacement: closed form on a first loading and on the unloading behind it.
    #[test]
    fn a_stiffening_loop_follows_its_closed_form() {
        let text = "[time]\nperiod_s = 0.001\n[inputs]\nx = \"x_m\"\n[parameters]\nk = { value = 0.0, min = -1.0 }\n[outputs]\nF_N = \"k*x\"\n";
        let simulation = Simulation::parse(text, "loop.sim.toml").unwrap();
        let slot = BOUC_WEN.slots(&Structure::of(&simulation)).remove(0);
        let signals = example_signals(&simulation, &slot);
        let purpose = Purpose::Form(Form::Other);
        let mut written = BOUC_WEN.rewrite(&simulation, &slot, &signals, purpose).unwrap().simulation;
        let (x_y, b) = (0.5, 0.7);
        for (name, value) in [("F_h", 1.0), ("x_y", x_y), ("b_s", b), ("s_h", 0.0)] {
            written.parameter_mut(name).unwrap().value = value;
        }
        let n = 2000;
        let x: Vec<f64> = (0..=2 * n).map(|i| if i <= n { i as f64 } else { (2 * n - i) as f64 } / n as f64).collect();
        let compiled = Compiled::new(&written).unwrap();
        let drive = Drive::new(0.0, 0.001, x.len(), vec![x.clone()]).unwrap();
        let force = compiled.simulate(&Run::new(&drive, &compiled.theta())).outputs.swap_remove(0);
        let top = (1.0 / x_y).exp() - 1.0;
        let back = 1.0 + 2.0 * b;
        // Beyond the middle the unloading is a loading to the other side.
        let middle = 1.0 - x_y * (1.0 + back * top).ln() / back;
        for (i, (x, f)) in x.iter().zip(force).enumerate() {
            let exact = if i <= n {
                (x / x_y).exp() - 1.0
            } else if *x < middle {
                1.0 - ((middle - x) / x_y).exp()
            } else {
                ((1.0 + back * top) * (back * (x - 1.0) / x_y).exp() - 1.0) / back
            };
            assert!((f - exact).abs() < 0.01 * top, "at {i}: {f} for {exact}");
        }
    }
}
