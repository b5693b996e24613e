//! The ways of an unknown force to the outputs from row to row, along the trajectory of a simulation that answers it differently as it moves.
//!
//! From one row to the next the equations are those half way between the two; what drives them is held. Where every instant answers alike the mean way says all.

use hysid_plant::Linearisation;
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::Model;
use crate::evidence::{CommonPath, Course, Series, between};

/// Share of its largest size by which a coefficient of the equations changes where they answer differently along the way.
const CHANGES: f64 = 0.1;
/// Size of a step's matrix up to which the approximant of its exponential is taken as it is.
const SMALL: f64 = 0.5;
/// Halvings of a step, at most.
const HALVINGS: i32 = 30;

/// Whether coefficients of the equations change between these instants.
pub fn changes(points: &[Linearisation]) -> bool {
    let differs = |of: fn(&Linearisation) -> &[f64]| {
        let count = points.first().map_or(0, |p| of(p).len());
        (0..count).any(|i| {
            let values = || points.iter().map(|p| of(p)[i]);
            let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            high - low > CHANGES * low.abs().max(high.abs())
        })
    };
    differs(|p| &p.a) || differs(|p| &p.c)
}

/// From one row to the next: the exponential of the equations, and what it makes of something held in each derivative.
struct Step {
    flow: DMatrix<f64>,
    held: DMatrix<f64>,
}

impl Step {
    /// Of `dx/dt = a x` over `dt`, by the (2,2) Pade approximant of halved steps; `None` where it is not finite.
    fn over(a: DMatrix<f64>, dt: f64) -> Option<Self> {
        let n = a.nrows();
        let size = a.abs().row_sum().max() * dt;
        let halvings = (size / SMALL).log2().ceil().max(0.0);
        if !size.is_finite() || halvings > f64::from(HALVINGS) {
            return None;
        }
        let dt = dt / halvings.exp2();
        let z = a * dt;
        let even = DMatrix::identity(n, n) + &z * &z / 12.0;
        let held = (even - &z * 0.5).try_inverse()? * dt;
        let mut step = Self { flow: DMatrix::identity(n, n) + &held * (z / dt), held };
        for _ in 0..halvings as i32 {
            step.held += &step.flow * &step.held;
            step.flow = &step.flow * &step.flow;
        }
        Some(step)
    }
}

/// The equations along the rows of each stretch.
pub struct Along {
    /// Of each stretch: those at its rows, and the steps between them.
    stretches: Vec<(Vec<Linearisation>, Vec<Step>)>,
    states: usize,
    /// Samples of a row.
    step: usize,
}

impl Along {
    /// Of a simulation on its data; `None` where it diverges, or a step is not finite.
    pub fn of(model: &Model<'_>, theta: &[f64]) -> Option<Self> {
        let (responses, diverged) = model.responses(theta);
        let (data, states) = (model.data(), model.simulation().states.len());
        if diverged.is_some() || states == 0 {
            return None;
        }
        let parameters = model.parameters(theta, &[]);
        let period_s = data.row_period_s();
        let stretches = data.stretches.par_iter().zip(&responses).map(|(stretch, response)| {
            let at = |row: usize| {
                let middle = (row * data.step + data.step / 2).min(stretch.len() - 1);
                model.beside(&parameters, stretch, response, middle)
            };
            let points: Vec<Linearisation> = (0..stretch.len().div_ceil(data.step)).map(at).collect();
            let steps = (0..points.len()).map(|row| {
                let next = &points[(row + 1).min(points.len() - 1)];
                let a = DMatrix::from_fn(states, states, |i, j| {
                    0.5 * (points[row].a[i * states + j] + next.a[i * states + j])
                });
                Step::over(a, period_s)
            });
            let steps = steps.collect::<Option<Vec<Step>>>()?;
            Some((points, steps))
        });
        let stretches = stretches.collect::<Option<Vec<_>>>()?;
        Some(Self { stretches, states, step: data.step })
    }

    /// The states by which a force at state `entry` reaches what these outputs show, `None` where it does not.
    fn between(&self, entry: usize, outputs: &[usize]) -> Option<Vec<usize>> {
        let n = self.states;
        let points = || self.stretches.iter().flat_map(|(points, _)| points);
        let moves = |i: usize, j: usize| points().any(|p| p.a[i * n + j] != 0.0);
        let graph: Vec<bool> = (0..n * n).map(|ij| moves(ij / n, ij % n)).collect();
        let shows = |i: usize| points().any(|p| outputs.iter().any(|output| p.c[output * n + i] != 0.0));
        let kept = between(n, entry, |i, j| graph[i * n + j], shows);
        kept.contains(&entry).then_some(kept)
    }

