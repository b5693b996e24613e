//! Screening beside parameters that stand at a bound.
//!
//! A parameter that is pressed against its bound can go no further, but its tangent does, and takes up what resembles it: a voltage that a motion induces
//! in a winding is damping, and where the simulation's damping is at its largest, nothing is left of the feature beside that tangent. So what could be
//! missing is looked for once more without the tangents of such parameters.
//!
//! These scores hold what another bound would explain, and take part in no test. They say what is fitted, and where from; the fits, which keep the
//! bounds, decide.

use super::candidate::{Candidate, Columns, promising};
use crate::evidence::{FeatureGroup, Projector, norm2, score};
use crate::model::base::Base;
use crate::model::hypothesis::{Hypothesis, Setting};

/// Score of the tangents of parameters at a bound from which they are pressed against it.
const PRESSED: f64 = 10.0;

/// What could be missing around a hypothesis and promises most where parameters at a bound stay there; none where no parameter is pressed against one.
pub fn within_bounds(setting: &Setting<'_>, h: &Hypothesis<'_>) -> Vec<Candidate> {
    let Some(evidence) = beside_what_moves(&h.base) else { return Vec::new() };
    promising(setting.lacking(h, &evidence, Columns::Dropped))
}

/// The evidence beside the tangents of the parameters that can still move; `None` where those of parameters at a bound would explain no more than chance.
fn beside_what_moves(base: &Base<'_>) -> Option<(Projector, Vec<f64>)> {
    let (at_bound, moving): (Vec<usize>, Vec<usize>) = (0..base.fit.theta.len()).partition(|&i| base.fit.at_bound[i]);
    if at_bound.is_empty() {
        return None;
    }
    let (own, r) = base.evidence_beside(&base.whitener, moving);
    let columns: Vec<Vec<f64>> = at_bound.into_iter().map(|i| base.fit.jacobian[i].clone()).collect();
    let held = FeatureGroup::new(&columns, &base.model.data().layout, &base.whitener, &own)?;
    let pressed = score(norm2(&r), held.explained(&r), r.len(), held.columns.len()) > PRESSED;
    pressed.then_some((own, r))
}

#[cfg(test)]
mod tests {
    use hysid_plant::{Compiled, Drive, Expr, Run, Simulation};

    use super::*;
    use crate::budget::Budget;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{drive, normal, rms};

    /// What is found around a shaker whose motion induces a voltage in its coil, where the damping that stands in for it may be this large.
    fn found(largest: f64) -> Vec<(&'static str, String)> {
        let text = format!(
            "[time]\nperiod_s = 0.002\n[inputs]\nu = \"amp_V\"\n[parameters]\nR = {{ value = 2.0, min = 0.5, max = 8.0, unit = \"ohm\" }}\n\
             c = {{ value = 9.0, min = 1.0, max = {largest}, unit = \"N s/m\" }}\nk = {{ value = 7000.0, min = 1000.0, max = 20000.0, unit = \"N/m\" }}\n[states]\n\
             i = {{ derivative = \"(u - R*i)/0.001\", initial = 0.0, unit = \"A\" }}\nx = {{ derivative = \"v\", initial = 0.0, unit = \"m\" }}\n\
             v = {{ derivative = \"(14*i - c*v - k*x)/0.6\", initial = 0.0, unit = \"m/s\" }}\n[outputs]\ntable_mm = \"1000*x\"\n"
        );
        let original = Simulation::parse(&text, "shaker.sim.toml").unwrap();
        let mut truth = original.clone();
        let coil = truth.state_mut("i").unwrap();
        coil.derivative = Expr::parse("(u - R*i - 6*v)/0.001").unwrap();
        let mut random = normal(4);
        let u = drive(1500, &mut random);
        let compiled = Compiled::new(&truth).unwrap();
        let run = Drive::new(0.0, 0.002, u.len(), vec![u.clone()]).unwrap();
        let mut y = compiled.simulate(&Run::new(&run, &compiled.theta()).with_substeps(8)).outputs.swap_remove(0);
        let noise = 0.01 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * random());
        let data = recorded(&original, 0.002, [("amp_V", u), ("table_mm", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        within_bounds(&setting, &none).into_iter().map(|c| (c.mechanism.id, c.slot.label)).collect()
    }

    #[test]
    fn what_a_bound_keeps_from_being_absorbed_is_found() {
        let narrow = found(20.0);
        assert!(narrow.contains(&("back_emf", "state:i".to_owned())), "{narrow:?}");
        // The damping takes nearly all of it where it may.
        assert!(found(200.0).is_empty());
    }
}
