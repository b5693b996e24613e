//! Inputs that are computed from recorded ones before a model sees them: operators with memory, filters, a soft threshold.
//!
//! A derived input is a signal like any other to the dictionary (`w1[n-1]*u[n]`), so that a polynomial in it is a Hammerstein,
//! Wiener or hysteresis model. It depends on inputs only, never on the output: a free run needs nothing else. Its memory
//! starts anew at the beginning of every gap-free stretch, at rest with the first sample.
//!
//! References: play and Dahl operators, Visintin, *Differential Models of Hysteresis* (1994) and Dahl, AIAA J. 14 (1976);
//! block-oriented models, Giri and Bai, *Block-oriented Nonlinear System Identification* (2010).

use crate::NarxError;

/// What a play remembers when a recording begins.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Past {
    /// It rests with the first sample.
    #[default]
    FirstSample,
    /// The source had rested at this level (as a virgin or demagnetised machine at 0) and went straight to its first sample.
    RestedAt(f64),
    /// The source had turned at this level, after a long way to it, and went straight to its first sample.
    TurnedAt(f64),
}

impl Past {
    /// The play of half-width `r` just before the source goes to its `first` sample.
    fn play(self, first: f64, r: f64) -> f64 {
        match self {
            Self::FirstSample => first,
            Self::RestedAt(level) => level,
            // On the way up from a turning point the play lies above the level, on the way down below.
            Self::TurnedAt(level) if level <= first => level + r,
            Self::TurnedAt(level) => level - r,
        }
    }

    fn level(self) -> Option<f64> {
        match self {
            Self::FirstSample => None,
            Self::RestedAt(level) | Self::TurnedAt(level) => Some(level),
        }
    }
}

/// What a derived input does with its source.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Law {
    /// Backlash of this half-width, in the source's unit.
    Play {
        /// Half-width, from 0.
        half_width: f64,
        /// What it remembers at its first sample.
        past: Past,
    },
    /// Rate-independent presliding friction from -1 to 1: dw = (sgn(dx) - w) |dx| / length, integrated exactly.
    Dahl {
        /// Travel over which the friction turns round, in the source's unit; above 0.
        length: f64,
    },
    /// A linear filter of unity gain at rest: w\[n\] = (1 + a_1 + ... + a_k) x\[n\] - a_1 w\[n-1\] - ... - a_k w\[n-k\].
    Filter {
        /// a_1 ... a_k; all poles inside the unit circle.
        a: Vec<f64>,
    },
    /// A threshold with a rounded corner, s ln(1 + exp((x - centre) / s)): 0 far below, x - centre far above.
    SoftThreshold {
        /// Where the corner lies, in the source's unit.
        centre: f64,
        /// Over what width s it is rounded, in the source's unit; above 0.
        width: f64,
    },
}

/// A signal computed from an input.
#[derive(Debug, Clone, PartialEq)]
pub struct Derived {
    /// Its symbol in terms, as `w1`.
    pub symbol: String,
    /// The input that it is made of: a number below the number of recorded inputs is one of these, above it an earlier
    /// derived input.
    pub source: usize,
    /// What it does.
    pub law: Law,
}

impl Law {
    /// The law as the user reads it, with `x` for its source.
    pub fn describe(&self, x: &str) -> String {
        match self {
            Self::Play { half_width, past } => match past {
                Past::FirstSample => format!("play({x}, {half_width:.6})"),
                Past::RestedAt(level) => {
                    format!("play({x}, {half_width:.6}), as if {x} had rested at {level:.6} before")
                }
                Past::TurnedAt(level) => {
                    format!("play({x}, {half_width:.6}), as if {x} had turned at {level:.6} before")
                }
            },
            Self::Dahl { length } => format!("presliding friction of {x} over {length:.6}"),
            Self::Filter { a } => {
                let a: Vec<String> = a.iter().map(|v| format!("{v:.6}")).collect();
                format!("{x} filtered by 1/(1, {})", a.join(", "))
            }
            Self::SoftThreshold { centre, width } => {
                format!("the part of {x} above {centre:.6}, rounded over {width:.6}")
            }
        }
    }

