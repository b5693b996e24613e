//! The way of an unknown force through the plant to an output.
//!
//! `x[k+1] = A x[k] + B w[k]`, `y[k] = C x[k] + e[k]`: `w` is the force, held through a row's period, white or a first-order autoregression; `e` is white.
//! Far from the start the power spectrum is `sigma_e^2 + sigma_w^2 |G|^2` with the plant's own response `G`: a resonance is told in one
//! coefficient, where an autoregression needs four and knows the band's width only as well as the few samples in it tell.
//!
//! Reference: P. J. Brockwell and R. A. Davis, Time Series, section 12.2; P. Whittle (1953) for the spectrum.

mod common;
mod course;
mod filter;
mod gains;
mod moving;
#[cfg(test)]
pub(super) mod samples;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

pub use common::CommonPath;
pub(super) use common::Sensor;
pub use course::Course;
pub(super) use filter::Filter;
pub(super) use moving::{Moved, MovingFilter};

/// First-order autoregressions of a force and of the sensor's noise: their poles, 0 where one is white.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Colours {
    pub force: f64,
    pub sensor: f64,
}

impl Colours {
    pub const WHITE: Self = Self { force: 0.0, sensor: 0.0 };

    /// Number of coefficients: the share of the force, and each pole.
    pub fn coefficients(self) -> usize {
        1 + self.states()
    }

    /// Number of states of noises with a memory.
    fn states(self) -> usize {
        [self.force, self.sensor].into_iter().filter(|pole| *pole != 0.0).count()
    }

    /// Appends matrix (by rows), force and output of a row to `rows`, with noises of these colours: a force with a memory is a state of its own, and so is the last
    /// output without the noise of a sensor that has one, from whose differences it is taken.
    fn extend(self, (a, b, c): (&[f64], &[f64], &[f64]), rows: &mut Vec<f64>) {
        let n = c.len();
        let states = n + self.states();
        let row = rows.len();
        rows.resize(row + states * (states + 2), 0.0);
        let (matrix, rest) = rows[row..].split_at_mut(states * states);
        let (force, output) = rest.split_at_mut(states);
        pushed(self.force, (a, b), matrix, force);
        output[..n].copy_from_slice(c);
        if self.sensor != 0.0 {
            matrix[(states - 1) * states..][..n].copy_from_slice(c);
            output[states - 1] = -self.sensor;
        }
    }
}

/// Puts matrix (by rows) and force of a row into those of as many states or more, zero before, with a force of this pole: one with a memory is the next state.
fn pushed(pole: f64, (a, b): (&[f64], &[f64]), matrix: &mut [f64], force: &mut [f64]) {
    let (n, states) = (b.len(), force.len());
    matrix.chunks_exact_mut(states).zip(a.chunks_exact(n)).for_each(|(to, a)| to[..n].copy_from_slice(a));
    if pole == 0.0 {
        force[..n].copy_from_slice(b);
    } else {
        (0..n).for_each(|i| matrix[i * states + n] = b[i]);
        matrix[n * states + n] = pole;
        force[n] = (1.0 - pole * pole).sqrt();
    }
}

/// The way from a force to one output, from row to row.
#[derive(Debug, Clone, PartialEq)]
pub struct ForcePath {
    /// The state in whose derivative the force enters, among all of the simulation.
    entry: usize,
    a: DMatrix<f64>,
    b: DVector<f64>,
    c: DVector<f64>,
    /// The same from row to row, where the machine answers a force differently along its motion.
    course: Option<Arc<Course>>,
}

/// The ways of an unknown force to the outputs of a simulation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ForcePaths {
    /// To each output by itself.
    pub each: Vec<Vec<ForcePath>>,
    /// To several of them at once.
    pub common: Vec<Arc<CommonPath>>,
}

