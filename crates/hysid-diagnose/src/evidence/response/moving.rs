//! The way of a force through a machine that answers it differently along its motion, and the filter that whitens what it makes.
//!
//! `x[k+1] = A_k x[k] + B_k w[k]`, `y[k] = C_k x[k] + e[k]`: the equations linearised at each row of a trajectory. Where they are not linear a force shows more
//! here and less there (the current of a choke that saturates, the level of a tank that runs low), and one spectrum for the whole recording leaves noise that is
//! larger at the same places of each cycle, as an effect is.
//!
//! Reference: B. D. O. Anderson, J. B. Moore, Optimal Filtering, Prentice-Hall (1979), sec. 3.1 (the filter of a system that varies with time) and 5.3 (its
//! innovations).

use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixView, DVectorView};

use super::course::Course;
use super::gains::{Gaining, Row};
use super::{Colours, dot_short as dot};
use crate::evidence::norm2;

/// Calls a function of a course for the number of its states; `None` where these are more than are taken.
macro_rules! of_size {
    ($states:expr, $of:ident($($argument:expr),*)) => {
        match $states {
            1 => $of::<1>($($argument),*),
            2 => $of::<2>($($argument),*),
            3 => $of::<3>($($argument),*),
            4 => $of::<4>($($argument),*),
            5 => $of::<5>($($argument),*),
            6 => $of::<6>($($argument),*),
            7 => $of::<7>($($argument),*),
            8 => $of::<8>($($argument),*),
            9 => $of::<9>($($argument),*),
            10 => $of::<10>($($argument),*),
            _ => None,
        }
    };
}

/// Product of powers beyond which its logarithm is taken.
const LARGE: f64 = 1e100;

/// Sums of squares of the scaled innovations of stretches, for each row of a moment, and the sum of the logarithms of their standard deviations.
pub(super) type Innovations = (Vec<f64>, f64);

/// Rows that follow each other, of each run.
pub(super) trait Chain {
    /// Number of states.
    fn states(&self) -> usize;
    /// Rows of one moment: the states move on after the last of them.
    fn together(&self) -> usize;
    /// The state that is a force with a memory, which has its variance from the start.
    fn remembered(&self) -> Option<usize>;
    /// Rows after which those of a run recur; `None` where each is of its own.
    fn recur(&self, run: usize) -> Option<usize>;
    /// Rows of a run.
    fn rows(&self, run: usize) -> usize;
    /// Puts a row of a run, of as many states as there are, in the place of another one. The matrix and the force of a row after which nothing moves are any.
    fn put<const N: usize>(&self, run: usize, k: usize, row: &mut Row<N>);

    /// Powers and gains before the first row of a run, under a force of this variance.
    fn begun<const N: usize>(&self, run: usize, variance: f64) -> Gaining<N> {
        Gaining::new(variance, self.remembered(), self.recur(run))
    }
}

/// Those of stretches along a chain, under a force of this variance.
pub(super) fn innovations(chain: &impl Chain, variance: f64, stretches: &[Vec<f64>]) -> Option<Innovations> {
    of_size!(chain.states(), innovations_of(chain, variance, stretches))
}

fn innovations_of<const N: usize>(chain: &impl Chain, variance: f64, stretches: &[Vec<f64>]) -> Option<Innovations> {
    let together = chain.together();
    let (mut squares, mut logs, mut powers) = (vec![0.0; together], 0.0, 1.0_f64);
    for (run, e) in stretches.iter().enumerate() {
        let (mut x, mut gains, mut row) = ([0.0; N], chain.begun::<N>(run, variance), Row::new());
        for (k, e) in e.iter().enumerate() {
            chain.put(run, k, &mut row);
            let (power, gain) = gains.next(&row)?;
            let innovation = e - dot(&row.c, &x);
            squares[k % together] += innovation * innovation / power;
            powers *= power;
            if powers > LARGE {
                logs += powers.ln();
                powers = 1.0;
            }
            x = std::array::from_fn(|i| if row.moves { dot(&row.a[i], &x) } else { x[i] } + gain[i] * innovation);
        }
    }
    Some((squares, 0.5 * (logs + powers.ln())))
}

/// Standard deviation of each row's innovation, and its gain, by run.
type Gains = (Vec<Vec<f64>>, Vec<Vec<f64>>);

/// The gains of a course.
fn gains_of<const N: usize>(course: &Course, variance: f64) -> Option<Gains> {
    let runs = 0..course.runs.len();
    let (mut sigmas, mut gains) = (vec![Vec::new(); runs.len()], vec![Vec::new(); runs.len()]);
    for run in runs {
        let (mut known, mut row) = (course.begun::<N>(run, variance), Row::new());
        for k in 0..course.rows(run) {
            course.put(run, k, &mut row);
            let (power, gain) = known.next(&row)?;
            sigmas[run].push(power.sqrt());
            gains[run].extend(gain);
        }
    }
    Some((sigmas, gains))
}