    /// The numbers that refinement may move.
    pub fn parameters(&self) -> Vec<f64> {
        match self {
            Self::Play { half_width, .. } => vec![*half_width],
            Self::Dahl { length } => vec![length.max(f64::MIN_POSITIVE).ln()],
            Self::Filter { a } => a.clone(),
            Self::SoftThreshold { centre, width } => vec![*centre, width.max(f64::MIN_POSITIVE).ln()],
        }
    }

    /// The same law with these numbers, as [`Law::parameters`] gave them; `None` where they are not allowed.
    pub fn with_parameters(&self, p: &[f64]) -> Option<Self> {
        let law = match (self, p) {
            (Self::Play { past, .. }, &[half_width]) => Self::Play { half_width, past: *past },
            (Self::Dahl { .. }, &[l]) => Self::Dahl { length: l.exp() },
            (Self::Filter { a }, p) if p.len() == a.len() => Self::Filter { a: p.to_vec() },
            (Self::SoftThreshold { .. }, &[centre, w]) => Self::SoftThreshold { centre, width: w.exp() },
            _ => return None,
        };
        law.problem().is_none().then_some(law)
    }

    /// What is wrong with its numbers, if anything.
    pub fn problem(&self) -> Option<String> {
        match self {
            Self::Play { half_width, .. } if !(half_width.is_finite() && *half_width >= 0.0) => {
                Some(format!("half-width {half_width}; it must be a finite number of 0 or more"))
            }
            Self::Play { past, .. } if past.level().is_some_and(|l| !l.is_finite()) => {
                Some("its past is not a finite number".into())
            }
            Self::Dahl { length } if !(length.is_finite() && *length > 0.0) => {
                Some(format!("length {length}; it must be a finite number above 0"))
            }
            Self::Filter { a } if !is_stable(a) => Some(format!("filter {a:?} is not stable")),
            Self::SoftThreshold { centre, width } if !(centre.is_finite() && width.is_finite() && *width > 0.0) => {
                Some(format!("centre {centre}, width {width}; the width must be above 0"))
            }
            _ => None,
        }
    }

    /// The response to one gap-free stretch `x`, from rest at `x[0]`, into `out` (equally long).
    pub fn respond(&self, x: &[f64], out: &mut [f64]) {
        let Some(&first) = x.first() else { return };
        match self {
            Self::Play { half_width, past } => {
                let mut w = past.play(first, *half_width);
                for (o, &x) in out.iter_mut().zip(x) {
                    w = hysid_hysteresis::play(w, x, *half_width);
                    *o = w;
                }
            }
            Self::Dahl { length } => {
                let (mut w, mut before) = (0.0, first);
                for (o, &x) in out.iter_mut().zip(x) {
                    w = hysid_hysteresis::dahl(w, x - before, *length);
                    before = x;
                    *o = w;
                }
            }
            Self::Filter { a } => {
                let gain = 1.0 + a.iter().sum::<f64>();
                for n in 0..x.len().min(out.len()) {
                    let mut w = gain * x[n];
                    for (i, a) in a.iter().enumerate() {
                        w -= a * if n > i { out[n - 1 - i] } else { first };
                    }
                    out[n] = w;
                }
            }
            Self::SoftThreshold { centre, width } => {
                for (o, &x) in out.iter_mut().zip(x) {
                    let z = (x - centre) / width;
                    // ln(1 + e^z) without overflow.
                    *o = width * (z.max(0.0) + (-z.abs()).exp().ln_1p());
                }
            }
        }
    }
}

impl Derived {
    /// Checks that its source comes before it and its numbers are allowed; `before` is the number of signals before it.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self, before: usize) -> Result<(), NarxError> {
        let bad = |problem: String| NarxError::BadDerived { symbol: self.symbol.clone(), problem };
        if self.source >= before {
            return Err(bad(format!("its source is signal {}; there are {before} before it", self.source)));
        }
        self.law.problem().map_or(Ok(()), |p| Err(bad(p)))
    }
}

