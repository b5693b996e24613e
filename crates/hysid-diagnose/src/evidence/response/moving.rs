//! The way of a force through a machine that answers it differently along its motion, and the filter that whitens what it makes.
//!
//! `x[k+1] = A_k x[k] + B_k w[k]`, `y[k] = C_k x[k] + e[k]`: the equations linearised at each row of a trajectory. Where they are not linear a force shows more
//! here and less there (the current of a choke that saturates, the level of a tank that runs low), and one spectrum for the whole recording leaves noise that is
//! larger at the same places of each cycle, as an effect is.
//!
//! Reference: B. D. O. Anderson, J. B. Moore, Optimal Filtering, Prentice-Hall (1979), sec. 3.1 (the filter of a system that varies with time) and 5.3 (its
//! innovations).

use super::dot_short as dot;
use crate::evidence::norm2;

/// A way from a force to one output that changes from row to row, for each run of rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    states: usize,
    /// Of each row of each run: the matrix to the next row (by rows), what a unit force adds to it, the output.
    runs: Vec<Vec<f64>>,
}

impl Course {
    /// Of the rows of each run, as they stand in [`Course`]; `None` where one is not finite.
    pub fn new(states: usize, runs: Vec<Vec<f64>>) -> Option<Self> {
        let finite = states > 0 && runs.iter().flatten().all(|x| x.is_finite());
        finite.then_some(Self { states, runs })
    }

    /// Numbers that a row takes.
    const fn width(states: usize) -> usize {
        states * (states + 2)
    }

    /// Rows of a run.
    fn rows(&self, run: usize) -> usize {
        self.runs.get(run).map_or(0, |rows| rows.len() / Self::width(self.states))
    }

    /// Matrix, force and output of each row of a run.
    fn steps(&self, run: usize) -> impl DoubleEndedIterator<Item = (&[f64], &[f64], &[f64])> + ExactSizeIterator {
        let n = self.states;
        self.runs[run].chunks_exact(Self::width(n)).map(move |row| {
            let (a, rest) = row.split_at(n * n);
            let (b, c) = rest.split_at(n);
            (a, b, c)
        })
    }

    /// The same for a force of this pole: one with a memory is a state of its own, the last.
    fn with_force(&self, pole: f64) -> Self {
        if pole == 0.0 {
            return self.clone();
        }
        let n = self.states;
        let longer = |run: usize| {
            let mut rows = Vec::with_capacity(self.rows(run) * Self::width(n + 1));
            for (a, b, c) in self.steps(run) {
                a.chunks_exact(n).zip(b).for_each(|(a, b)| rows.extend(a.iter().chain([b])));
                rows.extend(std::iter::repeat_n(0.0, n).chain([pole]));
                rows.extend(std::iter::repeat_n(0.0, n).chain([(1.0 - pole * pole).sqrt()]));
                rows.extend(c.iter().chain(&[0.0]));
            }
            rows
        };
        Self { states: n + 1, runs: (0..self.runs.len()).map(longer).collect() }
    }

    /// Runs the filter for a force of this variance, and unit variance of the sensor, through a run: `f(row, sigma, gain)` for each row, until a covariance is not finite.
    fn filter(
        &self,
        run: usize,
        (pole, variance): (f64, f64),
        mut f: impl FnMut(&[f64], &[f64], f64, &[f64]),
    ) -> Option<()> {
        let n = self.states;
        let mut p = vec![0.0; n * n];
        if pole != 0.0 {
            // One with a memory has its variance from the start.
            p[n * n - 1] = variance;
        }
        let (mut pc, mut gain, mut ap) = (vec![0.0; n], vec![0.0; n], vec![0.0; n * n]);
        for (a, b, c) in self.steps(run) {
            pc.iter_mut().zip(p.chunks_exact(n)).for_each(|(x, row)| *x = dot(row, c));
            let power = 1.0 + dot(c, &pc);
            if !(power > 0.0 && power.is_finite()) {
                return None;
            }
            gain.iter_mut().zip(a.chunks_exact(n)).for_each(|(g, row)| *g = dot(row, &pc) / power);
            f(a, c, power.sqrt(), &gain);
            for (to, row) in ap.chunks_exact_mut(n).zip(a.chunks_exact(n)) {
                to.iter_mut().enumerate().for_each(|(j, x)| *x = dot(row, &p[j * n..(j + 1) * n]));
            }
            for i in 0..n {
                for j in 0..=i {
                    let ahead = dot(&ap[i * n..(i + 1) * n], &a[j * n..(j + 1) * n]);
                    let next = ahead + variance * b[i] * b[j] - power * gain[i] * gain[j];
                    (p[i * n + j], p[j * n + i]) = (next, next);
                }
            }
        }
        Some(())
    }
}

