//! The filters `s^k/A(s)` of a sampled series, exact for what happens between the samples under its hold.
//!
//! Time is in a unit of the caller's, in which the coefficients of `A` are of one size.

use nalgebra::DMatrix;

use crate::document::Hold;

/// What goes into a filter.
#[derive(Debug, Clone, Copy)]
pub(super) enum Source<'a> {
    /// A sampled series with its hold.
    Series(&'a [f64], Hold),
    /// The constant 1.
    Constant,
    /// A unit impulse just before the first sample: its responses span those to any initial state.
    Impulse,
}

/// A linear system with one input in steps of the sampling period: `x' = phi x + now u + next (u_next - u)`.
struct Stepper {
    n: usize,
    phi: Vec<f64>,
    now: Vec<f64>,
    next: Vec<f64>,
}

impl Stepper {
    /// Discretised by the exponential of the system with its input as two further states (value and slope).
    fn new(f: &DMatrix<f64>, input: &[f64], period: f64) -> Option<Self> {
        let n = f.nrows();
        let mut whole = DMatrix::zeros(n + 2, n + 2);
        whole.view_mut((0, 0), (n, n)).copy_from(&(f * period));
        for (i, value) in input.iter().enumerate() {
            whole[(i, n)] = value * period;
        }
        whole[(n, n + 1)] = 1.0;
        // Beyond this the exponential's scaling loses all digits.
        if !whole.iter().all(|x| x.is_finite()) || whole.norm() > 1e6 {
            return None;
        }
        let e = whole.exp();
        let phi = (0..n * n).map(|i| e[(i / n, i % n)]).collect();
        let column = |j: usize| (0..n).map(|i| e[(i, j)]).collect::<Vec<f64>>();
        e.iter().all(|x| x.is_finite()).then(|| Self { n, phi, now: column(n), next: column(n + 1) })
    }

    /// Runs from state `x`; `see` gets every sample's number and state.
    fn run(&self, mut x: Vec<f64>, source: Source<'_>, samples: usize, mut see: impl FnMut(usize, &[f64])) {
        let (series, hold) = match source {
            Source::Series(series, hold) => (Some(series), hold),
            Source::Constant | Source::Impulse => (None, Hold::Zero),
        };
        let level = if matches!(source, Source::Constant) { 1.0 } else { 0.0 };
        let at = |k: usize| series.map_or(level, |s| s.get(k).copied().unwrap_or(0.0));
        let mut moved = vec![0.0; self.n];
        for k in 0..samples {
            see(k, &x);
            if k + 1 == samples {
                break;
            }
            let now = at(k);
            let change = if hold == Hold::Linear { at(k + 1) - now } else { 0.0 };
            for (i, (slot, row)) in moved.iter_mut().zip(self.phi.chunks_exact(self.n)).enumerate() {
                let sum: f64 = row.iter().zip(&x).map(|(a, b)| a * b).sum();
                *slot = sum + self.now[i] * now + self.next[i] * change;
            }
            std::mem::swap(&mut x, &mut moved);
        }
    }
}

/// `s^k/A` of a source, and of the response that a numerator makes of it.
pub(super) struct Filtered {
    /// `s^k/A` of the source, k from 0 to n - 1.
    pub states: Vec<Vec<f64>>,
    /// The response `B/A` of the source.
    pub response: Vec<f64>,
    /// `s^k/A` of that response.
    pub of_response: Vec<Vec<f64>>,
}

/// The companion matrix of the monic polynomial `s^n + a[n-1] s^(n-1) + ... + a[0]`.
fn companion(a: &[f64]) -> DMatrix<f64> {
    let n = a.len();
    DMatrix::from_fn(n, n, |i, j| {
        if i + 1 == n {
            -a[j]
        } else if j == i + 1 {
            1.0
        } else {
            0.0
        }
    })
}

