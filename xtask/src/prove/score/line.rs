//! A line of the table: a share of cases or a figure, with its interval, against its target.

use super::super::stats::{quantile, quantile_interval, wilson};

/// How a line compares with its target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// Met.
    Met,
    /// Missed.
    Missed,
    /// Too few cases to say.
    Open,
}

/// One line of the table.
#[derive(Debug, Clone)]
pub struct Line {
    /// What is measured.
    pub what: String,
    /// The target in words.
    pub target: String,
    /// The figure.
    pub value: f64,
    /// Its 95 % interval.
    pub interval: (f64, f64),
    /// Number of cases or statements.
    pub n: usize,
    /// Comparison.
    pub standing: Standing,
    /// Whether it is one of the first five.
    pub gate: bool,
    /// Whether the figure is a share (printed in percent).
    pub share: bool,
}

pub(super) fn share(what: &str, target: &str, hits: usize, n: usize, limit: f64, most: bool, gate: bool) -> Line {
    let value = if n == 0 { f64::NAN } else { hits as f64 / n as f64 };
    let standing = match n {
        0 => Standing::Open,
        _ if (most && value <= limit) || (!most && value >= limit) => Standing::Met,
        _ => Standing::Missed,
    };
    Line { what: what.into(), target: target.into(), value, interval: wilson(hits, n), n, standing, gate, share: true }
}

pub(super) fn figure(what: &str, target: &str, values: &[f64], q: f64, limit: f64, gate: bool) -> Line {
    let value = quantile(values, q);
    let standing = match values.len() {
        0 => Standing::Open,
        _ if value <= limit => Standing::Met,
        _ => Standing::Missed,
    };
    Line {
        what: what.into(),
        target: target.into(),
        value,
        interval: quantile_interval(values, q),
        n: values.len(),
        standing,
        gate,
        share: false,
    }
}

pub(super) fn plain(what: &str, target: &str, value: f64, n: usize, limit: f64) -> Line {
    let standing = if n == 0 {
        Standing::Open
    } else if value <= limit {
        Standing::Met
    } else {
        Standing::Missed
    };
    Line {
        what: what.into(),
        target: target.into(),
        value,
        interval: (f64::NAN, f64::NAN),
        n,
        standing,
        gate: false,
        share: false,
    }
}

/// A figure without a target, beside which another is read.
pub(super) fn beside(what: &str, value: f64, n: usize) -> Line {
    Line { standing: Standing::Open, ..plain(what, "-", value, n, f64::INFINITY) }
}

pub(super) fn told(what: &str, hits: usize, n: usize) -> Line {
    let mut line = share(what, "-", hits, n, 0.0, false, false);
    line.standing = Standing::Open;
    line
}
