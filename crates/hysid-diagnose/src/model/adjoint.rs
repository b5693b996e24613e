//! The adjoint of a simulation: how a sum over its outputs answers to a signal added to each of its inputs, at every sample at once.
//!
//! Forward tangents tell what one signal does to all outputs; the adjoint tells what all signals do to one weighted sum of the outputs, in one run
//! backwards in time. With the weights `W'W e` of a whitened residual, what comes out is the score of a perturbation at each instant: its sums
//! and its periodogram are the scores of every modulation there is.
//!
//! The equations are linearised at each sample and stepped by the (2,2) Pade approximant of their exponential, which is stable however stiff
//! they are and exact to the fourth order. Signals count as held from sample to sample, means of thinned outputs as a single sample: the result serves
//! to find modulations, whose exact responses are then taken forwards.

use nalgebra::DMatrix;

use super::Model;
use crate::evidence::Whitener;

impl Model<'_> {
    /// The score of a signal added to each input at each instant, for each of several whitened residuals: `[residual][input][stretch][sample]`; `None`
    /// where [`Self::by_inputs`] has none.
    pub fn scores(&self, theta: &[f64], noise: &Whitener, residuals: &[Vec<f64>]) -> Option<Vec<Vec<Vec<Vec<f64>>>>> {
        let layout = &self.data.layout;
        let weights: Vec<Vec<f64>> = residuals
            .iter()
            .map(|r| {
                let mut weights = r.clone();
                noise.transpose(layout, &mut weights);
                weights
            })
            .collect();
        self.by_inputs(theta, &weights)
    }

    /// The derivative of `sum v[row] y_hat[row]` by a signal added to each input at each sample, for each of several `v`:
    /// `[v][input][stretch][sample]`; `None` where the run diverges or the equations have no finite linearisation.
    pub fn by_inputs(&self, theta: &[f64], vs: &[Vec<f64>]) -> Option<Vec<Vec<Vec<Vec<f64>>>>> {
        let (responses, diverged) = self.responses(theta);
        if diverged.is_some() {
            return None;
        }
        let simulation = self.simulation();
        let (n, inputs, outputs) = (simulation.states.len(), simulation.inputs.len(), simulation.outputs.len());
        let parameters = self.parameters(theta, &[]);
        let sums = vs.len();
        let mut out = vec![vec![Vec::new(); inputs]; sums];
        for (s, (stretch, response)) in self.data.stretches.iter().zip(&responses).enumerate() {
            // What each output pulls at each sample, by sum.
            let mut pull = vec![DMatrix::<f64>::zeros(outputs, sums); stretch.len()];
            for series in self.data.layout.series.iter().filter(|x| x.stretch == s) {
                for (i, row) in series.rows.clone().enumerate() {
                    let here = &mut pull[series.first + i * self.data.step];
                    vs.iter().enumerate().for_each(|(k, v)| here[(series.output, k)] += v[row]);
                }
            }
            let dt = stretch.drive.period_s();
            let mut score = vec![vec![vec![0.0; stretch.len()]; inputs]; sums];
            let mut costate = DMatrix::<f64>::zeros(n, sums);
            for (k, v) in pull.iter().enumerate().rev() {
                let here = self.beside(&parameters, stretch, response, k);
                let b = DMatrix::from_row_slice(n, inputs, &here.b);
                let c = DMatrix::from_row_slice(outputs, n, &here.c);
                let d = DMatrix::from_row_slice(outputs, inputs, &here.d);
                let step = DMatrix::from_row_slice(n, n, &here.a) * dt;
                let even = DMatrix::identity(n, n) + &step * &step / 12.0;
                let back =
                    if n == 0 { costate.clone() } else { (&even - &step * 0.5).transpose().lu().solve(&costate)? };
                let direct = b.tr_mul(&back) * dt + d.tr_mul(v);
                for (j, column) in direct.column_iter().enumerate() {
                    column.iter().enumerate().for_each(|(i, x)| score[j][i][k] = *x);
                }
                costate = (even + step * 0.5).tr_mul(&back) + c.tr_mul(v);
            }
            if score.iter().flatten().flatten().any(|x| !x.is_finite()) {
                return None;
            }
            out.iter_mut()
                .zip(score)
                .for_each(|(out, score)| out.iter_mut().zip(score).for_each(|(all, s)| all.push(s)));
        }
        Some(out)
    }
}

#[cfg(test)]
mod tests {
    use hysid_linalg::dot;
    use hysid_plant::{Drive, Simulation, Slot};

    use crate::data::DataSet;
    use crate::model::{Model, Values};

    /// The adjoint against forward tangents: of a pulse, and of a slow signal, for an oscillator that is softer where it is far out.
    #[test]
    fn the_score_of_a_signal_is_the_inner_product_with_its_response() {
        let text = "[time]\nperiod_s = 0.05\n[inputs]\nu = \"u_N\"\nm = \"m\"\n[parameters]\nk = { value = 9.0, min = 0.0 }\n[states]\nx = { derivative = \"v\", initial = 0.0 }\nv = { derivative = \"u - 0.4*v - k*(1 + m)*x + x^3\", initial = 0.0 }\n[outputs]\nx_m = \"x\"\nf_N = \"k*(1 + m)*x\"\n";
        let simulation = Simulation::parse(text, "test.sim.toml").unwrap();
        let n = 400;
        let u: Vec<f64> = (0..n).map(|i| 2.0 * (0.11 * i as f64).sin() + (0.017 * (i * i) as f64).cos()).collect();
        let drive = Drive::new(0.0, 0.05, n, vec![u, vec![0.0; n]]).unwrap();
        let data = DataSet::of_drive(drive, vec![vec![0.0; n]; 2], 0.05);
        let model = Model::new(&simulation, &data, 4).unwrap();
        let theta = model.theta(&Values::default());
        let v: Vec<f64> = (0..2 * n).map(|i| (0.3 * i as f64).cos() + (1.7 * i as f64).sin()).collect();
        let score = model.by_inputs(&theta, &[vec![0.0; 2 * n], v.clone()]).unwrap().pop().unwrap();
        let size = dot(&score[1][0], &score[1][0]).sqrt();
        for signal in [
            (0..n).map(|i| (-((i as f64 - 150.0) / 4.0).powi(2)).exp()).collect::<Vec<f64>>(),
            (0..n).map(|i| (0.02 * i as f64).cos()).collect(),
            (0..n).map(|i| (0.25 * i as f64).sin()).collect(),
        ] {
            let series = [signal.clone()];
            let forwards = model.responses_to(&theta, &[(Slot::Input(1), &series)]).pop().flatten().unwrap();
            let (a, b) = (dot(&score[1][0], &signal), dot(&v, &forwards));
            let scale = size * dot(&signal, &signal).sqrt();
            assert!((a - b).abs() < 0.03 * scale, "{a} {b} {scale}");
        }
    }
}