    /// The rows of a series: matrix, force at state `entry`, what each of these outputs shows.
    fn rows(&self, series: &Series, entry: usize, outputs: &[usize], kept: &[usize]) -> Vec<f64> {
        let (n, (points, steps)) = (self.states, &self.stretches[series.stretch]);
        let mut rows = Vec::with_capacity(series.rows.len() * kept.len() * (kept.len() + 1 + outputs.len()));
        for k in 0..series.rows.len() {
            let at = (series.first / self.step + k).min(steps.len() - 1);
            let (step, point) = (&steps[at], &points[at]);
            kept.iter().for_each(|&i| rows.extend(kept.iter().map(|&j| step.flow[(i, j)])));
            rows.extend(kept.iter().map(|&i| step.held[(i, entry)]));
            outputs.iter().for_each(|output| rows.extend(kept.iter().map(|&i| point.c[output * n + i])));
        }
        rows
    }

    /// The way from a force at state `entry` to an output, for each of its series; `None` where the force does not reach it.
    pub fn course(&self, model: &Model<'_>, entry: usize, output: usize) -> Option<Course> {
        let kept = self.between(entry, &[output])?;
        let of_output = model.data().layout.series.iter().filter(|s| s.output == output);
        Course::new(kept.len(), of_output.map(|series| self.rows(series, entry, &[output], &kept)).collect())
    }

    /// The way to all outputs that it reaches, for each run that they recorded together; `None` where these are fewer than two.
    pub fn common(&self, model: &Model<'_>, entry: usize) -> Option<CommonPath> {
        let layout = &model.data().layout;
        let outputs: Vec<usize> = (0..layout.outputs).filter(|&o| self.between(entry, &[o]).is_some()).collect();
        let kept = self.between(entry, &outputs)?;
        let runs = layout.together(outputs.iter().copied());
        let rows = runs.iter().map(|run| (self.rows(run[0], entry, &outputs, &kept), run[0].rows.len()));
        CommonPath::new(entry, outputs.clone(), kept.len(), rows.collect())
    }
}

#[cfg(test)]
mod tests {
    use hysid_plant::Simulation;

    use super::super::Values;
    use super::super::force::noise_of;
    use super::super::hypothesis::recorded;
    use super::*;
    use crate::evidence::Whitener;
    use crate::oscillator::{normal, rms};
    use crate::refit::Problem;
    use hysid_linalg::dot;

    #[test]
    fn a_step_is_the_exponential_and_its_integral() {
        for (a, dt) in [([0.0, 1.0, -900.0, -3.0], 0.05), ([-1.0, 0.4, 0.2, -5000.0], 0.01), ([0.0; 4], 0.1)] {
            let a = DMatrix::from_row_slice(2, 2, &a);
            let step = Step::over(a.clone(), dt).unwrap();
            let whole = DMatrix::from_fn(4, 4, |i, j| match (i, j) {
                (0..2, 0..2) => a[(i, j)] * dt,
                (0..2, _) if j == i + 2 => dt,
                _ => 0.0,
            })
            .exp();
            assert!((whole.view((0, 0), (2, 2)) - &step.flow).abs().max() < 1e-5, "{}", step.flow);
            assert!((whole.view((0, 2), (2, 2)) - &step.held).abs().max() < 1e-5 * dt, "{}", step.held);
        }
        assert!(Step::over(DMatrix::from_element(1, 1, f64::NAN), 0.1).is_none());
        assert!(Step::over(DMatrix::from_element(1, 1, 1e30), 0.1).is_none());
    }

    /// A choke whose iron saturates, with a random voltage that nobody recorded beside the noise of the sensor: what it leaves where the iron is
    /// saturated and where it is not, whitened.
    fn choke(iron: &str) -> (bool, [f64; 2]) {
        let text = format!(
            "[time]\nperiod_s = 0.0002\n[inputs]\nu = \"coil_V\"\n[parameters]\nR = {{ value = 12.0, min = 1.0 }}\n[states]\npsi = {{ derivative = \"u - R*psi*{iron}\", initial = 0.0 }}\n[outputs]\ni_A = \"psi*{iron}\"\n"
        );
        let simulation = Simulation::parse(&text, "choke.sim.toml").unwrap();
        let mut random = normal(5);
        let n = 4000;
        let u: Vec<f64> =
            (0..n).map(|k| 60.0 * (0.04 * f64::from(k)).sin() + 20.0 * (0.13 * f64::from(k)).cos()).collect();
        let pushed: Vec<f64> = u.iter().map(|u| u + 6.0 * random()).collect();
        let answer = |u: Vec<f64>| {
            let data = recorded(&simulation, 0.0002, [("coil_V", u.clone()), ("i_A", u)]);
            let model = Model::new(&simulation, &data, 2).unwrap();
            model.predict(&model.theta(&Values::default())).unwrap()
        };
        let y: Vec<f64> = answer(pushed).iter().map(|y| y + 0.01 * random()).collect();
        let free = answer(u.clone());
        let data = recorded(&simulation, 0.0002, [("coil_V", u), ("i_A", y)]);
        let model = Model::new(&simulation, &data, 2).unwrap();
        let theta = model.theta(&Values::default());
        let residual = model.residual(&theta).unwrap();
        let (noise, _) = noise_of(&model, &theta, &residual, &["psi".to_owned()]);
        let white = noise.apply(&data.layout, &residual);
        let large = rms(&free);
        let side = |beyond: bool| {
            let rows = white.iter().zip(&free).filter(|(_, i)| (i.abs() > large) == beyond);
            rms(&rows.map(|(w, _)| *w).collect::<Vec<f64>>())
        };
        (noise.is_driven(), [side(true), side(false)])
    }

