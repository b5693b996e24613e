//! What effects on the plant oppose to its motion: dry friction by its level, every other law by its force.

use super::run::{Mode, Run};
use crate::body::Body;
use crate::law::Law;

impl Run<'_> {
    /// Level of dry friction on the rubbing mass for a slide towards `side`.
    pub(super) fn level(&self, side: f64, q: f64, v: f64, load: f64) -> f64 {
        let mut sum = match &self.body {
            Body::Chain(c)
                if self.machine.regularised.is_none()
                    && !self.machine.effects.iter().any(|e| e.law.replaces_friction()) =>
            {
                c.friction
            }
            _ => 0.0,
        };
        for e in &self.machine.effects {
            sum += match e.law {
                Law::Coulomb => e.p[0],
                Law::AsymmetricFriction => e.p[if side > 0.0 { 0 } else { 1 }],
                Law::Stribeck => e.p[0] + e.p[1] * (-(v / e.p[2]).powi(2)).exp(),
                Law::LoadDependent => e.p[0] * load.abs(),
                Law::PositionCoulomb => e.p[0] * (1.0 + 0.9 * (q / e.p[1]).sin()),
                _ => 0.0,
            };
        }
        sum.max(0.0)
    }

    /// Resisting force of effect `i` (a law without dry friction) on its mass, and the rates of its inner states.
    pub(super) fn resist(&self, i: usize, t: f64, x: &[f64], mode: &[i8], dx: &mut [f64]) -> f64 {
        let e = &self.machine.effects[i];
        let (at, p) = (self.at[i], &e.p);
        let (q, v) = self.motion(t, x, e.dof);
        let piece = || self.piece(i, q, v, mode);
        match e.law {
            Law::Dahl => {
                dx[at] = (v - v.abs() * x[at]) / p[1];
                p[0] * x[at]
            }
            Law::LuGre => {
                // z in units of z_s; sigma_0 = F_c/z_s.
                let level = p[0] + (p[1] - p[0]) * (-(v / p[2]).powi(2)).exp();
                let rate = v - v.abs() * x[at] * p[0] / level;
                dx[at] = rate / p[3];
                p[0] * x[at] + p[4] * rate
            }
            Law::Elastoplastic => {
                // Dupont et al. 2002: no plastic slip below the breakaway share z_ba.
                let z = x[at];
                let share = if z * v <= 0.0 || z.abs() <= p[2] {
                    0.0
                } else if z.abs() >= 1.0 {
                    1.0
                } else {
                    0.5 - 0.5 * (std::f64::consts::PI * (1.0 + p[2] - 2.0 * z.abs()) / (2.0 * (1.0 - p[2]))).sin()
                };
                dx[at] = v * (1.0 - share * z.abs()) / p[1];
                p[0] * z
            }
            Law::QuadraticDamping => p[0] * v * v.abs(),
            Law::PowerLaw => p[0] * v.signum() * v.abs().powf(p[1]),
            Law::SquareRootDamping => p[0] * v.signum() * v.abs().sqrt(),
            Law::DisplacementDamping => p[0] * q * q * v,
            Law::Cubic => p[0] * q.powi(3),
            Law::Quintic => p[0] * q.powi(5),
            Law::QuadraticStiffness => p[0] * q * q,
            Law::GapStop => match piece() {
                0 => 0.0,
                side => p[0] * (q - f64::from(side) * p[1]),
            },
            Law::Bilinear => p[0] * (q - p[1]) * f64::from(piece()),
            Law::SpringClearance => {
                let k = match &self.body {
                    Body::Chain(c) => c.k[e.dof],
                    Body::Specimen(s) => s[1],
                    _ => 0.0,
                };
                match piece() {
                    0 => -k * q,
                    side => -k * f64::from(side) * p[0],
                }
            }
            Law::ImpactDamping => p[0] * v * f64::from(piece()),
            Law::BoucWen | Law::AsymmetricBoucWen | Law::Pinching | Law::Degradation => {
                let z = x[at];
                let grown = z.abs().powf(p[3]);
                let mut bend = p[2] * (v * z).signum() + 1.0 - p[2];
                if e.law == Law::AsymmetricBoucWen {
                    bend += p[4] * (z.signum() + v.signum());
                }
                let mut gain = 1.0;
                if e.law == Law::Degradation {
                    gain = (1.0 - p[4] * x[at + 1]).max(0.05);
                    dx[at + 1] = z * v / p[1];
                }
                let mut rate = v * (gain - grown * bend);
                if e.law == Law::Pinching {
                    rate *= 1.0 - p[4] * (-((z * v.signum() - p[6]) / p[5]).powi(2)).exp();
                }
                dx[at] = rate / p[1];
                p[0] * z
            }
            Law::UnmodelledMode => {
                let w = std::f64::consts::TAU * p[1];
                let pull = p[0] * (w * w * (x[at] - q) + 2.0 * p[2] * w * (x[at + 1] - v));
                dx[at] = x[at + 1];
                dx[at + 1] = -pull / p[0].max(f64::MIN_POSITIVE);
                -pull
            }
            Law::Gravity => p[0] * (q + p[1]).sin(),
            Law::Cogging => p[0] * (std::f64::consts::TAU * q / p[1] + p[2]).sin(),
            Law::Viscoelastic => {
                dx[at] = (q - x[at]) / p[1];
                p[0] * (q - x[at])
            }
            Law::Fractional => {
                let mut sum = 0.0;
                for cell in 0..6 {
                    let tau = p[1] * 0.25_f64.powi(cell as i32);
                    dx[at + cell] = (q - x[at + cell]) / tau;
                    sum += (p[1] / tau).powf(p[2]) * (q - x[at + cell]);
                }
                p[0] * sum
            }
            Law::DisplacementSpeed => p[0] * q * v.abs(),
            Law::SpeedSine => p[0] * v * (q / p[1]).sin(),
            Law::InputStiffness => p[0] * self.path.at(t).abs() * q,
            Law::ChatterRelay => {
                let up = self.list.iter().position(|m| *m == Mode::Relay(i)).map_or(1, |j| mode[j]);
                p[0] * f64::from(up)
            }
            Law::PeriodicDisturbance => -p[0] * (std::f64::consts::TAU * p[1] * t + p[2]).sin(),
            Law::Leakage => p[0] * q.max(0.0).sqrt(),
            Law::Overflow => {
                let above = self.list.iter().position(|m| *m == Mode::Above(i)).map_or(0, |j| mode[j]);
                p[0] * (q - p[1]) * f64::from(above)
            }
            // A sliding specimen: the imposed motion never rests, so that the sign is the whole law.
            law if law.sticks() && self.machine.kind.prescribed() => {
                v.signum() * self.level(v.signum(), q, v, self.load(t))
            }
            _ => 0.0,
        }
    }

    /// What presses on the rubbing surface in load-dependent friction: the drive.
    pub(super) fn load(&self, t: f64) -> f64 {
        self.path.at(t)
    }

    /// The piece of a piecewise law: from the mode where there is one, else from the motion.
    fn piece(&self, i: usize, q: f64, v: f64, mode: &[i8]) -> i8 {
        match self.list.iter().position(|m| *m == Mode::Piece(i)) {
            Some(j) => mode[j],
            None => self.piece_at(i, q, v),
        }
    }

    pub(super) fn piece_at(&self, i: usize, q: f64, v: f64) -> i8 {
        let e = &self.machine.effects[i];
        let sided = |g: f64| {
            if q > g {
                1
            } else if q < -g {
                -1
            } else {
                0
            }
        };
        match e.law {
            Law::GapStop => sided(e.p[1]),
            Law::SpringClearance => sided(e.p[0]),
            Law::Bilinear => i8::from(q > e.p[1]),
            _ => i8::from(q > e.p[1] && v > 0.0),
        }
    }

    pub(super) fn piece_guard(&self, i: usize, piece: i8, q: f64, v: f64) -> f64 {
        let e = &self.machine.effects[i];
        let two_sided = |g: f64| match piece {
            0 => g - q.abs(),
            side => f64::from(side) * q - g,
        };
        match e.law {
            Law::GapStop => two_sided(e.p[1]),
            Law::SpringClearance => two_sided(e.p[0]),
            Law::Bilinear => (q - e.p[1]) * if piece == 1 { 1.0 } else { -1.0 },
            _ => (q - e.p[1]).min(v) * if piece == 1 { 1.0 } else { -1.0 },
        }
    }
}