/// Filters a source by `s^k/A`, and its response under the numerator `b` (lowest power first, at most n + 1) by the same.
pub(super) fn cascade(a: &[f64], b: &[f64], source: Source<'_>, samples: usize, period: f64) -> Option<Filtered> {
    let n = a.len();
    // B/A = direct + (B - direct A)/A.
    let direct = b.get(n).copied().unwrap_or(0.0);
    let proper: Vec<f64> = (0..n).map(|k| b.get(k).copied().unwrap_or(0.0) - direct * a[k]).collect();
    let filter = companion(a);
    let mut f = DMatrix::zeros(2 * n, 2 * n);
    f.view_mut((0, 0), (n, n)).copy_from(&filter);
    f.view_mut((n, n), (n, n)).copy_from(&filter);
    for (k, value) in proper.iter().enumerate() {
        f[(2 * n - 1, k)] = *value;
    }
    let mut input = vec![0.0; 2 * n];
    let mut x = vec![0.0; 2 * n];
    if matches!(source, Source::Impulse) {
        x[n - 1] = 1.0;
    } else {
        input[n - 1] = 1.0;
        input[2 * n - 1] = direct;
    }
    let stepper = Stepper::new(&f, &input, period)?;
    let empty = || vec![vec![0.0; samples]; n];
    let mut out = Filtered { states: empty(), response: vec![0.0; samples], of_response: empty() };
    stepper.run(x, source, samples, |at, x| {
        let (own, behind) = x.split_at(n);
        for k in 0..n {
            out.states[k][at] = own[k];
            out.of_response[k][at] = behind[k];
        }
        let through = match source {
            Source::Series(series, _) => direct * series.get(at).copied().unwrap_or(0.0),
            Source::Constant => direct,
            Source::Impulse => 0.0,
        };
        out.response[at] = through + proper.iter().zip(own).map(|(b, x)| b * x).sum::<f64>();
    });
    Some(out)
}

/// Filters a series by `s^k/A`, taking it as linear between its samples.
pub(super) fn filtered(a: &[f64], series: &[f64], period: f64) -> Option<Vec<Vec<f64>>> {
    let n = a.len();
    let mut input = vec![0.0; n];
    input[n - 1] = 1.0;
    let stepper = Stepper::new(&companion(a), &input, period)?;
    let mut out = vec![vec![0.0; series.len()]; n];
    stepper.run(vec![0.0; n], Source::Series(series, Hold::Linear), series.len(), |at, x| {
        for (column, x) in out.iter_mut().zip(x) {
            column[at] = *x;
        }
    });
    Some(out)
}

/// The roots of `s^n + a[n-1] s^(n-1) + ... + a[0]`; `None` where they are not found.
pub(super) fn roots(a: &[f64]) -> Option<Vec<nalgebra::Complex<f64>>> {
    eigenvalues(companion(a))
}

/// The eigenvalues of a matrix; `None` where the iteration does not end.
pub(super) fn eigenvalues(matrix: DMatrix<f64>) -> Option<Vec<nalgebra::Complex<f64>>> {
    if matrix.nrows() == 0 {
        return Some(Vec::new());
    }
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let schur = nalgebra::Schur::try_new(matrix, f64::EPSILON, 1000)?;
    Some(schur.complex_eigenvalues().iter().copied().collect())
}

/// The coefficients of the monic polynomial with these roots (closed under conjugation), lowest power first, without the 1.
pub(super) fn polynomial(roots: &[nalgebra::Complex<f64>]) -> Vec<f64> {
    let mut all = vec![nalgebra::Complex::new(1.0, 0.0)];
    for root in roots {
        let shifted: Vec<_> = std::iter::once(nalgebra::Complex::new(0.0, 0.0)).chain(all.iter().copied()).collect();
        let scaled = all.iter().map(|c| c * root).chain(std::iter::once(nalgebra::Complex::new(0.0, 0.0)));
        all = shifted.iter().zip(scaled).map(|(s, r)| s - r).collect();
    }
    all.pop();
    all.iter().map(|c| c.re).collect()
}
