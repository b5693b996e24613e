//! Terms made ready to run: factors resolved to columns and lags, terms as lists of factors.
//!
//! The products are taken in the order of [`hysid_dictionary::Term::evaluate`], so that a program and the dictionary's own
//! evaluator give the same bits (a property test holds them equal).

use std::collections::HashMap;

use hysid_dictionary::{Factor, Quantity, Signal, Term};

use crate::{Bank, NarxError};

/// Where a factor's value comes from.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Source {
    /// y\[n-lag\].
    Output(usize),
    /// y\[n-lag\] - y\[n-lag-1\].
    OutputDifference(usize),
    /// Its sign.
    OutputSign(usize),
    /// Column `0` of the program's inputs, `1` samples ago.
    Input(usize, usize),
}

/// Terms that share one list of factors.
#[derive(Debug, Clone)]
pub(crate) struct Program {
    /// Quantities of inputs that the factors use.
    quantities: Vec<Quantity>,
    pub(crate) factors: Vec<Source>,
    /// The factors of term `k` are `items[starts[k]..starts[k + 1]]`.
    items: Vec<u32>,
    starts: Vec<usize>,
    pub(crate) reach: usize,
    /// Largest output lag that carries a derivative, 0 without any.
    pub(crate) output_lags: usize,
}

/// The columns of a bank that a program reads.
pub(crate) struct Inputs<'b>(Vec<&'b [f64]>);

impl Program {
    pub(crate) fn new(terms: &[Term]) -> Self {
        let mut program = Self {
            quantities: Vec::new(),
            factors: Vec::new(),
            items: Vec::new(),
            starts: vec![0],
            reach: terms.iter().map(Term::reach).max().unwrap_or(0),
            output_lags: 0,
        };
        let mut known: HashMap<Factor, u32> = HashMap::new();
        let mut columns: HashMap<Quantity, usize> = HashMap::new();
        for term in terms {
            for &f in term.factors() {
                let index = *known.entry(f).or_insert_with(|| {
                    let source = match f.quantity {
                        Quantity::Value(Signal::Output) => Source::Output(f.lag),
                        Quantity::Difference(Signal::Output) => Source::OutputDifference(f.lag),
                        Quantity::Sign(Signal::Output) => Source::OutputSign(f.lag),
                        q => {
                            let next = columns.len();
                            let c = *columns.entry(q).or_insert_with(|| {
                                program.quantities.push(q);
                                next
                            });
                            Source::Input(c, f.lag)
                        }
                    };
                    program.output_lags = program.output_lags.max(match source {
                        Source::Output(l) => l,
                        Source::OutputDifference(l) => l + 1,
                        _ => 0,
                    });
                    program.factors.push(source);
                    (program.factors.len() - 1) as u32
                });
                program.items.push(index);
            }
            program.starts.push(program.items.len());
        }
        program
    }

    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// The columns it reads.
    pub(crate) fn inputs<'b>(&self, bank: &'b Bank) -> Result<Inputs<'b>, NarxError> {
        let columns: Option<Vec<&[f64]>> = self.quantities.iter().map(|&q| bank.column(q)).collect();
        columns.map(Inputs).ok_or_else(|| NarxError::BadRecord {
            record: 0,
            problem: "a term uses an input that the recording does not have".into(),
        })
    }

    /// The values of the factors at sample `n` of the inputs, which is sample `i` of `y` and `sign`.
    ///
    /// Both are at least the reach.
    #[inline]
    pub(crate) fn factor_values(
        &self,
        n: usize,
        i: usize,
        y: &[f64],
        sign: &[f64],
        inputs: &Inputs<'_>,
        v: &mut [f64],
    ) {
        for (v, f) in v.iter_mut().zip(&self.factors) {
            *v = match *f {
                Source::Output(l) => y[i - l],
                Source::OutputDifference(l) => y[i - l] - y[i - l - 1],
                Source::OutputSign(l) => sign[i - l],
                Source::Input(c, l) => inputs.0[c][n - l],
            };
        }
    }

    /// The value of term `k`, given the factors' values.
    #[inline]
    pub(crate) fn term(&self, k: usize, v: &[f64]) -> f64 {
        let items = &self.items[self.starts[k]..self.starts[k + 1]];
        let Some((&first, rest)) = items.split_first() else { return 1.0 };
        rest.iter().fold(v[first as usize], |p, &i| p * v[i as usize])
    }

    /// The sum of all terms with these coefficients.
    #[inline]
    pub(crate) fn sum(&self, theta: &[f64], v: &[f64]) -> f64 {
        theta.iter().enumerate().map(|(k, t)| t * self.term(k, v)).sum()
    }

    /// Adds to `j[l]` the derivative of the sum to y\[n-l\], given the factors' values. A sign counts as constant.
    pub(crate) fn output_jacobian(&self, theta: &[f64], v: &[f64], j: &mut [f64]) {
        for (k, t) in theta.iter().enumerate() {
            let items = &self.items[self.starts[k]..self.starts[k + 1]];
            for (at, &i) in items.iter().enumerate() {
                let (lag, difference) = match self.factors[i as usize] {
                    Source::Output(l) => (l, false),
                    Source::OutputDifference(l) => (l, true),
                    _ => continue,
                };
                let others = items.iter().enumerate().filter(|(b, _)| *b != at);
                let d = others.fold(*t, |p, (_, &i)| p * v[i as usize]);
                j[lag] += d;
                if difference {
                    j[lag + 1] -= d;
                }
            }
        }
    }
}
