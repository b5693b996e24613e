//! Powers and gains of the innovations, from row to row.
//!
//! Reference: B. D. O. Anderson, J. B. Moore, Optimal Filtering, Prentice-Hall (1979), sec. 3.1.

use super::dot_short as dot;
use super::filter::SETTLED;

/// A row by arrays: whether the states move on after it, matrix, force, output.
pub(super) struct Row<const N: usize> {
    pub moves: bool,
    pub a: [[f64; N]; N],
    pub b: [f64; N],
    pub c: [f64; N],
}

impl<const N: usize> Row<N> {
    /// Of zeros.
    pub fn new() -> Self {
        Self { moves: true, a: [[0.0; N]; N], b: [0.0; N], c: [0.0; N] }
    }
}

/// The covariance of the predicted state, for noise of the sensor with unit variance.
struct Riccati<const N: usize> {
    p: [[f64; N]; N],
    variance: f64,
}

impl<const N: usize> Riccati<N> {
    /// Power and gain of a row's innovation, and the covariance of the next row; `None` where that is not finite.
    fn next(&mut self, row: &Row<N>) -> Option<(f64, [f64; N])> {
        let Row { moves, a, b, c } = row;
        let pc: [f64; N] = std::array::from_fn(|i| dot(&self.p[i], c));
        let power = 1.0 + dot(c, &pc);
        if !(power > 0.0 && power.is_finite()) {
            return None;
        }
        if !moves {
            let gain = pc.map(|pc| pc / power);
            for i in 0..N {
                for j in 0..N {
                    self.p[i][j] -= gain[i] * pc[j];
                }
            }
            return Some((power, gain));
        }
        let gain: [f64; N] = std::array::from_fn(|i| dot(&a[i], &pc) / power);
        // It is symmetric.
        let ap: [[f64; N]; N] = std::array::from_fn(|i| std::array::from_fn(|j| dot(&a[i], &self.p[j])));
        for i in 0..N {
            for j in 0..=i {
                let next = dot(&ap[i], &a[j]) + self.variance * b[i] * b[j] - power * gain[i] * gain[j];
                (self.p[i][j], self.p[j][i]) = (next, next);
            }
        }
        Some((power, gain))
    }
}

/// Powers and gains of the rows of a run, which recur once they have settled where the rows do.
pub(super) struct Gaining<const N: usize> {
    riccati: Riccati<N>,
    recur: Option<usize>,
    /// Those of the last rows, as many as recur.
    cycle: Vec<(f64, [f64; N])>,
    at: usize,
    /// Rows for which they have been as they were before.
    alike: usize,
}

impl<const N: usize> Gaining<N> {
    /// Before the first row, under a force of this variance; the state that is a `remembered` force has it from the start. Rows `recur` after so many.
    pub fn new(variance: f64, remembered: Option<usize>, recur: Option<usize>) -> Self {
        let mut p = [[0.0; N]; N];
        if let Some(force) = remembered {
            p[force][force] = variance;
        }
        Self { riccati: Riccati { p, variance }, recur, cycle: Vec::new(), at: 0, alike: 0 }
    }

    /// Those of the next row; `None` where they are not finite.
    pub fn next(&mut self, row: &Row<N>) -> Option<(f64, [f64; N])> {
        let Some(recur) = self.recur else { return self.riccati.next(row) };
        let place = self.at % recur;
        self.at += 1;
        // The first rows of a chain of integrators see nothing of the force.
        if self.alike >= recur && self.at > (2 * N + 2) * recur {
            return Some(self.cycle[place]);
        }
        let (power, gain) = self.riccati.next(row)?;
        let near = |x: f64, y: f64| (x - y).abs() <= SETTLED * (1e-6 + x.abs());
        let as_before = self
            .cycle
            .get(place)
            .is_some_and(|(before, last)| near(power, *before) && gain.iter().zip(last).all(|(x, y)| near(*x, *y)));
        self.alike = if as_before { self.alike + 1 } else { 0 };
        match self.cycle.get_mut(place) {
            Some(known) => *known = (power, gain),
            None => self.cycle.push((power, gain)),
        }
        Some((power, gain))
    }
}
