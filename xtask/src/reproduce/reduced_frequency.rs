//! The reduced-frequency model fitted to motions of a pitching wing: the linear model that the paper's Figure 7 compares with.
//!
//! C_N = C_N0 + C_a d + C_q d' c/(2V) + D x, tau x' = d - x, with d = alpha - alpha0. For a given tau it is linear in C_N0, C_a, C_q and D;
//! tau is scanned. (alpha0 and C_N0 cannot be told apart; alpha0 is 0.)

use hysid_linalg::{Matrix, lstsq};

/// One motion: angle in rad and normal force, uniformly sampled.
#[derive(Debug, Clone)]
pub struct Motion {
    /// What it is called.
    pub name: String,
    /// Sampling period over c/(2V), without unit.
    pub step: f64,
    /// Angle of attack in rad.
    pub alpha: Vec<f64>,
    /// Normal force coefficient.
    pub c_n: Vec<f64>,
}

/// The fitted model.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// C_N0, C_a, C_q, D.
    pub theta: Vec<f64>,
    /// Time constant over c/(2V).
    pub tau: f64,
}

/// The lag and the rate of the angle, in units of c/(2V); at rest at the first angle.
fn regressors(m: &Motion, tau: f64) -> [Vec<f64>; 4] {
    let n = m.alpha.len();
    let rate: Vec<f64> = (0..n)
        .map(|k| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
            (m.alpha[b] - m.alpha[a]) / (m.step * (b - a).max(1) as f64)
        })
        .collect();
    // The exact answer to an input that is linear between samples.
    let decay = (-m.step / tau).exp();
    let mut lag = vec![m.alpha.first().copied().unwrap_or(0.0)];
    for pair in m.alpha.windows(2) {
        let slope = (pair[1] - pair[0]) / m.step;
        let before = lag.last().copied().unwrap_or(0.0);
        lag.push(pair[1] - slope * tau + (before - pair[0] + slope * tau) * decay);
    }
    [vec![1.0; n], m.alpha.clone(), rate, lag]
}

impl Fitted {
    /// The least-squares fit to all motions together, tau scanned over four decades.
    pub fn to(motions: &[Motion]) -> anyhow::Result<Self> {
        let target: Vec<f64> = motions.iter().flat_map(|m| m.c_n.iter().copied()).collect();
        let mut best: Option<(f64, Self)> = None;
        for i in 0..=120 {
            let tau = 10_f64.powf(-1.0 + f64::from(i) / 30.0);
            let mut columns = vec![Vec::new(); 4];
            for m in motions {
                for (all, new) in columns.iter_mut().zip(regressors(m, tau)) {
                    all.extend(new);
                }
            }
            let Some(matrix) = Matrix::from_columns(&columns) else { anyhow::bail!("motions without samples") };
            let solution = lstsq(&matrix, &target)?;
            if best.as_ref().is_none_or(|b| solution.sse < b.0) {
                best = Some((solution.sse, Self { theta: solution.theta, tau }));
            }
        }
        best.map(|b| b.1).ok_or_else(|| anyhow::anyhow!("no motion to fit to"))
    }

    /// The normal force that the model gives a motion.
    pub fn run(&self, m: &Motion) -> Vec<f64> {
        let columns = regressors(m, self.tau);
        (0..m.alpha.len()).map(|n| columns.iter().zip(&self.theta).map(|(c, t)| t * c[n]).sum()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_own_motion_is_found() {
        let alpha: Vec<f64> = (0..400).map(|n| 0.3 + 0.2 * (0.05 * f64::from(n)).sin()).collect();
        let mut m = Motion { name: String::new(), step: 1.0, c_n: vec![0.0; 400], alpha };
        let truth = Fitted { theta: vec![0.1, 3.0, 2.0, -1.5], tau: 10_f64.powf(-1.0 + 65.0 / 30.0) };
        m.c_n = truth.run(&m);
        let found = Fitted::to(&[m]).unwrap();
        assert_eq!(found.tau, truth.tau);
        assert!(found.theta.iter().zip(&truth.theta).all(|(a, b)| (a - b).abs() < 1e-8));
    }
}
