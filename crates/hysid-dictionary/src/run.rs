//! The free run, compiled: what the inputs contribute is multiplied out in advance by stretches, what the output feeds back is
//! one product and one sum for each distinct product of outputs.
//!
//! A term is theta * (product of inputs) * (product of outputs). Terms with the same product of outputs share one
//! coefficient that varies with time, and that varies with the inputs only, so it is computed by the stretch.

use crate::record::{FIRST_SIGN, differences, next_sign};
use crate::{Factor, Quantity, Run, Signal, Signals, Term};

/// Samples in a stretch: its coefficients stay in the cache.
const STRETCH: usize = 512;

/// One distinct product of outputs.
#[derive(Debug, Clone, PartialEq)]
struct Feedback {
    factors: Vec<Factor>,
    /// Lags, when all factors are plain values.
    lags: Option<Vec<usize>>,
    /// The terms that share it: coefficient and input factors.
    terms: Vec<(f64, Vec<Factor>)>,
}

/// A model in the form that runs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Compiled {
    /// The first one is the empty product: what does not feed back.
    feedback: Vec<Feedback>,
    /// Input quantities that are not in the inputs themselves.
    derived: Vec<Quantity>,
    output_sign: bool,
}

impl Compiled {
    pub fn new(terms: &[Term], theta: &[f64]) -> Self {
        let is_output = |f: &Factor| f.quantity.signal() == Signal::Output;
        let mut feedback = vec![Feedback { factors: Vec::new(), lags: None, terms: Vec::new() }];
        let mut derived: Vec<Quantity> = Vec::new();
        for (term, &theta) in terms.iter().zip(theta) {
            let (outputs, inputs): (Vec<Factor>, Vec<Factor>) = term.factors().iter().copied().partition(is_output);
            derived.extend(inputs.iter().map(|f| f.quantity).filter(|q| !matches!(q, Quantity::Value(_))));
            match feedback.iter_mut().find(|f| f.factors == outputs) {
                Some(shared) => shared.terms.push((theta, inputs)),
                None => {
                    let plain = outputs.iter().all(|f| matches!(f.quantity, Quantity::Value(_)));
                    let lags = plain.then(|| outputs.iter().map(|f| f.lag).collect());
                    feedback.push(Feedback { factors: outputs, lags, terms: vec![(theta, inputs)] });
                }
            }
        }
        derived.sort();
        derived.dedup();
        let output_sign = feedback.iter().flat_map(|f| &f.factors).any(|f| f.quantity.is_sign());
        Self { feedback, derived, output_sign }
    }

    /// Runs from sample `begin` on; `y` holds the start, and is filled.
    pub fn run(&self, signals: &Signals, inputs: &[&[f64]], mut y: Vec<f64>, begin: usize, limit: f64) -> Run {
        let length = y.len();
        let threshold = |s: Signal| signals.name(s).map_or(0.0, |n| n.threshold);
        let derived: Vec<Vec<f64>> =
            self.derived.iter().map(|&q| derive(q, inputs, threshold(q.signal()), length)).collect();
        let mut sign = Vec::new();
        if self.output_sign {
            sign = vec![FIRST_SIGN; length];
            for n in 1..begin {
                sign[n] = next_sign(sign[n - 1], y[n] - y[n - 1], threshold(Signal::Output));
            }
        }
        let groups = self.feedback.len();
        let mut coefficients = vec![0.0; STRETCH * groups];
        let mut product = vec![0.0; STRETCH];
        let mut at = begin;
        while at < length {
            let len = STRETCH.min(length - at);
            for (g, feedback) in self.feedback.iter().enumerate() {
                let out = &mut coefficients[g * STRETCH..g * STRETCH + len];
                out.fill(0.0);
                for (theta, factors) in &feedback.terms {
                    self.add_inputs(*theta, factors, inputs, &derived, at, &mut product[..len], out);
                }
            }
            for n in at..at + len {
                let mut sum = coefficients[n - at];
                for (g, feedback) in self.feedback.iter().enumerate().skip(1) {
                    let c = coefficients[g * STRETCH + n - at];
                    sum += match feedback.lags.as_deref() {
                        Some(&[a]) => c * y[n - a],
                        Some(&[a, b]) => c * (y[n - a] * y[n - b]),
                        Some(&[a, b, d]) => c * (y[n - a] * y[n - b] * y[n - d]),
                        _ => feedback.factors.iter().fold(c, |p, f| {
                            let k = n - f.lag;
                            p * match f.quantity {
                                Quantity::Value(_) => y[k],
                                Quantity::Difference(_) => y[k] - y[k - 1],
                                Quantity::Sign(_) => sign[k],
                            }
                        }),
                    };
                }
                // Written so that NaN counts as diverged.
                if !(sum.abs() <= limit) {
                    return Run { y, diverged_at: Some(n) };
                }
                y[n] = sum;
                if self.output_sign && n > 0 {
                    sign[n] = next_sign(sign[n - 1], sum - y[n - 1], threshold(Signal::Output));
                }
            }
            at += len;
        }
        Run { y, diverged_at: None }
    }

    /// Adds theta times the product of input factors over a stretch to `out`.
    #[allow(clippy::too_many_arguments, reason = "one call site, in a loop that must not allocate")]
    fn add_inputs(
        &self,
        theta: f64,
        factors: &[Factor],
        inputs: &[&[f64]],
        derived: &[Vec<f64>],
        at: usize,
        product: &mut [f64],
        out: &mut [f64],
    ) {
        product.fill(theta);
        for f in factors {
            let x: &[f64] = match (f.quantity, f.quantity.signal()) {
                (Quantity::Value(_), Signal::Input(i)) => inputs[i],
                (q, _) => self.derived.binary_search(&q).map_or(&[], |i| &derived[i]),
            };
            let from = at - f.lag;
            for (p, x) in product.iter_mut().zip(&x[from..from + out.len()]) {
                *p *= x;
            }
        }
        for (o, p) in out.iter_mut().zip(product) {
            *o += *p;
        }
    }
}

/// A quantity of an input, sample by sample.
fn derive(quantity: Quantity, inputs: &[&[f64]], threshold: f64, length: usize) -> Vec<f64> {
    let mut out = vec![0.0; length];
    if let Signal::Input(i) = quantity.signal() {
        differences(inputs[i], &mut out);
    }
    if quantity.is_sign() {
        let mut sign = FIRST_SIGN;
        for o in &mut out {
            sign = next_sign(sign, *o, threshold);
            *o = sign;
        }
    }
    out
}
