//! The linear competitor: an output-error model by Steiglitz and McBride's iteration, order chosen on the last third of the record.
//!
//! `y[n] = c + (b0 u[n] + ... + bk u[n-k]) / (1 + a1 z^-1 + ... + ak z^-k)`, one input, each output for itself. Diverging models are thrown away.

use hysid_concealed::case::Record;
use hysid_concealed::input::Input;
use hysid_concealed::refit::solve;

/// A linear model for each output.
#[derive(Debug, Clone)]
pub struct Linear(Vec<Channel>);

#[derive(Debug, Clone)]
struct Channel {
    a: Vec<f64>,
    b: Vec<f64>,
    offset: f64,
}

fn samples(input: &Input) -> Vec<f64> {
    match input {
        Input::Held { values, .. } => values.clone(),
        Input::Motion { motion, period, samples } => (0..*samples).map(|k| motion.at(k as f64 * period).0).collect(),
    }
}

impl Linear {
    /// Free run on an input.
    pub fn run(&self, input: &Input) -> Vec<Vec<f64>> {
        let u = samples(input);
        self.0.iter().map(|c| c.run(&u)).collect()
    }
}

impl Channel {
    fn run(&self, u: &[f64]) -> Vec<f64> {
        let mut w = filter(&self.b, &self.a, u);
        w.iter_mut().for_each(|v| *v += self.offset);
        w
    }
}

/// `B/A u` from rest; `a` without its leading one.
fn filter(b: &[f64], a: &[f64], u: &[f64]) -> Vec<f64> {
    let mut y: Vec<f64> = Vec::with_capacity(u.len());
    for n in 0..u.len() {
        let mut v = 0.0;
        for (k, b) in b.iter().enumerate().take(n + 1) {
            v += b * u[n - k];
        }
        for (k, a) in a.iter().enumerate().take(n) {
            v -= a * y[n - 1 - k];
        }
        y.push(v.clamp(-1e150, 1e150));
    }
    y
}

/// The best model over orders 1 to 6; `None` when every order fails.
pub fn fit(record: &Record) -> Option<Linear> {
    let u = samples(&record.input);
    let train = u.len() * 2 / 3;
    let channels = record
        .y
        .iter()
        .map(|y| {
            let mut best: Option<(f64, usize)> = None;
            for order in 1..=6 {
                if let Some(c) = channel(&u[..train], &y[..train], order) {
                    let run = c.run(&u);
                    let e: f64 = run[train..].iter().zip(&y[train..]).map(|(a, b)| (a - b).powi(2)).sum();
                    if e.is_finite() && best.is_none_or(|b| e < b.0) {
                        best = Some((e, order));
                    }
                }
            }
            channel(&u, y, best?.1)
        })
        .collect::<Option<Vec<_>>>()?;
    Some(Linear(channels))
}

fn channel(u: &[f64], y: &[f64], order: usize) -> Option<Channel> {
    let n = y.len();
    let mut a = vec![0.0; order];
    let mut best: Option<(f64, Channel)> = None;
    for _ in 0..8 {
        let (uf, yf, one) = (filter(&[1.0], &a, u), filter(&[1.0], &a, y), filter(&[1.0], &a, &vec![1.0; n]));
        let p = 2 * order + 2;
        let (mut normal, mut right) = (vec![0.0; p * p], vec![0.0; p]);
        let mut row = vec![0.0; p];
        for k in order..n {
            for i in 0..order {
                row[i] = -yf[k - 1 - i];
            }
            for i in 0..=order {
                row[order + i] = uf[k - i];
            }
            row[p - 1] = one[k];
            for i in 0..p {
                right[i] += row[i] * yf[k];
                for j in 0..=i {
                    normal[i * p + j] += row[i] * row[j];
                }
            }
        }
        for i in 0..p {
            for j in 0..i {
                normal[j * p + i] = normal[i * p + j];
            }
        }
        let theta = solve(&normal, &right, p, 1e-10)?;
        a = theta[..order].to_vec();
        let gain: f64 = 1.0 + a.iter().sum::<f64>();
        let offset = if gain.abs() > 1e-9 { theta[p - 1] / gain } else { 0.0 };
        let found = Channel { a: a.clone(), b: theta[order..p - 1].to_vec(), offset };
        let e: f64 = found.run(u).iter().zip(y).map(|(a, b)| (a - b).powi(2)).sum();
        if e.is_finite() && best.as_ref().is_none_or(|b| e < b.0) {
            best = Some((e, found));
        }
        if !e.is_finite() {
            break;
        }
    }
    best.map(|b| b.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysid_concealed::input::Hold;

    #[test]
    fn a_linear_system_is_found_again() {
        let u: Vec<f64> = (0..900).map(|k| ((k * k) as f64 * 0.013).sin() + (k as f64 * 0.31).cos()).collect();
        let mut y = filter(&[0.2, 0.1], &[-1.5, 0.7], &u);
        y.iter_mut().for_each(|v| *v += 3.0);
        let input = Input::Held { values: u, period: 0.1, hold: Hold::Zero };
        let model = fit(&Record { input: input.clone(), y: vec![y.clone()], clean: vec![y.clone()] }).unwrap();
        let run = &model.run(&input)[0];
        let worst = run.iter().zip(&y).fold(0.0_f64, |w, (a, b)| w.max((a - b).abs()));
        assert!(worst < 1e-5, "{worst}");
    }
}
