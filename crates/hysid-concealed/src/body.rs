//! The plants without effects: their parameters, their equations as the simulation file states them, and their bodies.

use serde::Serialize;

/// The kinds of plant in the bank.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, PartialOrd, Ord, Hash)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Mass, damper, spring; force to displacement.
    Oscillator,
    /// Servo drive with viscous and dry friction; torque to position, open loop.
    Drive,
    /// The same in a position loop.
    ClosedDrive,
    /// Two masses, force on the first.
    TwoMasses,
    /// Three masses, force on the first.
    ThreeMasses,
    /// Piezo actuator: gain and one mode far above the band of use.
    Piezo,
    /// Piezo actuator: gain and a first-order amplifier.
    PiezoSlow,
    /// Tank with inflow and a linear outlet.
    Tank,
    /// Heated body.
    Thermal,
    /// First-order circuit.
    Circuit,
    /// Driven pendulum, gravity in the baseline.
    Pendulum,
    /// Wing section in prescribed pitch: angle to normal force coefficient.
    Wing,
    /// Specimen under prescribed displacement: displacement and velocity to force.
    Specimen,
}

impl Kind {
    /// Every kind.
    pub const ALL: &'static [Kind] = &[
        Kind::Oscillator,
        Kind::Drive,
        Kind::ClosedDrive,
        Kind::TwoMasses,
        Kind::ThreeMasses,
        Kind::Piezo,
        Kind::PiezoSlow,
        Kind::Tank,
        Kind::Thermal,
        Kind::Circuit,
        Kind::Pendulum,
        Kind::Wing,
        Kind::Specimen,
    ];

    /// Names of the free parameters, in the order of `theta`.
    pub fn parameters(self) -> &'static [&'static str] {
        match self {
            Kind::Oscillator => &["m", "c", "k"],
            Kind::Drive | Kind::ClosedDrive => &["J", "b", "F_c"],
            Kind::TwoMasses => &["m1", "c1", "k1", "m2", "c2", "k2"],
            Kind::ThreeMasses => &["m1", "c1", "k1", "m2", "c2", "k2", "m3", "c3", "k3"],
            Kind::Piezo => &["d", "w", "z"],
            Kind::PiezoSlow => &["d", "tau"],
            Kind::Tank => &["A", "c_o"],
            Kind::Thermal => &["C", "R"],
            Kind::Circuit => &["g", "tau"],
            Kind::Pendulum => &["J", "b", "G"],
            Kind::Wing => &["cna", "a_0", "a_s", "s"],
            Kind::Specimen => &["c", "k", "F0"],
        }
    }

    /// Units of the free parameters.
    pub fn units(self) -> &'static [&'static str] {
        match self {
            Kind::Oscillator => &["kg", "N s/m", "N/m"],
            Kind::Drive | Kind::ClosedDrive => &["kg m^2", "N m s", "N m"],
            Kind::TwoMasses => &["kg", "N s/m", "N/m", "kg", "N s/m", "N/m"],
            Kind::ThreeMasses => &["kg", "N s/m", "N/m", "kg", "N s/m", "N/m", "kg", "N s/m", "N/m"],
            Kind::Piezo => &["um/V", "rad/s", "-"],
            Kind::PiezoSlow => &["um/V", "s"],
            Kind::Tank => &["m^2", "m^2/s"],
            Kind::Thermal => &["J/K", "K/W"],
            Kind::Circuit => &["-", "s"],
            Kind::Pendulum => &["kg m^2", "N m s", "N m"],
            Kind::Wing => &["1/rad", "deg", "deg", "1/deg"],
            Kind::Specimen => &["N s/m", "N/m", "N"],
        }
    }

    /// Whether a parameter may be negative.
    pub fn signed(self, parameter: &str) -> bool {
        matches!((self, parameter), (Kind::Specimen, "F0") | (Kind::Wing, "a_0"))
    }

    /// Number of masses that move freely.
    pub fn masses(self) -> usize {
        match self {
            Kind::TwoMasses => 2,
            Kind::ThreeMasses => 3,
            Kind::Wing | Kind::Specimen | Kind::Tank | Kind::Thermal | Kind::Circuit | Kind::PiezoSlow => 0,
            _ => 1,
        }
    }

    /// Whether the plant stores one quantity (a first-order plant).
    pub fn stores(self) -> bool {
        matches!(self, Kind::Tank | Kind::Thermal | Kind::Circuit | Kind::PiezoSlow)
    }

    /// Whether the motion is imposed and the force is recorded.
    pub fn prescribed(self) -> bool {
        matches!(self, Kind::Wing | Kind::Specimen)
    }

    /// The slot of a term in the equation of motion of mass `dof`.
    pub fn plant_slot(self, dof: usize) -> String {
        match self {
            Kind::TwoMasses | Kind::ThreeMasses => format!("state:v{}", dof + 1),
            Kind::Drive | Kind::ClosedDrive | Kind::Pendulum => "state:w".into(),
            Kind::Tank => "state:h".into(),
            Kind::Thermal => "state:T".into(),
            Kind::Circuit | Kind::PiezoSlow => "state:x".into(),
            Kind::Wing | Kind::Specimen => format!("output:{}", self.outputs()[0]),
            _ => "state:v".into(),
        }
    }

    /// The symbol of the command in the equations.
    pub fn input_symbol(self) -> &'static str {
        match self {
            Kind::Wing => "alpha",
            Kind::Specimen => "x",
            _ => "u",
        }
    }

    /// Columns of the inputs: symbol in the equations and column.
    pub fn inputs(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Kind::Oscillator | Kind::TwoMasses | Kind::ThreeMasses => &[("u", "force_N")],
            Kind::Drive | Kind::ClosedDrive | Kind::Pendulum => &[("u", "torque_Nm")],
            Kind::Piezo | Kind::PiezoSlow | Kind::Circuit => &[("u", "u_V")],
            Kind::Tank => &[("u", "inflow_m3_s")],
            Kind::Thermal => &[("u", "power_W")],
            Kind::Wing => &[("alpha", "alpha_deg")],
            Kind::Specimen => &[("x", "x_m"), ("v", "v_m_s")],
        }
    }

    /// Columns of the outputs, as many as may be recorded.
    pub fn outputs(self) -> &'static [&'static str] {
        match self {
            Kind::Oscillator => &["x_m"],
            Kind::Drive | Kind::ClosedDrive | Kind::Pendulum => &["angle_rad"],
            Kind::TwoMasses => &["x1_m", "x2_m"],
            Kind::ThreeMasses => &["x1_m", "x3_m"],
            Kind::Piezo | Kind::PiezoSlow => &["y_um"],
            Kind::Tank => &["level_m"],
            Kind::Thermal => &["rise_K"],
            Kind::Circuit => &["y_V"],
            Kind::Wing => &["CN"],
            Kind::Specimen => &["force_N"],
        }
    }

    /// Lines of `[states]` as (symbol, derivative), friction written as `friction`.
    pub fn states(self, friction: &str) -> Vec<(String, String)> {
        let own = |list: &[(&str, &str)]| list.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
        match self {
            Kind::Oscillator => own(&[("x", "v"), ("v", "(u - c*v - k*x)/m")]),
            Kind::Drive | Kind::ClosedDrive => {
                vec![("q".into(), "w".into()), ("w".into(), format!("(u - b*w - F_c*{friction})/J"))]
            }
            Kind::Pendulum => own(&[("q", "w"), ("w", "(u - b*w - G*sin(q))/J")]),
            Kind::TwoMasses => own(&[
                ("x1", "v1"),
                ("v1", "(u - c1*v1 - k1*x1 - c2*(v1 - v2) - k2*(x1 - x2))/m1"),
                ("x2", "v2"),
                ("v2", "(c2*(v1 - v2) + k2*(x1 - x2))/m2"),
            ]),
            Kind::ThreeMasses => own(&[
                ("x1", "v1"),
                ("v1", "(u - c1*v1 - k1*x1 - c2*(v1 - v2) - k2*(x1 - x2))/m1"),
                ("x2", "v2"),
                ("v2", "(c2*(v1 - v2) + k2*(x1 - x2) - c3*(v2 - v3) - k3*(x2 - x3))/m2"),
                ("x3", "v3"),
                ("v3", "(c3*(v2 - v3) + k3*(x2 - x3))/m3"),
            ]),
            Kind::Piezo => own(&[("x", "v"), ("v", "w^2*(d*u - x) - 2*z*w*v")]),
            Kind::PiezoSlow => own(&[("x", "(d*u - x)/tau")]),
            Kind::Tank => own(&[("h", "(u - c_o*h)/A")]),
            Kind::Thermal => own(&[("T", "(u - T/R)/C")]),
            Kind::Circuit => own(&[("x", "(g*u - x)/tau")]),
            Kind::Wing | Kind::Specimen => Vec::new(),
        }
    }

    /// Expressions of the outputs, in the order of [`Kind::outputs`].
    pub fn output_expressions(self) -> &'static [&'static str] {
        match self {
            Kind::Oscillator | Kind::Piezo | Kind::PiezoSlow | Kind::Circuit => &["x"],
            Kind::Drive | Kind::ClosedDrive | Kind::Pendulum => &["q"],
            Kind::TwoMasses => &["x1", "x2"],
            Kind::ThreeMasses => &["x1", "x3"],
            Kind::Tank => &["h"],
            Kind::Thermal => &["T"],
            Kind::Wing => &["cna*sin((alpha - a_0)*pi/180)*(1 + sqrt(1/(1 + exp(s*(alpha - a_s)))))^2/4"],
            Kind::Specimen => &["c*v + k*x + F0"],
        }
    }

    /// Which mass each recorded output reads.
    pub fn output_mass(self, channel: usize) -> usize {
        match (self, channel) {
            (Kind::TwoMasses, 1) => 1,
            (Kind::ThreeMasses, 1) => 2,
            _ => 0,
        }
    }
}

