//! Which laws mean something on which plant.

use crate::body::Kind;
use crate::law::Law;

/// The laws that mean something on a kind of plant.
pub fn suits(kind: Kind, law: Law) -> bool {
    use Law::{
        AbruptChange, ActuatorLag, AsymmetricBoucWen, AsymmetricFriction, AsymmetricHysteresis, BackEmf, Bilinear,
        BoucWen, ChatterRelay, Cogging, Coulomb, Cubic, Dahl, DeadZone, Degradation, Delay, DisplacementDamping,
        DisplacementSpeed, Drift, Elastoplastic, Fractional, GapStop, Gravity, Heating, ImpactDamping, InputBacklash,
        InputOffset, InputPolynomial, InputSaturation, InputStiffness, Leakage, LoadDependent, LogCreep, LuGre,
        OutputBacklash, OutputOffset, OutputSaturation, Overflow, Parametric, PeriodicDisturbance, Pinching,
        PositionCoulomb, PositionInertia, PowerLaw, PrandtlIshlinskii, Preisach, QuadraticDamping, QuadraticStiffness,
        Quantisation, Quintic, RandomWalk, RateDependent, Rectified, SensorDrift, SensorLag, SolverArtefact, SpeedSine,
        SpringClearance, SquareRootDamping, StallLag, Stribeck, UnmodelledMode, Viscoelastic,
    };
    let restoring = [Cubic, Quintic, GapStop, QuadraticStiffness, Bilinear, SpringClearance, Cogging, Viscoelastic];
    let memory = [BoucWen, AsymmetricBoucWen, Pinching, Degradation, Dahl, LuGre, Elastoplastic];
    let damping =
        [Coulomb, AsymmetricFriction, Stribeck, LoadDependent, QuadraticDamping, PowerLaw, DisplacementDamping];
    let command = [DeadZone, InputSaturation, InputPolynomial, Delay, ActuatorLag, InputOffset];
    let sensor = [OutputSaturation, Quantisation, SensorDrift];
    let time = [Drift, AbruptChange, PeriodicDisturbance];
    let strange = [
        DisplacementSpeed,
        SpeedSine,
        ImpactDamping,
        PositionCoulomb,
        Fractional,
        SquareRootDamping,
        InputStiffness,
        ChatterRelay,
        RandomWalk,
        Parametric,
    ];
    let any = |lists: &[&[Law]]| lists.iter().any(|l| l.contains(&law));
    match kind {
        Kind::Oscillator => any(&[
            &restoring,
            &memory,
            &damping,
            &command,
            &sensor,
            &time,
            &strange,
            &[Heating, OutputBacklash, SensorLag, UnmodelledMode, OutputOffset, PositionInertia, Rectified],
        ]),
        Kind::TwoMasses | Kind::ThreeMasses => any(&[
            &[
                Coulomb,
                Dahl,
                QuadraticDamping,
                Cubic,
                GapStop,
                QuadraticStiffness,
                BoucWen,
                Viscoelastic,
                UnmodelledMode,
            ],
            &command,
            &time,
            &[DisplacementSpeed, ImpactDamping, SpeedSine],
        ]),
        Kind::Drive => any(&[
            &[
                AsymmetricFriction,
                Stribeck,
                Dahl,
                LuGre,
                Elastoplastic,
                QuadraticDamping,
                InputBacklash,
                OutputBacklash,
            ],
            &[Gravity, Cogging, PositionInertia, BackEmf, SolverArtefact, Heating, UnmodelledMode, SensorLag],
            &command,
            &time,
            &[OutputSaturation, Quantisation],
            &[PositionCoulomb, SpeedSine, RandomWalk],
        ]),
        Kind::ClosedDrive => any(&[
            &[AsymmetricFriction, Stribeck, Dahl, LuGre, QuadraticDamping, Gravity, Cogging, PositionInertia, BackEmf],
            &[
                DeadZone,
                Delay,
                ActuatorLag,
                InputOffset,
                OutputBacklash,
                InputBacklash,
                Drift,
                AbruptChange,
                PeriodicDisturbance,
            ],
            &[PositionCoulomb, SpeedSine],
        ]),
        Kind::Piezo | Kind::PiezoSlow => any(&[
            &[InputBacklash, PrandtlIshlinskii, Preisach, AsymmetricHysteresis, RateDependent, LogCreep, OutputOffset],
            &[DeadZone, InputSaturation, InputPolynomial, InputOffset, Drift, AbruptChange, PeriodicDisturbance],
            &sensor,
        ]),
        Kind::Tank => any(&[
            &[Leakage, Overflow, InputSaturation, InputPolynomial, Delay, SensorLag, OutputOffset, RandomWalk],
            &time,
            &sensor,
        ]),
        Kind::Thermal => {
            any(&[&[InputPolynomial, Delay, SensorLag, InputOffset, RandomWalk], &time, &[Quantisation, SensorDrift]])
        }
        Kind::Circuit => {
            any(&[&command, &sensor, &time, &[InputBacklash, Rectified, OutputOffset, Preisach, RandomWalk]])
        }
        Kind::Pendulum => any(&[
            &[Coulomb, Stribeck, QuadraticDamping, Cogging, PositionInertia, OutputBacklash, UnmodelledMode, Dahl],
            &[InputOffset, Delay, ActuatorLag, OutputSaturation, DeadZone],
            &time,
            &[SpeedSine, PositionCoulomb],
        ]),
        Kind::Wing => any(&[&[StallLag, OutputOffset], &sensor]),
        Kind::Specimen => any(&[
            &restoring,
            &memory,
            &damping,
            &sensor,
            &[Drift, AbruptChange, Heating, DisplacementSpeed, SpeedSine, ImpactDamping, PositionCoulomb, Fractional],
        ]),
    }
}