/// The filter of a course for a force of one pole, for noise of the sensor with unit variance.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::evidence) struct MovingFilter {
    course: Course,
    /// Standard deviation of each row's innovation, and what it adds to the predicted state.
    sigmas: Vec<Vec<f64>>,
    gains: Vec<Vec<f64>>,
}

/// A course with the pole of the force that moves it.
pub(in crate::evidence) struct Moved {
    course: Course,
    pole: f64,
}

impl Moved {
    /// `None` where the course has other runs than these stretches.
    pub(in crate::evidence) fn new(course: &Course, pole: f64, stretches: &[&[f64]]) -> Option<Self> {
        let same = course.runs.len() == stretches.len()
            && stretches.iter().enumerate().all(|(i, s)| course.rows(i) == s.len());
        same.then(|| Self { course: course.with_force(pole), pole })
    }

    /// Sum of squares of the scaled innovations of stretches, and of the logarithms of their standard deviations, under a force of this variance.
    pub(in crate::evidence) fn innovations(&self, variance: f64, stretches: &[&[f64]]) -> Option<(f64, f64)> {
        let (mut squares, mut log) = (0.0, 0.0);
        let n = self.course.states;
        let (mut x, mut next) = (vec![0.0; n], vec![0.0; n]);
        for (run, e) in stretches.iter().enumerate() {
            x.fill(0.0);
            let mut rows = e.iter();
            self.course.filter(run, (self.pole, variance), |a, c, sigma, gain| {
                let innovation = rows.next().map_or(0.0, |e| e - dot(c, &x));
                squares += (innovation / sigma).powi(2);
                log += sigma.ln();
                step(a, &x, gain, innovation, &mut next);
                std::mem::swap(&mut x, &mut next);
            })?;
        }
        Some((squares, log))
    }

    /// The filter for a force of this variance.
    pub(in crate::evidence) fn filter(self, variance: f64) -> Option<MovingFilter> {
        let runs = 0..self.course.runs.len();
        let (mut sigmas, mut gains) = (vec![Vec::new(); runs.len()], vec![Vec::new(); runs.len()]);
        for run in runs {
            self.course.filter(run, (self.pole, variance), |_, _, sigma, gain| {
                sigmas[run].push(sigma);
                gains[run].extend_from_slice(gain);
            })?;
        }
        Some(MovingFilter { course: self.course, sigmas, gains })
    }
}

/// `next = A x + gain innovation`.
fn step(a: &[f64], x: &[f64], gain: &[f64], innovation: f64, next: &mut [f64]) {
    let rows = a.chunks_exact(x.len());
    next.iter_mut().zip(rows).zip(gain).for_each(|((next, a), gain)| *next = dot(a, x) + gain * innovation);
}

impl MovingFilter {
    /// Whether it has a run of so many rows.
    pub(in crate::evidence) fn has(&self, run: usize, rows: usize) -> bool {
        self.sigmas.get(run).is_some_and(|sigmas| sigmas.len() == rows)
    }

    /// Runs through a run: `f(sigma, prediction, row)` gives the innovation.
    pub(in crate::evidence) fn run(&self, run: usize, mut f: impl FnMut(f64, f64, usize) -> f64) {
        let n = self.course.states;
        let (mut x, mut next) = (vec![0.0; n], vec![0.0; n]);
        let known = self.sigmas[run].iter().zip(self.gains[run].chunks_exact(n));
        for (k, ((a, _, c), (sigma, gain))) in self.course.steps(run).zip(known).enumerate() {
            let innovation = f(*sigma, dot(c, &x), k);
            step(a, &x, gain, innovation, &mut next);
            std::mem::swap(&mut x, &mut next);
        }
    }

    /// The transpose of the map from a run to its scaled innovations, in place.
    pub(in crate::evidence) fn transpose(&self, run: usize, v: &mut [f64]) {
        let n = self.course.states;
        let (mut costate, mut before) = (vec![0.0; n], vec![0.0; n]);
        let known = self.sigmas[run].iter().zip(self.gains[run].chunks_exact(n));
        for (((a, _, c), (sigma, gain)), v) in self.course.steps(run).zip(known).zip(v).rev() {
            *v = *v / sigma + dot(gain, &costate);
            for (j, before) in before.iter_mut().enumerate() {
                let through: f64 = a.chunks_exact(n).zip(&costate).map(|(row, l)| row[j] * l).sum();
                *before = through - c[j] * *v;
            }
            std::mem::swap(&mut costate, &mut before);
        }
    }

    /// Sum of the logarithms of the standard deviations of a run's innovations.
    pub(in crate::evidence) fn log_scale(&self, run: usize) -> f64 {
        self.sigmas[run].iter().map(|s| s.ln()).sum()
    }