/// Whether all poles of 1/(1 + a_1 q^-1 + ...) lie inside the unit circle (Jury's test by step-down).
pub(crate) fn is_stable(a: &[f64]) -> bool {
    let mut a = a.to_vec();
    while let Some(k) = a.pop() {
        if !(k.abs() < 1.0) {
            return false;
        }
        let d = 1.0 - k * k;
        let m = a.len();
        let old = a.clone();
        for i in 0..m {
            a[i] = (old[i] - k * old[m - 1 - i]) / d;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stability_by_step_down_agrees_with_known_poles() {
        // (1 - p q)(1 - r q): a = [-(p + r), p r]
        for (p, r, stable) in [(0.5, 0.9, true), (-0.99, 0.3, true), (1.01, 0.2, false), (0.5, -1.0, false)] {
            assert_eq!(is_stable(&[-(p + r), p * r]), stable, "{p} {r}");
        }
        // Complex poles of radius R: a = [-2 R cos, R^2].
        assert!(is_stable(&[-2.0 * 0.99 * 0.3f64.cos(), 0.99 * 0.99]));
        assert!(!is_stable(&[-2.0 * 1.01 * 0.3f64.cos(), 1.01 * 1.01]));
        assert!(is_stable(&[]));
    }

    #[test]
    fn a_filter_at_rest_stays_at_rest_and_keeps_the_mean() {
        let law = Law::Filter { a: vec![-1.2, 0.5] };
        let x = vec![3.0; 50];
        let mut out = vec![0.0; 50];
        law.respond(&x, &mut out);
        assert!(out.iter().all(|v| (v - 3.0).abs() < 1e-12));
    }

    #[test]
    fn dahl_does_not_depend_on_the_sampling_of_a_monotone_stretch() {
        let law = Law::Dahl { length: 0.7 };
        let end = |n: usize| {
            let x: Vec<f64> = (0..=n).map(|i| 2.0 * i as f64 / n as f64).collect();
            let mut out = vec![0.0; x.len()];
            law.respond(&x, &mut out);
            out[n]
        };
        assert!((end(1) - end(1000)).abs() < 1e-12);
        assert!((end(1) - (1.0 - (-2.0f64 / 0.7).exp())).abs() < 1e-12);
    }

    #[test]
    fn a_play_remembers_where_its_source_came_from() {
        let x = [0.0, 0.2, 1.0, 0.9];
        // The law, and its answer to x.
        let cases = [
            (Past::FirstSample, [0.0, 0.0, 0.5, 0.5]),
            // It had rested at 0.2; from 2 the first sample took it along.
            (Past::RestedAt(0.2), [0.2, 0.2, 0.5, 0.5]),
            (Past::RestedAt(2.0), [0.5, 0.5, 0.5, 0.5]),
            // It had turned at -0.4 with the play at 0.1.
            (Past::TurnedAt(-0.4), [0.1, 0.1, 0.5, 0.5]),
            // From far below the play lags behind, from far above it lies ahead.
            (Past::TurnedAt(-9.0), [-0.5, -0.3, 0.5, 0.5]),
            (Past::TurnedAt(9.0), [0.5, 0.5, 0.5, 0.5]),
        ];
        for (past, expected) in cases {
            let mut out = [0.0; 4];
            Law::Play { half_width: 0.5, past }.respond(&x, &mut out);
            for (a, b) in out.iter().zip(expected) {
                assert!((a - b).abs() < 1e-14, "{past:?}: {out:?}");
            }
        }
    }

    #[test]
    fn a_soft_threshold_is_the_part_above_and_does_not_overflow() {
        let law = Law::SoftThreshold { centre: 1.0, width: 0.01 };
        let mut out = [0.0; 3];
        law.respond(&[-1e6, 2.0, 1e6], &mut out);
        assert!(out[0].abs() < 1e-12 && (out[1] - 1.0).abs() < 1e-12 && (out[2] - 999_999.0).abs() < 1e-6);
    }

    #[test]
    fn parameters_return() {
        for law in [
            Law::Play { half_width: 0.3, past: Past::TurnedAt(-1.0) },
            Law::Dahl { length: 2.0 },
            Law::Filter { a: vec![-0.5, 0.2] },
            Law::SoftThreshold { centre: -1.0, width: 0.5 },
        ] {
            let back = law.with_parameters(&law.parameters()).unwrap();
            for (a, b) in back.parameters().iter().zip(law.parameters()) {
                assert!((a - b).abs() < 1e-14);
            }
        }
        assert!(Law::Play { half_width: 0.3, past: Past::FirstSample }.with_parameters(&[-1.0]).is_none());
    }
}
