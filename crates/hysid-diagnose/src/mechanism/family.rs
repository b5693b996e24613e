//! The families and blocks of the verdict, with their fixed names.

use std::fmt::{self, Display, Formatter};

macro_rules! named {
    ($(#[$about:meta])* $type:ident { $($(#[$doc:meta])* $variant:ident = $name:literal),* $(,)? }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum $type { $($(#[$doc])* $variant),* }

        impl $type {
            /// Every one of them, in the order of the catalogue.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The name in `diagnosis.json`.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),* }
            }
        }

        impl Display for $type {
            fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

named! {
    /// What mechanisms are told apart by last: members of one family often look alike on a recording.
    Family {
        /// Friction that depends on the sign of the velocity.
        DryFriction = "dry_friction",
        /// Friction with an elastic part before sliding.
        Presliding = "presliding",
        /// Damping that is not proportional to the velocity.
        NonlinearDamping = "nonlinear_damping",
        /// A symmetric spring that stiffens.
        HardeningStiffness = "hardening_stiffness",
        /// A spring with unequal sides.
        AsymmetricStiffness = "asymmetric_stiffness",
        /// Free play inside a spring.
        Clearance = "clearance",
        /// A spring with a hysteresis loop.
        HystereticSpring = "hysteretic_spring",
        /// Backlash.
        Play = "play",
        /// Hysteresis of an actuator.
        ActuatorHysteresis = "actuator_hysteresis",
        /// A curved input characteristic without memory.
        InputNonlinearity = "input_nonlinearity",
        /// A pure phase error of the signal path.
        SignalPathLag = "signal_path_lag",
        /// A parameter that changes.
        TimeVariation = "time_variation",
        /// A resonance that the simulation lacks.
        ExtraMode = "extra_mode",
        /// A constant.
        Bias = "bias",
        /// Weight.
        Gravity = "gravity",
        /// A force that is periodic in the position.
        PositionRipple = "position_ripple",
        /// Inertia that is not constant.
        Inertia = "inertia",
        /// Relaxation and creep.
        LinearMemory = "linear_memory",
        /// A curved or coarse sensor.
        SensorNonlinearity = "sensor_nonlinearity",
        /// A sensor whose zero moves.
        SensorDrift = "sensor_drift",
        /// The electrical side of a drive.
        Electrical = "electrical",
        /// Losses of a store.
        Storage = "storage",
        /// Separation that lags behind the angle.
        AeroMemory = "aero_memory",
        /// A force that follows the clock.
        ExternalDisturbance = "external_disturbance",
        /// The simulation's own numerics.
        Numerics = "numerics",
        /// None of the catalogue.
        Outside = "outside",
    }
}

named! {
    /// The part of a simulation in which an effect stands.
    Block {
        /// Before the plant.
        Input = "input",
        /// Forces of the displacement.
        Restoring = "restoring",
        /// Forces of the velocity.
        Damping = "damping",
        /// Forces with memory.
        Hysteresis = "hysteresis",
        /// Forces of the acceleration.
        Inertia = "inertia",
        /// Behind the plant.
        Output = "output",
        /// A parameter that changes.
        TimeVariation = "time_variation",
        /// From outside.
        Disturbance = "disturbance",
    }
}

/// Log evidence that a set of nothing but drifts and offsets must bring besides: noise that rises towards low frequency does what they do,
/// process noise on a drive above all.
pub(crate) const SLOW: f64 = 8.0;

impl Family {
    /// Whether its members are sums of a few elements that imitate each other: which of them it is turns on how finely each law is
    /// written, and is never said firmly.
    pub fn members_imitate(self) -> bool {
        self == Self::ActuatorHysteresis
    }

    /// Whether a member acts at a place once or not at all: two Stribeck frictions there are some third law, where two lines or two resonances are two.
    pub fn acts_once(self) -> bool {
        matches!(
            self,
            Self::DryFriction | Self::Presliding | Self::NonlinearDamping | Self::Bias | Self::Gravity | Self::Play
        )
    }

    /// Whether something outside the catalogue looks like its members on any one recording, so that it is never said firmly: a fractional
    /// element and a spectrum of relaxation times are a single relaxation within the band that was excited, and a zero that moves is what
    /// noise does that rises towards low frequencies.
    pub fn stands_for_others(self) -> bool {
        matches!(self, Self::LinearMemory | Self::SensorDrift)
    }

    /// Whether its members add poles and zeros to the simulation and nothing else: beside a linear memory, which stands for any spectrum of
    /// relaxations, such a member is one more term of it.
    pub fn extends_a_spectrum(self) -> bool {
        matches!(self, Self::ExtraMode | Self::SignalPathLag | Self::Electrical)
    }

    /// The family one of whose members becomes one of this family's by a single parameter: Dahl's law is Bouc and Wen's with `gamma = 0`, a
    /// back-EMF that the viscous friction absorbs leaves the lag of the winding.
    pub fn twin(self) -> Option<Self> {
        match self {
            Self::Presliding => Some(Self::HystereticSpring),
            Self::HystereticSpring => Some(Self::Presliding),
            Self::SignalPathLag => Some(Self::Electrical),
            Self::Electrical => Some(Self::SignalPathLag),
            _ => None,
        }
    }

    /// Whether an input that controls the damping controls the size of its members too: the yield force of a magnetorheological fluid.
    pub fn follows_control(self) -> bool {
        matches!(self, Self::DryFriction | Self::Presliding | Self::HystereticSpring)
    }

    /// Whether its members are linear or follow the clock, as the machine's own noise: behind a sensor that is blind to the sign that noise turns its sign
    /// with the motion, and no noise model knows it.
    pub fn adds_what_noise_does(self) -> bool {
        self.extends_a_spectrum()
            || self.is_slow_noise()
            || matches!(self, Self::LinearMemory | Self::ExternalDisturbance)
    }

    /// Whether its members remember where they came from: how they begin nobody knows.
    pub fn has_memory(self) -> bool {
        matches!(
            self,
            Self::Presliding
                | Self::HystereticSpring
                | Self::Play
                | Self::ActuatorHysteresis
                | Self::LinearMemory
                | Self::AeroMemory
        )
    }

    /// Whether its members are what noise of low frequency does, a zero that moves or stands elsewhere: no noise model of a recording's own length can tell.
    pub fn is_slow_noise(self) -> bool {
        matches!(self, Self::SensorDrift | Self::Bias)
    }
}
