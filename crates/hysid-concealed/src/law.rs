//! The effects that the bank conceals: names, parameters, and which of them carry the strength.
//!
//! Every [`Law`] of the catalogue bears the field's name for it; a law outside the catalogue bears a name of its own and the
//! family `outside`. The equations stand in `machine.rs`, where they are integrated.
//! Symbols: `q` displacement, `v` velocity, `u` command, `z` an inner state without unit, forces resist the motion.

use serde::Serialize;

/// What an effect acts on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// Between the command and the plant.
    Input,
    /// A term in the derivative of a state.
    Plant,
    /// A parameter that varies.
    Parameter,
    /// Between the plant and the recorded output.
    Output,
    /// A force that depends on the clock alone.
    Disturbance,
}

macro_rules! laws {
    ($($law:ident $name:literal $family:literal $place:ident $states:literal [$($p:literal),*] [$($s:literal),*];)*) => {
        /// One effect.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
        #[allow(missing_docs, reason = "the names are the catalogue's, listed in `name`")]
        pub enum Law { $($law),* }

        impl Law {
            /// Every law, the catalogue's first.
            pub const ALL: &'static [Law] = &[$(Law::$law),*];

            /// The catalogue's name of the mechanism.
            pub fn name(self) -> &'static str { match self { $(Law::$law => $name),* } }

            /// The catalogue's family; `outside` when the catalogue has no such law.
            pub fn family(self) -> &'static str { match self { $(Law::$law => $family),* } }

            /// Where the effect acts.
            pub fn place(self) -> Place { match self { $(Law::$law => Place::$place),* } }

            /// Number of inner states that the law integrates.
            pub fn states(self) -> usize { match self { $(Law::$law => $states),* } }

            /// Names of the parameters, in the order of [`Effect::p`].
            pub fn parameters(self) -> &'static [&'static str] { match self { $(Law::$law => &[$($p),*]),* } }

            /// Which parameters grow with the strength of the effect.
            fn scaled(self) -> &'static [usize] { match self { $(Law::$law => &[$($s),*]),* } }
        }
    };
}

laws! {
    // law, name, family, place, inner states, parameters, indices that scale with the strength
    Coulomb "coulomb_friction" "dry_friction" Plant 0 ["F_c"] [0];
    AsymmetricFriction "asymmetric_friction" "dry_friction" Plant 0 ["F_plus", "F_minus"] [0, 1];
    Stribeck "stribeck_friction" "dry_friction" Plant 0 ["F_c", "F_extra", "v_st"] [0, 1];
    LoadDependent "load_dependent_friction" "dry_friction" Plant 0 ["mu"] [0];
    Dahl "dahl_friction" "presliding" Plant 1 ["F_c", "z_s"] [0];
    LuGre "lugre_friction" "presliding" Plant 1 ["F_c", "F_s", "v_st", "z_s", "sigma_1"] [0, 1, 4];
    Elastoplastic "elastoplastic_friction" "presliding" Plant 1 ["F_c", "z_s", "z_ba"] [0];
    QuadraticDamping "quadratic_damping" "nonlinear_damping" Plant 0 ["c_2"] [0];
    PowerLaw "power_law_damping" "nonlinear_damping" Plant 0 ["c_p", "p"] [0];
    DisplacementDamping "displacement_dependent_damping" "nonlinear_damping" Plant 0 ["c_x"] [0];
    Cubic "cubic_stiffness" "hardening_stiffness" Plant 0 ["k_3"] [0];
    Quintic "quintic_stiffness" "hardening_stiffness" Plant 0 ["k_5"] [0];
    GapStop "gap_stop" "hardening_stiffness" Plant 0 ["k_g", "g"] [0];
    QuadraticStiffness "quadratic_stiffness" "asymmetric_stiffness" Plant 0 ["k_2"] [0];
    Bilinear "bilinear_stiffness" "asymmetric_stiffness" Plant 0 ["k_d", "q_0"] [0];
    SpringClearance "spring_clearance" "clearance" Plant 0 ["g"] [0];
    BoucWen "bouc_wen" "hysteretic_spring" Plant 1 ["F_z", "z_s", "b", "n"] [0];
    AsymmetricBoucWen "asymmetric_bouc_wen" "hysteretic_spring" Plant 1 ["F_z", "z_s", "b", "n", "phi"] [0];
    Pinching "pinching" "hysteretic_spring" Plant 1 ["F_z", "z_s", "b", "n", "zeta_1", "zeta_2", "q_p"] [0];
    Degradation "degradation" "hysteretic_spring" Plant 2 ["F_z", "z_s", "b", "n", "delta"] [0];
    InputBacklash "backlash" "play" Input 0 ["r"] [0];
    OutputBacklash "backlash" "play" Output 1 ["r"] [0];
    PrandtlIshlinskii "prandtl_ishlinskii" "actuator_hysteresis" Input 0
        ["share", "r_1", "r_2", "r_3", "r_4", "r_5", "w_1", "w_2", "w_3", "w_4", "w_5"] [0];
    Preisach "preisach" "actuator_hysteresis" Input 0 ["share", "u_max", "spread"] [0];
    AsymmetricHysteresis "asymmetric_hysteresis" "actuator_hysteresis" Input 0 ["share", "u_max", "spread", "bend"] [0];
    RateDependent "rate_dependent_hysteresis" "actuator_hysteresis" Input 0 ["share", "u_max", "lambda"] [0];
    DeadZone "dead_zone" "input_nonlinearity" Input 0 ["d"] [0];
    InputSaturation "input_saturation" "input_nonlinearity" Input 0 ["limit"] [];
    InputPolynomial "input_polynomial" "input_nonlinearity" Input 0 ["b_2", "b_3"] [0, 1];
    Delay "delay" "signal_path_lag" Input 0 ["tau"] [0];
    ActuatorLag "actuator_lag" "signal_path_lag" Input 1 ["tau"] [0];
    SensorLag "sensor_lag" "signal_path_lag" Output 1 ["tau"] [0];
    Drift "parameter_drift" "time_variation" Parameter 0 ["delta", "T"] [0];
    Heating "dissipation_heating" "time_variation" Parameter 1 ["beta", "tau_h", "P_0"] [0];
    AbruptChange "abrupt_change" "time_variation" Parameter 0 ["delta", "t_0"] [0];
    UnmodelledMode "unmodelled_mode" "extra_mode" Plant 2 ["m_a", "f_a", "zeta"] [0];
    InputOffset "input_offset" "bias" Input 0 ["u_0"] [0];
    OutputOffset "output_offset" "bias" Output 0 ["y_0"] [0];
    Gravity "gravity" "gravity" Plant 0 ["mgl", "phase"] [0];
    Cogging "cogging" "position_ripple" Plant 0 ["A", "period", "phase"] [0];
    PositionInertia "position_dependent_inertia" "inertia" Plant 0 ["m_1"] [0];
    Viscoelastic "viscoelastic" "linear_memory" Plant 1 ["k_m", "tau"] [0];
    LogCreep "log_creep" "linear_memory" Output 3 ["gamma", "tau_1", "tau_2", "tau_3"] [0];
    OutputSaturation "output_saturation" "sensor_nonlinearity" Output 0 ["limit"] [];
    Quantisation "quantisation" "sensor_nonlinearity" Output 0 ["lsb"] [0];
    Rectified "rectified_output" "sensor_nonlinearity" Output 0 [] [];
    SensorDrift "sensor_drift" "sensor_drift" Output 0 ["rate"] [0];
    BackEmf "back_emf" "electrical" Input 1 ["c_e", "tau_e"] [0, 1];
    Leakage "leakage" "storage" Plant 0 ["c_l"] [0];
    Overflow "overflow" "storage" Plant 0 ["c_o", "h_max"] [0];
    StallLag "stall_lag" "aero_memory" Plant 1 ["tau_1", "tau_2"] [0, 1];
    PeriodicDisturbance "periodic_disturbance" "external_disturbance" Disturbance 0 ["A", "f", "phase"] [0];
    SolverArtefact "solver_artefact" "numerics" Plant 0 ["v_s"] [0];
    DisplacementSpeed "x_abs_v" "outside" Plant 0 ["a"] [0];
    SpeedSine "v_sin_q" "outside" Plant 0 ["a", "q_0"] [0];
    ImpactDamping "one_sided_impact_damping" "outside" Plant 0 ["c", "g"] [0];
    PositionCoulomb "position_dependent_coulomb" "outside" Plant 0 ["F", "q_0"] [0];
    Fractional "fractional_damping" "outside" Plant 6 ["a", "tau_1", "order"] [0];
    SquareRootDamping "square_root_damping" "outside" Plant 0 ["a"] [0];
    InputStiffness "input_dependent_stiffness" "outside" Plant 0 ["a"] [0];
    ChatterRelay "chattering_relay" "outside" Plant 0 ["F", "h"] [0];
    RandomWalk "random_walk_parameter" "outside" Parameter 0 ["delta", "seed", "T"] [0];
    Parametric "parametric_excitation" "outside" Parameter 0 ["delta", "f"] [0];
}

