//! How much a deviation grows in a free run: an unstable plant that only a controller behind the recorded input holds follows no recording by itself.

use hysid_plant::Direction;

use super::{Model, Values};

/// Share of a recording at either end by which the growth is measured.
const END: f64 = 0.1;
/// Growth beyond which no free run means anything: what noise leaves open of the initial state, and any force that was not recorded, is as large as the
/// output by the end.
const HOPELESS: f64 = 1e6;

impl Model<'_> {
    /// The factor by which a small deviation of the initial state grows from the first tenth of a recording to the last, in the output where it
    /// grows most; 0 where none is seen, infinite where the simulation explodes.
    pub fn growth(&self, theta: &[f64]) -> f64 {
        let parameters = self.parameters(theta, &[]);
        let directions: Vec<Direction<'_>> = (0..self.simulation().states.len()).map(Direction::Initial).collect();
        let of_stretch = |stretch: usize| {
            let start = self.start_of(stretch, theta);
            let found = self.compiled.sensitivities(&self.run_of(stretch, &parameters, &start), &directions);
            if found.response.diverged.is_some() {
                return f64::INFINITY;
            }
            let ratios = found.tangents.iter().flatten().map(|tangent| late_over_early(tangent));
            ratios.fold(0.0, f64::max)
        };
        (0..self.data.stretches.len()).map(of_stretch).fold(0.0, f64::max)
    }

    /// Whether that is so much that the free run follows no recording by itself, with these unknowns or as the file is.
    pub fn runs_away(&self, theta: &[f64]) -> bool {
        self.growth(theta) > HOPELESS || self.growth(&self.theta(&Values::default())) > HOPELESS
    }
}

/// The largest value at the end over that at the beginning; 0 where nothing is there at the beginning.
fn late_over_early(series: &[f64]) -> f64 {
    let n = ((END * series.len() as f64).ceil() as usize).min(series.len());
    let size = |part: &[f64]| part.iter().fold(0.0_f64, |a, x| if x.is_nan() { f64::INFINITY } else { a.max(x.abs()) });
    let (early, late) = (size(&series[..n]), size(&series[series.len() - n..]));
    if early > 0.0 { late / early } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use hysid_plant::{Drive, Simulation};

    use super::*;
    use crate::data::DataSet;

    /// The growth over ten seconds of `x'' = a x - 0.1 x'`.
    fn growth(a: f64) -> f64 {
        let text = format!(
            "[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_N\"\n[parameters]\na = {{ value = {a:?}, fixed = true }}\n[states]\nx = {{ derivative = \"v\", initial = 0.0 }}\nv = {{ derivative = \"u + a*x - 0.1*v\", initial = 0.0 }}\n[outputs]\nx_m = \"x\"\n"
        );
        let simulation = Simulation::parse(&text, "held.sim.toml").unwrap();
        let drive = Drive::new(0.0, 0.01, 1000, vec![vec![0.0; 1000]]).unwrap();
        let data = DataSet::of_drive(drive, vec![vec![0.0; 1000]], 0.01);
        let model = Model::new(&simulation, &data, 2).unwrap();
        model.growth(&model.theta(&Values::default()))
    }

    #[test]
    fn a_pendulum_that_stands_runs_away_and_one_that_hangs_or_drifts_does_not() {
        // It grows as exp(rate t), from the end of the first tenth to the end of the last.
        let rate = |a: f64| -0.05 + (0.0025 + a).sqrt();
        let standing = growth(9.0);
        assert!((standing.ln() / (9.0 * rate(9.0)) - 1.0).abs() < 0.03, "{standing:e}");
        assert!(standing > HOPELESS && growth(1.0) < HOPELESS);
        assert!(growth(-9.0) < 1.0 && growth(0.0) < 12.0, "{} {}", growth(-9.0), growth(0.0));
    }
}