/// Masses in a chain, the first driven and tied to the ground.
#[derive(Debug, Clone, Copy, Default)]
pub struct Chain {
    /// Number of masses.
    pub n: usize,
    /// Masses.
    pub m: [f64; 3],
    /// Damper and spring before each mass (to the ground for the first).
    pub c: [f64; 3],
    /// Springs, as `c`.
    pub k: [f64; 3],
    /// Dry friction on the first mass.
    pub friction: f64,
    /// Gravity torque.
    pub gravity: f64,
    /// Force per unit of the command.
    pub gain: f64,
}

/// One store: `capacity x' = gain u - x loss`.
#[derive(Debug, Clone, Copy)]
pub struct Store {
    /// Capacity.
    pub capacity: f64,
    /// Gain of the command.
    pub gain: f64,
    /// Loss per unit of content.
    pub loss: f64,
}

/// A plant with numbers in it.
#[derive(Debug, Clone, Copy)]
pub enum Body {
    /// Masses that move freely.
    Chain(Chain),
    /// One store.
    Store(Store),
    /// A wing section: slope, zero-lift angle, stall angle, abruptness.
    Wing([f64; 4]),
    /// A specimen: damping, stiffness, constant force.
    Specimen([f64; 3]),
}

/// The body of a kind of plant with parameters `theta`.
pub fn body(kind: Kind, theta: &[f64]) -> Body {
    let chain = |n| Chain { n, gain: 1.0, ..Chain::default() };
    let fill = |n: usize| {
        let mut out = chain(n);
        for i in 0..n {
            (out.m[i], out.c[i], out.k[i]) = (theta[3 * i], theta[3 * i + 1], theta[3 * i + 2]);
        }
        Body::Chain(out)
    };
    match kind {
        Kind::Oscillator => fill(1),
        Kind::TwoMasses => fill(2),
        Kind::ThreeMasses => fill(3),
        Kind::Drive | Kind::ClosedDrive => {
            let mut out = chain(1);
            (out.m[0], out.c[0], out.friction) = (theta[0], theta[1], theta[2]);
            Body::Chain(out)
        }
        Kind::Pendulum => {
            let mut out = chain(1);
            (out.m[0], out.c[0], out.gravity) = (theta[0], theta[1], theta[2]);
            Body::Chain(out)
        }
        Kind::Piezo => {
            let (d, w, z) = (theta[0], theta[1], theta[2]);
            let mut out = chain(1);
            (out.m[0], out.c[0], out.k[0], out.gain) = (1.0, 2.0 * z * w, w * w, w * w * d);
            Body::Chain(out)
        }
        Kind::PiezoSlow | Kind::Circuit => Body::Store(Store { capacity: theta[1], gain: theta[0], loss: 1.0 }),
        Kind::Tank => Body::Store(Store { capacity: theta[0], gain: 1.0, loss: theta[1] }),
        Kind::Thermal => Body::Store(Store { capacity: theta[0], gain: 1.0, loss: 1.0 / theta[1] }),
        Kind::Wing => Body::Wing([theta[0], theta[1], theta[2], theta[3]]),
        Kind::Specimen => Body::Specimen([theta[0], theta[1], theta[2]]),
    }
}