    #[test]
    fn a_force_shows_more_where_the_iron_is_saturated() {
        let (driven, [above, below]) = choke("(1 + (psi/0.26)^6)/0.8");
        assert!(driven && (above / below - 1.0).abs() < 0.1, "{above} {below}");
        let (driven, [above, below]) = choke("1.25");
        assert!(driven && (above / below - 1.0).abs() < 0.1, "{above} {below}");
    }

    /// Two tanks in a row under a random inflow beside the recorded one, each level shown with noise of its own: the state at which a force in common enters, and the
    /// largest correlation of the two whitened levels at lags up to 20, in its standard deviations, by the joint filter and by one for each.
    fn tanks(outflow: &str) -> (Option<usize>, [f64; 2]) {
        let flow = |tank: &str| outflow.replace("h", tank);
        let text = format!(
            "[time]\nperiod_s = 1.0\n[inputs]\nq = \"inflow_L_s\"\n[parameters]\ns = {{ value = 0.5, min = 0.1 }}\n[states]\n\
             h1 = {{ derivative = \"(q - s*{})/8\", initial = 4.0 }}\nh2 = {{ derivative = \"(s*{} - s*{})/5\", initial = 4.0 }}\n[outputs]\na_m = \"h1\"\nb_m = \"h2\"\n",
            flow("h1"),
            flow("h1"),
            flow("h2")
        );
        let simulation = Simulation::parse(&text, "tanks.sim.toml").unwrap();
        let mut random = normal(3);
        let n = 3000;
        let q: Vec<f64> = (0..n).map(|k| 1.0 + 0.6 * (0.02 * f64::from(k)).sin()).collect();
        let pushed: Vec<f64> = q.iter().map(|q| q + 0.2 * random()).collect();
        let answer = |q: Vec<f64>| {
            let data = recorded(&simulation, 1.0, [("inflow_L_s", q.clone()), ("a_m", q.clone()), ("b_m", q)]);
            let model = Model::new(&simulation, &data, 2).unwrap();
            model.predict(&model.theta(&Values::default())).unwrap()
        };
        let levels: Vec<f64> = answer(pushed).iter().map(|h| h + 0.02 * random()).collect();
        let (a, b) = levels.split_at(q.len());
        let data = recorded(&simulation, 1.0, [("inflow_L_s", q), ("a_m", a.to_vec()), ("b_m", b.to_vec())]);
        let model = Model::new(&simulation, &data, 2).unwrap();
        let theta = model.theta(&Values::default());
        let residual = model.residual(&theta).unwrap();
        let (noise, paths) = noise_of(&model, &theta, &residual, &["h1".to_owned(), "h2".to_owned()]);
        assert_eq!(
            paths.common.len(),
            usize::from(noise.common_from().is_some()),
            "it is kept for what is fitted beside it"
        );
        let largest = |noise: &Whitener| {
            let white = noise.apply(&data.layout, &residual);
            let (a, b) = white.split_at(a.len());
            let at =
                |lag: usize| dot(&a[lag..], &b[..b.len() - lag]).abs().max(dot(&b[lag..], &a[..a.len() - lag]).abs());
            (0..=20).map(at).fold(0.0, f64::max) / (a.len() as f64).sqrt()
        };
        let each = Whitener::of(noise.models.clone());
        (noise.common_from(), [largest(&noise), largest(&each)])
    }

    #[test]
    fn what_two_tanks_have_in_common_is_one_flow() {
        for outflow in ["sqrt(max(h,0))", "0.5*h"] {
            let (from, [joint, apart]) = tanks(outflow);
            assert!(from == Some(0) && joint < 4.2 && apart > 4.2, "{outflow}: {from:?} {joint} {apart}");
        }
    }
}
