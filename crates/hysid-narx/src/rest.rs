//! Where a model rests under a constant input, and its loop when the input is moved slowly.

use hysid_dictionary::Record;

use crate::program::Program;
use crate::{Bank, NarxError, NarxModel};

/// A resting point under a constant input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equilibrium {
    /// The output.
    pub y: f64,
    /// Whether the model returns to it after a small disturbance.
    pub stable: bool,
}

/// The loop of a slowly moved input.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticLoop {
    /// The input: up, down and up again.
    pub u: Vec<f64>,
    /// The output.
    pub y: Vec<f64>,
    /// The sample at which the run diverged.
    pub diverged_at: Option<usize>,
}

/// Points of the grid on which changes of sign are sought.
const GRID: usize = 4000;

impl NarxModel {
    /// The points between `low` and `high` at which the model can rest while the inputs keep the values `u`, ascending.
    ///
    /// All differences are then 0 and all signs +1, as at the beginning of a stretch. A model whose output can rest anywhere
    /// (an integrator, a rate-independent hysteresis) has none that are isolated.
    ///
    /// # Errors
    /// Another number of inputs than the model has.
    pub fn equilibria(&self, u: &[f64], low: f64, high: f64) -> Result<Vec<Equilibrium>, NarxError> {
        let program = Program::new(&self.terms());
        let theta = self.theta();
        let length = self.reach() + 1;
        let columns: Vec<Vec<f64>> = u.iter().map(|u| vec![*u; length]).collect();
        let zeros = vec![0.0; length];
        let record = Record::new(&zeros, columns.iter().map(Vec::as_slice).collect());
        let bank = Bank::new(&record, &self.parts().derived, self.signals())?;
        let inputs = program.inputs(&bank)?;
        let mut v = vec![0.0; program.factors.len()];
        let signs = vec![hysid_dictionary::FIRST_SIGN; length];
        let at = |y: f64, v: &mut Vec<f64>| {
            program.factor_values(length - 1, length - 1, &vec![y; length], &signs, &inputs, v);
            program.sum(&theta, v) - y
        };
        let place = |i: usize| low + (high - low) * i as f64 / GRID as f64;
        let mut found = Vec::new();
        let mut before = at(place(0), &mut v);
        for i in 1..=GRID {
            let next = at(place(i), &mut v);
            if before == 0.0 && next != 0.0 || before * next < 0.0 {
                let (mut a, mut b) = (place(i - 1), place(i));
                for _ in 0..80 {
                    let middle = 0.5 * (a + b);
                    if at(middle, &mut v) * before > 0.0 { a = middle } else { b = middle }
                }
                found.push(if before == 0.0 { place(i - 1) } else { 0.5 * (a + b) });
            }
            before = next;
        }
        let mut out = Vec::with_capacity(found.len());
        for y in found {
            at(y, &mut v);
            let mut jacobian = vec![0.0; program.output_lags + 2];
            program.output_jacobian(&theta, &v, &mut jacobian);
            let a: Vec<f64> = jacobian[1..=program.output_lags].iter().map(|j| -j).collect();
            out.push(Equilibrium { y, stable: crate::derived::is_stable(&a) });
        }
        Ok(out)
    }

    /// The loop of input `moved` when it goes slowly from the middle of `low..high` up, down to `low` and up again, in `steps`
    /// samples for each sweep, the other inputs staying at `others`.
    ///
    /// # Errors
    /// An input that there is not.
    pub fn static_loop(
        &self,
        moved: usize,
        others: &[f64],
        low: f64,
        high: f64,
        steps: usize,
    ) -> Result<StaticLoop, NarxError> {
        let count = self.recorded_inputs();
        if moved >= count || others.len() != count {
            let problem = format!("input {moved} of {count}, {} values given", others.len());
            return Err(NarxError::BadRecord { record: 0, problem });
        }
        let steps = steps.max(2);
        let middle = 0.5 * (low + high);
        let sweep = |from: f64, to: f64, n: usize| (1..=n).map(move |i| from + (to - from) * i as f64 / n as f64);
        let u: Vec<f64> = std::iter::repeat_n(middle, self.reach() * self.parts().decimation)
            .chain(sweep(middle, high, steps / 2))
            .chain(sweep(high, low, steps))
            .chain(sweep(low, high, steps))
            .collect();
        let columns: Vec<Vec<f64>> =
            (0..count).map(|i| if i == moved { u.clone() } else { vec![others[i]; u.len()] }).collect();
        let mut values = others.to_vec();
        values[moved] = middle;
        let size = self.parts().limit;
        let rest = self.equilibria(&values, -size, size)?;
        let y0 = rest.iter().find(|e| e.stable).or(rest.first()).map_or(0.0, |e| e.y);
        let y = vec![y0; u.len()];
        let run = self.free_run(&Record::new(&y, columns.iter().map(Vec::as_slice).collect()))?;
        Ok(StaticLoop { u, y: run.y, diverged_at: run.diverged_at })
    }
}