impl Law {
    /// Whether the law is dry friction with a hard sign, that sticks.
    pub fn sticks(self) -> bool {
        matches!(
            self,
            Law::Coulomb | Law::AsymmetricFriction | Law::Stribeck | Law::LoadDependent | Law::PositionCoulomb
        )
    }

    /// Whether the law takes the place of the plant's own dry friction.
    pub fn replaces_friction(self) -> bool {
        matches!(self, Law::Dahl | Law::LuGre | Law::Elastoplastic)
    }

    /// Whether the law is all or nothing, so that its difficulty cannot be set.
    pub fn fixed(self) -> bool {
        self == Law::Rectified
    }

    /// Whether the law may stand beside another in a case.
    pub fn sociable(self) -> bool {
        !matches!(self, Law::Quantisation | Law::SolverArtefact | Law::Rectified) && !self.outside()
    }

    /// Whether the catalogue has no such law.
    pub fn outside(self) -> bool {
        self.family() == "outside"
    }
}

/// One effect with its parameters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// The law.
    pub law: Law,
    /// Parameters in SI units (or those of the plant), in the order of [`Law::parameters`].
    pub p: Vec<f64>,
    /// The mass it acts on (0 for the first).
    pub dof: usize,
    /// The plant's parameter that it changes, for effects in [`Place::Parameter`].
    pub theta: usize,
    /// Parameters that carry the strength; the law's own choice unless the plant asks for another.
    pub scaled: Vec<usize>,
}

impl Effect {
    /// An effect of unit strength.
    pub fn new(law: Law, p: Vec<f64>) -> Self {
        debug_assert_eq!(p.len(), law.parameters().len());
        Self { law, p, dof: 0, theta: 0, scaled: law.scaled().to_vec() }
    }

    /// The same effect at `strength` times its unit strength. A limit comes down as the strength grows.
    pub fn at(&self, strength: f64) -> Self {
        let mut out = self.clone();
        for &i in &self.scaled {
            out.p[i] *= strength;
        }
        if matches!(self.law, Law::InputSaturation | Law::OutputSaturation) {
            out.p[0] = self.p[0] / (1.0 + strength);
        }
        out
    }
}
