//! A simulation that predicts each row of a recording from those before it: an observer corrects its states at the end of each row.
//!
//! Reference: L. Ljung, System Identification: Theory for the User, 2nd ed. (1999), sec. 4.3 (the innovations form).

use super::{Model, Outputs};
use crate::data::plant::plant_data;

/// What an observer corrects a stretch by.
#[derive(Debug)]
pub(super) struct Corrections {
    /// State by output.
    pub gain: Vec<f64>,
    /// What is measured at the samples at which it corrects.
    pub measured: Outputs,
}

impl Model<'_> {
    /// The same predicting each row from those before: an observer takes what acts on the machine besides its inputs for `strength` times as strong as
    /// these. `None` where no output tells it anything.
    pub fn predicting(self, theta: &[f64], strength: f64) -> Option<Self> {
        let all = plant_data(&self.compiled, self.data)?;
        let parameters = self.parameters(theta, &[]);
        let (responses, _) = self.responses(theta);
        let observers = all.iter().zip(&responses).enumerate().map(|(stretch, (data, response))| {
            let first: Vec<f64> = response.states.iter().map(|x| x.first().copied().unwrap_or(0.0)).collect();
            let gain = self.compiled.observer_gain(data, &parameters, &first, strength);
            Corrections { gain, measured: self.data.last_of_rows(stretch) }
        });
        let observers: Vec<Corrections> = observers.collect();
        observers.iter().any(|o| o.gain.iter().any(|k| *k != 0.0)).then_some(Self { observers, ..self })
    }
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::super::Values;
    use super::super::hypothesis::recorded;
    use super::*;

    /// Rows of one sample and rows of several: what is measured from a row on changes the predictions of those that follow it and of no other.
    #[test]
    fn a_prediction_knows_nothing_of_its_own_row() {
        let text = "[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_N\"\n[parameters]\nc = { value = 2.0, min = 0.1 }\nk = { value = 9.0, min = 0.1 }\n\
                    [states]\nx = { derivative = \"v\", initial = 0.0 }\nv = { derivative = \"u - c*v - k*x\", initial = 0.0 }\n[outputs]\nx_m = \"x\"\n";
        let simulation = Simulation::parse(text, "spring.sim.toml").unwrap();
        let n = 8000;
        let u: Vec<f64> = (0..n).map(f64::from).map(|i| (0.002 * i).sin() + 0.4 * (0.009 * i).cos()).collect();
        let y: Vec<f64> =
            (0..n).map(f64::from).map(|i| 0.1 * (0.002 * i - 0.2).sin() + 0.03 * (0.009 * i).cos()).collect();
        // The same values in another order: the observer's gain rests on their rms.
        let turned = |from: usize| [&y[..from], &y[from..].iter().rev().copied().collect::<Vec<_>>()].concat();
        let predictions = |y: &[f64], thin: bool| {
            let all = recorded(&simulation, 0.01, [("u_N", u.clone()), ("x_m", y.to_vec())]);
            let data = if thin { all.thinned().into_owned() } else { all };
            let model = Model::new(&simulation, &data, 2).unwrap();
            let theta = model.theta(&Values::default());
            let free = model.predict(&theta).unwrap();
            let model = model.predicting(&theta, 0.1).unwrap();
            (data.step, free, model.predict(&theta).unwrap())
        };
        for thin in [false, true] {
            let (step, free, own) = predictions(&y, thin);
            assert_eq!(step > 1, thin);
            assert!(own.iter().zip(&free).any(|(a, b)| (a - b).abs() > 1e-3), "it runs free");
            let row = 500;
            let (_, _, other) = predictions(&turned(row * step - step / 2), thin);
            let parts = own.iter().zip(&other).position(|(a, b)| (a - b).abs() > 1e-9 * (1.0 + a.abs()));
            assert_eq!(parts, Some(row + 1), "rows of {step} samples");
        }
    }
}