/// Inner product of a few numbers.
#[inline]
fn dot_short(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The states by which a force at state `entry` of `n` reaches an output: those that it moves (`moves(i, j)`: `j` is in the derivative of `i`) and that move
/// the output (`shows(i)`: it is in that itself). Others would grow or drift unseen.
pub fn between(
    n: usize,
    entry: usize,
    moves: impl Fn(usize, usize) -> bool,
    shows: impl Fn(usize) -> bool,
) -> Vec<usize> {
    let spread = |mut on: Vec<bool>, to: &dyn Fn(usize, usize) -> bool| {
        for _ in 0..n {
            for i in 0..n {
                on[i] |= (0..n).any(|j| on[j] && to(i, j));
            }
        }
        on
    };
    let moved = spread((0..n).map(|i| i == entry).collect(), &moves);
    let seen = spread((0..n).map(shows).collect(), &|i, j| moves(j, i));
    (0..n).filter(|&i| moved[i] && seen[i]).collect()
}

impl ForcePath {
    /// The way into the derivative of state `entry` of `dx/dt = a x`, out by `y = c x`, for a force that is held through `period_s`.
    ///
    /// `a` is by rows. `None` where the force does not reach the output, or nothing finite does.
    pub fn held(a: &[f64], entry: usize, c: &[f64], period_s: f64) -> Option<Self> {
        let n = c.len();
        if a.len() != n * n || entry >= n || !a.iter().chain(c).all(|x| x.is_finite()) {
            return None;
        }
        let kept = between(n, entry, |i, j| a[i * n + j] != 0.0, |i| c[i] != 0.0);
        let place = kept.iter().position(|&i| i == entry)?;
        let m = kept.len();
        // The exponential of the equations with the force as a constant state.
        let whole = DMatrix::from_fn(m + 1, m + 1, |i, j| match (kept.get(i), kept.get(j)) {
            (Some(i), Some(j)) => a[i * n + j] * period_s,
            (Some(_), None) if i == place => period_s,
            _ => 0.0,
        })
        .exp();
        let path = Self {
            entry,
            a: whole.view((0, 0), (m, m)).into_owned(),
            b: whole.view((0, m), (m, 1)).column(0).into_owned(),
            c: DVector::from_iterator(m, kept.iter().map(|&i| c[i])),
            course: None,
        };
        whole.iter().all(|x| x.is_finite()).then_some(path)
    }

    /// The state in whose derivative the force enters, among all of the simulation.
    pub fn entry(&self) -> usize {
        self.entry
    }

    /// The same way with its course from row to row, if there is one.
    pub fn along(self, course: Option<Arc<Course>>) -> Self {
        Self { course, ..self }
    }

    /// Its course from row to row.
    pub(super) fn course(&self) -> Option<Arc<Course>> {
        self.course.clone()
    }

    /// Matrix and output of the way with noises of these colours.
    fn coloured(&self, colours: Colours) -> (DMatrix<f64>, DVector<f64>) {
        let states = self.c.len() + colours.states();
        let mut row = Vec::new();
        colours.extend((self.a.transpose().as_slice(), self.b.as_slice(), self.c.as_slice()), &mut row);
        let (a, rest) = row.split_at(states * states);
        (DMatrix::from_row_slice(states, states, a), DVector::from_row_slice(&rest[states..]))
    }

    /// Variance of the output, `rows` rows from the start, for a force of unit variance that begins at zero.
    pub(super) fn variance(&self, pole: f64, rows: usize) -> f64 {
        let (mut force, mut x, mut sum) = ((1.0 - pole * pole).sqrt(), DVector::zeros(self.c.len()), 0.0);
        for _ in 0..rows {
            x = &self.a * &x + &self.b * force;
            force *= pole;
            sum += self.c.dot(&x).powi(2);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::samples::*;
    use super::*;
    use hysid_signal::fourier;

    #[test]
    fn the_gain_of_a_resonance_is_that_of_its_closed_form() {
        // |G(s)|^2 = 1 / ((w^2 - f^2)^2 + (2 z w f)^2), from the lines of the impulse response; the hold falls off as a sinc.
        let path = oscillator();
        let n = 4096;
        let mut x = path.b.clone();
        let response: Vec<f64> = (0..n)
            .map(|_| {
                let y = path.c.dot(&x);
                x = &path.a * &x;
                y
            })
            .collect();
        let (w, z) = PLANT;
        for (k, (re, im)) in fourier(&response).iter().enumerate().skip(1).take(n / 8) {
            let f = std::f64::consts::TAU * k as f64 / (n as f64 * PERIOD);
            let half = 0.5 * f * PERIOD;
            let closed = (half.sin() / half).powi(2) / ((w * w - f * f).powi(2) + (2.0 * z * w * f).powi(2));
            let found = re * re + im * im;
            // Aliases of the held force are what is left above the resonance.
            assert!((found / closed - 1.0).abs() < 0.02 + 0.3 * (f / 160.0), "{k}: {found} {closed}");
        }
    }

    #[test]
    fn a_double_integrator_is_discretised_exactly() {
        let path = ForcePath::held(&[0.0, 1.0, 0.0, 0.0], 1, &[1.0, 0.0], 0.1).unwrap();
        assert!((path.b[0] - 0.005).abs() < 1e-15 && (path.b[1] - 0.1).abs() < 1e-15);
        assert!(ForcePath::held(&[0.0, 0.0, 0.0, 0.0], 1, &[1.0, 0.0], 0.1).is_none(), "does not reach the output");
        assert!(ForcePath::held(&[f64::NAN], 0, &[1.0], 0.1).is_none());
    }
}