    /// Root mean square of the standard deviations of the innovations.
    pub(in crate::evidence) fn innovation(&self) -> f64 {
        let rows: usize = self.sigmas.iter().map(Vec::len).sum();
        (self.sigmas.iter().map(|s| norm2(s)).sum::<f64>() / rows.max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::super::samples::*;
    use super::super::{Filter, ForcePath};
    use super::*;

    const N: usize = 40;
    const VARIANCE: f64 = 30.0;

    /// Two runs of an oscillator whose stiffness, drive and output go up and down.
    fn swaying() -> Course {
        let run = |from: usize| {
            let rows = (from..from + N).flat_map(|k| {
                let s = (0.3 * k as f64).sin();
                [0.9, 0.2 + 0.1 * s, -0.3 - 0.2 * s, 0.85, 0.02, 0.1 + 0.08 * s, 1.0 + 0.7 * s, 0.1]
            });
            rows.collect()
        };
        Course::new(2, vec![run(0), run(100)]).unwrap()
    }

    /// The covariance of a run, written down from its equations.
    fn covariance(course: &Course, run: usize, pole: f64) -> DMatrix<f64> {
        let n = course.states;
        // Each force from its row on, through all later ones; one with a memory is a filtered white one.
        let steps: Vec<(DMatrix<f64>, DVector<f64>, DVector<f64>)> = (course.steps(run))
            .map(|(a, b, c)| (DMatrix::from_row_slice(n, n, a), DVector::from_row_slice(b), DVector::from_row_slice(c)))
            .collect();
        let answer = DMatrix::from_fn(N, N, |_, _| 0.0);
        let answer = (0..N).fold(answer, |mut answer, at| {
            let mut x = DVector::zeros(n);
            for (row, (a, b, c)) in steps.iter().enumerate() {
                answer[(row, at)] = c.dot(&x);
                x = a * x + if row == at { b.clone() } else { DVector::zeros(n) };
            }
            answer
        });
        let force = DMatrix::from_fn(N, N, |i, j| VARIANCE * pole.powi(i.abs_diff(j) as i32));
        let force = if pole == 0.0 { DMatrix::identity(N, N) * VARIANCE } else { force };
        DMatrix::identity(N, N) + &answer * force * answer.transpose()
    }

    #[test]
    fn the_innovations_are_the_cholesky_factor_of_the_covariance() {
        let e = [white(N, 4), white(N, 5)];
        let stretches = [e[0].as_slice(), e[1].as_slice()];
        for pole in [0.0, 0.75] {
            let moved = Moved::new(&swaying(), pole, &stretches).unwrap();
            let (squares, log) = moved.innovations(VARIANCE, &stretches).unwrap();
            let filter = moved.filter(VARIANCE).unwrap();
            let (mut all, mut logs) = (0.0, 0.0);
            for (run, e) in stretches.iter().enumerate() {
                let factor = covariance(&swaying(), run, pole).cholesky().unwrap().l();
                let expected = factor.solve_lower_triangular(&DVector::from_column_slice(e)).unwrap();
                let mut w = vec![0.0; N];
                filter.run(run, |sigma, predicted, k| {
                    w[k] = (e[k] - predicted) / sigma;
                    e[k] - predicted
                });
                assert!(w.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9), "{pole}");
                let own: f64 = factor.diagonal().iter().map(|d| d.ln()).sum();
                assert!((own - filter.log_scale(run)).abs() < 1e-9);
                // The transpose, by the factor's own.
                let mut back = e.to_vec();
                filter.transpose(run, &mut back);
                let expected = factor.tr_solve_lower_triangular(&DVector::from_column_slice(e)).unwrap();
                assert!(back.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9), "{pole}");
                (all, logs) = (all + norm2(&w), logs + own);
            }
            assert!((all - squares).abs() < 1e-9 && (logs - log).abs() < 1e-9);
        }
    }

    #[test]
    fn a_way_that_does_not_change_is_that_of_the_settled_filter() {
        let path = ForcePath::held(&[0.0, 1.0, -40.0, -0.5], 1, &[1.0, 0.0], PERIOD).unwrap();
        let row: Vec<f64> = path.a.transpose().iter().chain(path.b.iter()).chain(path.c.iter()).copied().collect();
        let n = 2000;
        let e = simulated(&path, &white(n, 1), 20.0, 2);
        let course = Course::new(2, vec![row.repeat(n)]).unwrap();
        let filter = Moved::new(&course, 0.0, &[&e]).unwrap().filter(400.0).unwrap();
        let settled = Filter::new(&path, 0.0, 400.0, n).unwrap();
        let mut expected = vec![0.0; n];
        settled.run(n, |_, predicted, k| {
            expected[k] = predicted;
            e[k] - predicted
        });
        filter.run(0, |sigma, predicted, k| {
            assert!((predicted - expected[k]).abs() < 1e-6 && (sigma - settled.sigma(k)).abs() < 1e-6, "{k}");
            e[k] - predicted
        });
    }
}