/// The filter of a course, for noise of the sensor with innovations of unit variance.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::evidence) struct MovingFilter {
    course: Arc<Course>,
    /// Standard deviation of each row's innovation, and what it adds to the predicted state.
    sigmas: Vec<Vec<f64>>,
    gains: Vec<Vec<f64>>,
}

/// A course with noises of some colours.
pub(in crate::evidence) struct Moved(pub(super) Arc<Course>);

impl Moved {
    /// `None` where the course has other runs than these stretches.
    pub(in crate::evidence) fn new(course: &Arc<Course>, colours: Colours, stretches: &[&[f64]]) -> Option<Self> {
        let rows = stretches.iter().enumerate().all(|(run, s)| course.rows(run) == s.len());
        (rows && course.runs.len() == stretches.len()).then(|| Self(course.coloured(colours)))
    }

    /// [`Innovations`] of stretches under a force of this variance.
    pub(in crate::evidence) fn innovations(&self, variance: f64, stretches: &[Vec<f64>]) -> Option<Innovations> {
        innovations(&*self.0, variance, stretches)
    }

    /// The variance that a force of unit variance gives the output, without what the rows before tell of it, at each row of each run.
    pub(in crate::evidence) fn spread(&self) -> Vec<Vec<f64>> {
        let n = self.0.states;
        let of_run = |run: usize| {
            let mut p = DMatrix::<f64>::zeros(n, n);
            if let Some(force) = self.0.remembered {
                p[(force, force)] = 1.0;
            }
            let rows = self.0.steps(run).map(|(a, b, c)| {
                let (a, b) = (DMatrixView::from_slice(a, n, n), DVectorView::from_slice(b, n));
                let c = DVectorView::from_slice(c, n);
                let variance = c.dot(&(&p * c));
                // By rows, the matrix is its transpose to a view by columns.
                p = a.tr_mul(&p) * a + b * b.transpose();
                variance
            });
            rows.collect()
        };
        (0..self.0.runs.len()).map(of_run).collect()
    }

    /// The filter for a force of this variance.
    pub(in crate::evidence) fn filter(self, variance: f64) -> Option<MovingFilter> {
        let (sigmas, gains) = of_size!(self.0.states, gains_of(&self.0, variance))?;
        Some(MovingFilter { course: self.0, sigmas, gains })
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
        self.log_scale_of(run, 0, 1)
    }

    /// The same of those rows alone that stand at a place among so many of a moment.
    pub(in crate::evidence) fn log_scale_of(&self, run: usize, place: usize, together: usize) -> f64 {
        self.sigmas[run].iter().skip(place).step_by(together).map(|s| s.ln()).sum()
    }

    /// Root mean square of the standard deviations of the innovations.
    pub(in crate::evidence) fn innovation(&self) -> f64 {
        let rows: usize = self.sigmas.iter().map(Vec::len).sum();
        (self.sigmas.iter().map(|s| norm2(s)).sum::<f64>() / rows.max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::*;
    use super::super::{Filter, ForcePath};
    use super::*;

    #[test]
    fn a_way_that_does_not_change_is_that_of_the_settled_filter() {
        let path = ForcePath::held(&[0.0, 1.0, -40.0, -0.5], 1, &[1.0, 0.0], PERIOD).unwrap();
        let row: Vec<f64> = path.a.transpose().iter().chain(path.b.iter()).chain(path.c.iter()).copied().collect();
        let n = 2000;
        let e = simulated(&path, &white(n, 1), 20.0, 2);
        let course = Arc::new(Course::new(2, vec![row.repeat(n)]).unwrap());
        for colours in [Colours::WHITE, Colours { force: 0.8, sensor: 0.0 }, Colours { force: 0.0, sensor: 0.6 }] {
            let filter = Moved::new(&course, colours, &[&e]).unwrap().filter(400.0).unwrap();
            let settled = Filter::new(&path, colours, 400.0, n).unwrap();
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

    #[test]
    fn a_course_has_the_rows_of_its_stretches_or_none() {
        let course = Arc::new(swaying(2));
        let e = vec![0.0; 5];
        assert!(Moved::new(&course, Colours::WHITE, &[&e[..2]]).is_some());
        assert!(Moved::new(&course, Colours::WHITE, &[&e]).is_none());
        assert!(Moved::new(&course, Colours::WHITE, &[&e[..2], &e]).is_none());
        assert!(Course::new(1, vec![vec![f64::NAN; 3]]).is_none());
    }
}
