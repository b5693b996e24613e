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

/// What a line is held against.
#[derive(Debug, Clone, Copy)]
pub(super) enum Target {
    /// Nothing: another line is read beside it.
    None,
    /// No more than this.
    AtMost(f64),
    /// No less than this.
    AtLeast(f64),
    /// Between these.
    Within(f64, f64),
}

impl Target {
    fn standing(self, value: f64, n: usize) -> Standing {
        let met = match self {
            Self::None => return Standing::Open,
            Self::AtMost(limit) => value <= limit,
            Self::AtLeast(limit) => value >= limit,
            Self::Within(low, high) => (low..=high).contains(&value),
        };
        match n {
            0 => Standing::Open,
            _ if met => Standing::Met,
            _ => Standing::Missed,
        }
    }

    /// In words, of a share in percent.
    fn words(self, share: bool) -> String {
        // As many digits as the number has: 1.5 %, 97 %.
        let of = |x: f64| if share { format!("{}", (1e4 * x).round() / 1e2) } else { format!("{x}") };
        let unit = if share { " %" } else { "" };
        match self {
            Self::None => "-".into(),
            Self::AtMost(limit) => format!("<= {}{unit}", of(limit)),
            Self::AtLeast(limit) => format!(">= {}{unit}", of(limit)),
            Self::Within(low, high) => format!("{} to {}{unit}", of(low), of(high)),
        }
    }
}

impl Line {
    /// A share of cases.
    pub(super) fn share(what: &str, (hits, n): (usize, usize), target: Target) -> Self {
        let value = if n == 0 { f64::NAN } else { hits as f64 / n as f64 };
        Self {
            interval: wilson(hits, n),
            share: true,
            target: target.words(true),
            ..Self::plain(what, value, n, target)
        }
    }

    /// A quantile of figures.
    pub(super) fn figure(what: &str, values: &[f64], q: f64, target: Target) -> Self {
        let interval = quantile_interval(values, q);
        Self { interval, ..Self::plain(what, quantile(values, q), values.len(), target) }
    }

    /// A figure without an interval.
    pub(super) fn plain(what: &str, value: f64, n: usize, target: Target) -> Self {
        Self {
            what: what.into(),
            target: target.words(false),
            value,
            interval: (f64::NAN, f64::NAN),
            n,
            standing: target.standing(value, n),
            gate: false,
            share: false,
        }
    }

    /// The same as one of the first five, which pass or fail.
    pub(super) fn gate(self) -> Self {
        Self { gate: true, ..self }
    }
}
