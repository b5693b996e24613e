//! The samples of one recording, as a dictionary needs them.

use std::ops::Range;

use hysid_linalg::all_finite;

/// One recording: the output and the inputs on one clock. A missing sample is `NaN`.
#[derive(Debug, Clone)]
pub struct Record<'a> {
    /// The output, in its own unit.
    pub y: &'a [f64],
    /// The inputs in the order of the dictionary's signals, each as long as `y`.
    pub inputs: Vec<&'a [f64]>,
    /// The stretches to use; `None` is the whole record. Samples outside are not even used as lags.
    pub stretches: Option<Vec<Range<usize>>>,
}

/// Samples that are looked at together for gaps.
const LOOK: usize = 1024;

impl<'a> Record<'a> {
    /// A recording, the whole of it; it is cut at missing samples.
    pub fn new(y: &'a [f64], inputs: Vec<&'a [f64]>) -> Self {
        Self { y, inputs, stretches: None }
    }

    /// A recording of one input and one output.
    pub fn siso(u: &'a [f64], y: &'a [f64]) -> Self {
        Self::new(y, vec![u])
    }

    /// The gap-free stretches, in order.
    pub fn gap_free(&self) -> Vec<Range<usize>> {
        let all = [0..self.y.len()];
        let allowed: &[Range<usize>] = self.stretches.as_deref().unwrap_or(&all);
        let mut found = Vec::new();
        for stretch in allowed {
            let (start, end) = (stretch.start.min(self.y.len()), stretch.end.min(self.y.len()));
            let mut from = start;
            let mut at = start;
            while at < end {
                let next = end.min(at + LOOK);
                // Most data have no gaps, and a stretch without one is known faster as a whole.
                if !(all_finite(&self.y[at..next]) && self.inputs.iter().all(|u| all_finite(&u[at..next]))) {
                    for n in at..next {
                        if !(self.y[n].is_finite() && self.inputs.iter().all(|u| u[n].is_finite())) {
                            if from < n {
                                found.push(from..n);
                            }
                            from = n + 1;
                        }
                    }
                }
                at = next;
            }
            if from < end {
                found.push(from..end);
            }
        }
        found
    }
}

/// Writes the differences of `x` over one stretch into `out`; the first has no predecessor and is 0.
pub(crate) fn differences(x: &[f64], out: &mut [f64]) {
    if let Some(first) = out.first_mut() {
        *first = 0.0;
    }
    for (o, pair) in out.iter_mut().skip(1).zip(x.windows(2)) {
        *o = pair[1] - pair[0];
    }
}

/// The sign after a difference, given the sign before it.
pub fn next_sign(before: f64, difference: f64, threshold: f64) -> f64 {
    if difference.abs() <= threshold { before } else { difference.signum() }
}

/// The sign at the beginning of a stretch.
pub const FIRST_SIGN: f64 = 1.0;
