//! Effects of unit strength: each law's parameters from the sizes of the plant's motion.

use std::f64::consts::{PI, TAU};

use super::{Design, Source};
use crate::body::Kind;
use crate::law::{Effect, Law, Place};
use crate::seed::Random;

impl Design {
    /// An effect of unit strength of this law, or `None` where it would mean nothing.
    pub fn effect(&self, law: Law, source: &Source, random: &mut Random) -> Option<Effect> {
        let dof = match self.kind {
            Kind::TwoMasses if law.place() == Place::Plant => random.below(2),
            Kind::ThreeMasses if law.place() == Place::Plant => 2 * random.below(2),
            _ => 0,
        };
        let s = self.scales(source, dof)?;
        let r = random;
        let force = s.f;
        let drive = matches!(self.kind, Kind::Drive | Kind::ClosedDrive);
        let mut theta = 0;
        let mut scaled = None;
        let p = match law {
            Law::Coulomb | Law::QuadraticDamping | Law::Cubic | Law::Quintic | Law::QuadraticStiffness => {
                let unit = match law {
                    Law::Coulomb => 1.0,
                    Law::QuadraticDamping => s.v.powi(2),
                    Law::Cubic => s.q.powi(3),
                    Law::Quintic => s.q.powi(5),
                    _ => s.q.powi(2),
                };
                vec![force / unit]
            }
            Law::AsymmetricFriction => {
                let share = r.uniform(0.2, 0.6);
                if drive {
                    // The baseline has the mean; what is left out is the difference.
                    vec![force * share, -force * share]
                } else {
                    vec![force, force * share]
                }
            }
            Law::Stribeck => {
                vec![if drive { 0.0 } else { force }, force * r.uniform(0.4, 1.2), s.v * r.log_uniform(0.05, 0.5)]
            }
            Law::LoadDependent => vec![force / s.u],
            Law::Dahl | Law::LuGre | Law::Elastoplastic => {
                let size = if drive { self.theta[2] } else { force };
                let z = s.q * if drive { 1.0 } else { r.log_uniform(0.005, 0.4) };
                if drive {
                    scaled = Some(match law {
                        Law::LuGre => vec![3],
                        _ => vec![1],
                    });
                }
                match law {
                    Law::Dahl => vec![size, z],
                    Law::Elastoplastic => vec![size, z, r.uniform(0.5, 0.8)],
                    _ => vec![size, size * r.uniform(1.1, 1.5), s.v * r.uniform(0.1, 0.3), z, 0.05 * size / s.v],
                }
            }
            Law::PowerLaw => {
                let p = r.pick(&[0.4, 0.6, 1.6, 2.5, 3.0]);
                vec![force / s.v.powf(p), p]
            }
            Law::SquareRootDamping => vec![force / s.v.sqrt()],
            Law::DisplacementDamping => vec![force / (s.q.powi(2) * s.v)],
            Law::GapStop => vec![3.0 * force / s.q, s.q_max * r.uniform(0.3, 0.8)],
            Law::Bilinear => vec![force / s.q, s.q * r.uniform(-0.3, 0.6)],
            Law::SpringClearance => vec![s.q],
            Law::BoucWen => {
                // b = beta/(beta + gamma), gamma/beta from -0.8 to 1.
                let b = 1.0 / (1.0 + r.uniform(-0.8, 1.0));
                vec![force, s.q * r.log_uniform(0.15, 3.0), b, r.pick(&[1.0, 1.5, 2.0, 3.0])]
            }
            Law::AsymmetricBoucWen => {
                vec![force, s.q * r.log_uniform(0.3, 1.2), r.uniform(0.5, 0.8), 1.0, r.uniform(0.1, 0.25) * r.sign()]
            }
            Law::Pinching => vec![
                force,
                s.q * r.uniform(0.2, 0.6),
                r.uniform(0.5, 0.8),
                1.0,
                r.uniform(0.7, 0.95),
                r.uniform(0.15, 0.35),
                r.uniform(0.0, 0.2),
            ],
            Law::Degradation => {
                let cycles = s.v * s.length / s.q;
                vec![force, s.q * r.uniform(0.3, 1.0), r.uniform(0.5, 0.8), 1.0, r.uniform(0.6, 1.2) / (0.3 * cycles)]
            }
            Law::InputBacklash => vec![s.u],
            Law::OutputBacklash => vec![s.q],
            Law::PrandtlIshlinskii => {
                let mut p = vec![1.0];
                p.extend((1..=5).map(|i| s.u_max * 0.16 * f64::from(i)));
                let weights: Vec<f64> = (0..5).map(|_| r.uniform(0.2, 1.0)).collect();
                let sum: f64 = weights.iter().sum();
                p.extend(weights.iter().map(|w| w / sum));
                p
            }
            Law::Preisach => vec![1.0, s.u_max * 1.3, r.uniform(0.4, 0.9)],
            Law::AsymmetricHysteresis => vec![1.0, s.u_max * 1.3, r.uniform(0.4, 0.8), r.uniform(1.0, 2.0) * r.sign()],
            Law::RateDependent => vec![1.0, s.u_max, r.uniform(0.4, 1.2)],
            Law::DeadZone => vec![s.u],
            Law::InputSaturation => vec![s.u_max],
            Law::OutputSaturation => vec![s.y_max],
            Law::InputPolynomial => {
                let (b2, b3) = r.pick(&[(1.0, 0.0), (0.0, 1.0), (0.0, -0.4), (0.7, 0.5)]);
                vec![b2 / s.u, b3 / (s.u * s.u)]
            }
            Law::Delay => vec![8.0 * s.period],
            Law::ActuatorLag | Law::SensorLag => vec![8.0 * s.period],
            Law::Drift | Law::Heating | Law::AbruptChange | Law::RandomWalk | Law::Parametric => {
                theta = self.varying(law, r);
                match law {
                    Law::Drift => vec![r.sign(), s.length],
                    Law::Heating => vec![1.0, s.length * r.log_uniform(0.05, 1.0), self.power(&s)],
                    Law::AbruptChange => {
                        let at = (r.uniform(0.15, 0.85) * self.samples as f64).floor();
                        vec![r.sign(), at * s.period]
                    }
                    Law::RandomWalk => vec![1.0, 1.0 + r.below(1 << 20) as f64, s.length],
                    _ => vec![1.0, s.v / s.q / TAU * r.uniform(0.15, 0.6)],
                }
            }
            Law::UnmodelledMode => {
                let mass = match self.kind {
                    Kind::TwoMasses | Kind::ThreeMasses => self.theta[3 * dof],
                    _ => self.theta[0],
                };
                vec![mass, self.band.1 * r.uniform(0.3, 1.0), r.log_uniform(0.004, 0.15)]
            }
            Law::InputOffset => vec![s.u * r.sign()],
            Law::OutputOffset => vec![s.y * r.sign()],
            Law::Gravity if s.q_max > 0.8 => vec![force, 0.0],
            Law::Cogging => vec![force, s.q_max * r.log_uniform(0.1, 0.7), r.uniform(0.0, TAU)],
            Law::PositionInertia => vec![self.theta[0] / (s.q * s.q)],
            Law::Viscoelastic => vec![force / s.q, r.log_uniform(0.3, 3.0) * s.q / s.v],
            Law::LogCreep => {
                let fast = s.length / 300.0;
                vec![0.2, fast, 8.0 * fast, 64.0 * fast]
            }
            Law::Quantisation => vec![s.y],
            Law::Rectified => Vec::new(),
            Law::SensorDrift => vec![s.y / s.length * r.sign()],
            Law::BackEmf => vec![self.theta[1] * 2.0, 8.0 * s.period],
            Law::Leakage => vec![force / s.q.sqrt()],
            Law::Overflow => vec![5.0 * force / s.q, s.q_max * r.uniform(0.75, 0.9)],
            Law::StallLag => vec![0.5 / (TAU * self.band.0), 0.7 / (TAU * self.band.0)],
            Law::PeriodicDisturbance => vec![force, r.log_uniform(self.band.0 * 1.5, self.band.1), r.uniform(0.0, TAU)],
            Law::SolverArtefact => vec![s.v],
            Law::DisplacementSpeed => vec![force / (s.q * s.v)],
            Law::SpeedSine => vec![force / s.v, s.q * r.uniform(0.4, 0.8)],
            Law::ImpactDamping => vec![5.0 * force / s.v, s.q * r.uniform(0.3, 0.8)],
            Law::PositionCoulomb => vec![force, s.q * r.uniform(0.3, 0.7)],
            Law::Fractional => vec![force / s.q, 3.0 * s.q / s.v, r.uniform(0.3, 0.6)],
            Law::InputStiffness => vec![force / (s.u * s.q)],
            Law::ChatterRelay => vec![force, s.q * r.uniform(0.3, 0.8)],
            _ => return None,
        };
        if p.iter().any(|v| !v.is_finite()) || (PI * s.q).abs() < f64::MIN_POSITIVE {
            return None;
        }
        let mut effect = Effect::new(law, p);
        effect.dof = dof;
        effect.theta = theta;
        if let Some(scaled) = scaled {
            effect.scaled = scaled;
        }
        Some(effect)
    }

    /// Which parameter an effect in time changes.
    fn varying(&self, law: Law, random: &mut Random) -> usize {
        match (self.kind, law) {
            (_, Law::Heating) if self.kind.prescribed() => 0,
            (Kind::Oscillator | Kind::TwoMasses | Kind::ThreeMasses | Kind::Pendulum, Law::Heating) => 1,
            (Kind::Oscillator | Kind::TwoMasses | Kind::ThreeMasses, Law::Parametric) => 2,
            (Kind::Pendulum, Law::Parametric) => 2,
            (Kind::Oscillator | Kind::TwoMasses | Kind::ThreeMasses | Kind::Pendulum, _) => 1 + random.below(2),
            (Kind::Drive | Kind::ClosedDrive, _) => 1 + random.below(2),
            (Kind::Specimen, _) => random.below(2),
            (Kind::Tank | Kind::Thermal, _) => 1,
            _ => 0,
        }
    }
}
