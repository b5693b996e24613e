//! The table of operators.

use super::{Entry, Made, Parameter, Values};
use crate::conformance::{Law, Laws};
use crate::differential::checked_sub_steps;
use crate::error::Check;
use crate::preisach::{Density, Diagonal, Fields, Levels, PreisachPlane, Start};
use crate::*;

/// Every operator, in alphabetical order.
pub fn all() -> &'static [Entry] {
    ENTRIES
}

/// The operator of this name.
pub fn find(name: &str) -> Option<&'static Entry> {
    ENTRIES.iter().find(|entry| entry.name == name)
}

/// A differential law made into an operator.
fn sampled<const N: usize, L: Differential<N> + 'static>(law: L, values: &Values, period_s: f64) -> Made {
    let sub_steps = checked_sub_steps(values.count("sub_steps"))?;
    Ok(Box::new(Sampled::new(law, period_s, sub_steps)?))
}

const SUB_STEPS: Parameter = Parameter::count("sub_steps", 2, "RK4 steps from one sample to the next, at least");
const CHORD: Parameter = Parameter::number("chord_m", 0.4269, "chord, m");
const SPEED: Parameter = Parameter::number("speed_m_s", 25.0, "speed of the flow, m/s");

/// The laws of a play-like operator on [-1, 1].
fn all_memory_laws() -> Laws {
    use Law::{Congruent, LagWork, Monotone, RateIndependent, WipingOut};
    Laws::on(-1.0, 1.0).claim([RateIndependent, WipingOut, Congruent, Monotone, LagWork])
}

/// The laws of a stop-like operator on [-1, 1].
fn spring_laws() -> Laws {
    use Law::{Congruent, Monotone, Odd, RateIndependent, WipingOut, Work};
    Laws::on(-1.0, 1.0).claim([RateIndependent, WipingOut, Congruent, Monotone, Odd, Work])
}

fn bouc_wen_loop(v: &Values) -> BoucWenParameters {
    BoucWenParameters {
        a: v.number("a"),
        beta: v.number("beta"),
        gamma: v.number("gamma"),
        n: v.number("n"),
        direct: v.number("direct"),
        hysteretic: v.number("hysteretic"),
    }
}

fn preisach(v: &Values) -> Made {
    let fields = Fields {
        coercive: v.number("coercive"),
        coercive_width: v.number("coercive_width"),
        interaction: v.number("interaction"),
        interaction_width: v.number("interaction_width"),
    };
    let plane = PreisachPlane {
        lower: v.number("lower"),
        upper: v.number("upper"),
        cells: v.count("cells"),
        density: match v.choice("density") {
            "gaussian" => Density::Gaussian(fields),
            "lorentzian" => Density::Lorentzian(fields),
            _ => Density::Uniform,
        },
        diagonal: if v.choice("diagonal") == "excluded" { Diagonal::Excluded } else { Diagonal::Included },
        levels: if v.choice("levels") == "zero-one" { Levels::ZeroOne } else { Levels::MinusPlus },
        start: match v.choice("start") {
            "all-on" => Start::AllOn,
            "demagnetised" => Start::Demagnetised,
            _ => Start::AllOff,
        },
        saturation: Some(v.number("saturation")),
    };
    Ok(match v.choice("form") {
        "grid" => Box::new(plane.grid()?),
        "smooth" => Box::new(plane.smooth()?),
        _ => Box::new(plane.staircase()?),
    })
}

/// More plays or springs than this are a mistyped number.
const MOST_ELEMENTS: usize = 10_000;

fn few_enough(operator: &'static str, name: &str, count: usize) -> Result<(), ParameterError> {
    Check(operator).require(name, count as f64, count <= MOST_ELEMENTS, &format!("{MOST_ELEMENTS} or less"))
}

fn prandtl_ishlinskii(v: &Values) -> Made {
    few_enough("prandtl-ishlinskii", "plays", v.count("plays"))?;
    let (count, widest, decay) = (v.count("plays"), v.number("widest"), v.number("decay"));
    let share = |i: usize| (-decay * i as f64 / count as f64).exp();
    let sum: f64 = (1..=count).map(share).sum();
    let plays = (1..=count)
        .map(|i| WeightedPlay { r: widest * i as f64 / count as f64, weight: v.number("weight") * share(i) / sum });
    Ok(Box::new(PrandtlIshlinskii::new(v.number("gain"), plays.collect())?))
}

fn maxwell_slip(v: &Values) -> Made {
    let count = v.count("elements");
    few_enough("maxwell-slip", "elements", count)?;
    let stiffness = v.number("stiffness") / count as f64;
    let elements: Vec<SlipElement> = (1..=count)
        .map(|i| SlipElement { stiffness, limit: stiffness * v.number("slip") * i as f64 / count as f64 })
        .collect();
    Ok(Box::new(MaxwellSlip::new(&elements)?))
}

const ENTRIES: &[Entry] = &[
    Entry {
        name: "baber-noori",
        summary: "Bouc-Wen spring that degrades and pinches with the energy it dissipates",
        parameters: &[
            Parameter::number("a", 1.0, "slope dz/du at z = 0"),
            Parameter::number("beta", 0.5, "weight of |u'| |z|^(n-1) z, above |gamma|"),
            Parameter::number("gamma", 0.3, "weight of u' |z|^n"),
            Parameter::number("n", 1.0, "sharpness of the knee, 1 or more"),
            Parameter::number("direct", 0.1, "weight of u in the output (alpha k)"),
            Parameter::number("hysteretic", 0.9, "weight of z in the output ((1 - alpha) k)"),
            Parameter::number("delta_a", 0.0, "loss of slope per unit of dissipated energy"),
            Parameter::number("delta_nu", 0.02, "loss of strength per unit of dissipated energy"),
            Parameter::number("delta_eta", 0.02, "loss of stiffness per unit of dissipated energy"),
            Parameter::number("severity", 0.7, "pinching when fully grown, 0 to below 1"),
            Parameter::number("growth", 0.5, "growth of the pinching per unit of dissipated energy"),
            Parameter::number("position", 0.1, "where the loop is pinched, as a share of the limit of z"),
            Parameter::number("width", 0.3, "width of the pinched region"),
            Parameter::number("delta_width", 0.0, "growth of the width per unit of dissipated energy"),
            Parameter::number("lambda", 0.5, "share of the width that does not depend on the severity, above 0"),
            SUB_STEPS,
        ],
        laws: || Laws::on(-2.0, 2.0).within(1e-5).claim([Law::RateIndependent, Law::Odd, Law::Work]),
        make: |v, period_s| {
            let degradation = Degradation {
                delta_a: v.number("delta_a"),
                delta_nu: v.number("delta_nu"),
                delta_eta: v.number("delta_eta"),
            };
            let pinching = Pinching {
                severity: v.number("severity"),
                growth: v.number("growth"),
                position: v.number("position"),
                width: v.number("width"),
                delta_width: v.number("delta_width"),
                lambda: v.number("lambda"),
            };
            sampled(BaberNoori::new(bouc_wen_loop(v), degradation, pinching)?, v, period_s)
        },
    },
    Entry {
        name: "bouc-wen",
        summary: "h' = a u' - beta |u'| |h|^(n-1) h - gamma u' |h|^n, y = direct u + hysteretic h",
        parameters: &[
            Parameter::number("a", 1.0, "slope dh/du at h = 0"),
            Parameter::number("beta", 0.5, "weight of |u'| |h|^(n-1) h, at least |gamma|"),
            Parameter::number("gamma", 0.3, "weight of u' |h|^n"),
            Parameter::number("n", 1.0, "sharpness of the knee, 1 or more"),
            Parameter::number("direct", 1.6, "weight of u in the output"),
            Parameter::number("hysteretic", -1.0, "weight of h in the output; -1 for a piezo actuator"),
            SUB_STEPS,
        ],
        laws: || {
            use Law::{LagWork, Monotone, Odd, RateIndependent};
            Laws::on(-2.0, 2.0).within(1e-5).claim([RateIndependent, Monotone, Odd, LagWork])
        },
        make: |v, period_s| sampled(BoucWen::new(bouc_wen_loop(v))?, v, period_s),
    },
    Entry {
        name: "dahl",
        summary: "friction force that bends over to the Coulomb level; input a displacement",
        parameters: &[
            Parameter::number("sigma", 10.0, "stiffness at rest, force over displacement"),
            Parameter::number("f_c", 1.0, "Coulomb force"),
            Parameter::number("shape", 1.0, "exponent, 1 or more"),
            SUB_STEPS,
        ],
        laws: || {
            use Law::{Bounded, Monotone, Odd, RateIndependent, Work};
            let bounded = Bounded { lowest: -1.0, highest: 1.0 };
            Laws::on(-1.0, 1.0).within(1e-5).claim([RateIndependent, Monotone, Odd, Work, bounded])
        },
        make: |v, period_s| sampled(Dahl::new(v.number("sigma"), v.number("f_c"), v.number("shape"))?, v, period_s),
    },
    Entry {
        name: "duhem",
        summary: "Coleman-Hodgdon: y' = alpha |u'| (f(u) - y) + g u', f = slope u + rise tanh(u/width)",
        parameters: &[
            Parameter::number("alpha", 2.0, "decay to the curve f, per unit of the input"),
            Parameter::number("slope", 1.0, "slope of f far from 0"),
            Parameter::number("rise", 0.5, "height of the step of f about 0"),
            Parameter::number("width", 0.3, "width of that step"),
            Parameter::number("g", 0.4, "slope of the output where it is on f, at most slope"),
            SUB_STEPS,
        ],
        laws: || Laws::on(-2.0, 2.0).within(1e-5).claim([Law::RateIndependent, Law::Odd, Law::LagWork]),
        make: |v, period_s| {
            let parameters = DuhemParameters {
                alpha: v.number("alpha"),
                slope: v.number("slope"),
                rise: v.number("rise"),
                width: v.number("width"),
                g: v.number("g"),
            };
            sampled(Duhem::new(parameters)?, v, period_s)
        },
    },
    Entry {
        name: "goman-khrabrov",
        summary: "normal force of a pitching wing whose separation lags; input an angle in rad",
        parameters: &[
            CHORD,
            SPEED,
            Parameter::number("alpha_star", 0.44, "angle at which half of the flow is separated at rest, rad"),
            Parameter::number("steepness", 15.0, "steepness of the separation, 1/rad"),
            Parameter::number("tau1_s", 0.05, "relaxation time, s"),
            Parameter::number("tau2_s", 0.05, "delay of the separation, s"),
            Parameter::number("c_attached", 3.0, "attached normal force over sin(alpha)"),
            Parameter::number("c_separated", 1.3, "separated normal force over sin(alpha)"),
            Parameter::number("c_nq", 3.0, "pitch damping, 1/rad"),
            SUB_STEPS,
        ],
        laws: || Laws::on(0.0, 1.0),
        make: |v, period_s| {
            let parameters = GomanKhrabrovParameters {
                wing: Wing { chord_m: v.number("chord_m"), speed_m_s: v.number("speed_m_s") },
                alpha_star: v.number("alpha_star"),
                steepness: v.number("steepness"),
                tau1_s: v.number("tau1_s"),
                tau2_s: v.number("tau2_s"),
                c_attached: v.number("c_attached"),
                c_separated: v.number("c_separated"),
                c_nq: v.number("c_nq"),
            };
            sampled(GomanKhrabrov::new(parameters)?, v, period_s)
        },
    },
    Entry {
        name: "jiles-atherton",
        summary: "magnetisation (A/m) by pinned domain walls; input a magnetic field in A/m",
        parameters: &[
            Parameter::number("m_s", 1.6e6, "saturation magnetisation, A/m"),
            Parameter::number("a", 1100.0, "shape of the anhysteretic curve, A/m"),
            Parameter::number("alpha", 1.6e-3, "coupling between domains"),
            Parameter::number("k", 400.0, "pinning, about the coercive field, A/m"),
            Parameter::number("c", 0.2, "reversible share, 0 to below 1"),
            SUB_STEPS,
        ],
        laws: || {
            use Law::{Bounded, LagWork, Monotone, Odd, RateIndependent};
            let bounded = Bounded { lowest: -1.6e6, highest: 1.6e6 };
            Laws::on(-5000.0, 5000.0).within(1e-4).claim([RateIndependent, Monotone, Odd, LagWork, bounded])
        },
        make: |v, period_s| {
            let parameters = JilesAthertonParameters {
                m_s: v.number("m_s"),
                a: v.number("a"),
                alpha: v.number("alpha"),
                k: v.number("k"),
                c: v.number("c"),
            };
            sampled(JilesAtherton::new(parameters)?, v, period_s)
        },
    },
    Entry {
        name: "lugre",
        summary: "friction force of bristles that bend and slip; input a displacement",
        parameters: &[
            Parameter::number("sigma0", 100.0, "stiffness of the bristles"),
            Parameter::number("sigma1", 0.2, "damping of the bristles"),
            Parameter::number("sigma2", 0.05, "viscous friction"),
            Parameter::number("f_c", 1.0, "Coulomb force"),
            Parameter::number("f_s", 1.5, "static force, at least f_c"),
            Parameter::number("v_s", 0.1, "Stribeck velocity"),
            SUB_STEPS,
        ],
        laws: || Laws::on(-1.0, 1.0).within(1e-5).claim([Law::Odd, Law::Work]),
        make: |v, period_s| {
            let parameters = LuGreParameters {
                sigma0: v.number("sigma0"),
                sigma1: v.number("sigma1"),
                sigma2: v.number("sigma2"),
                f_c: v.number("f_c"),
                f_s: v.number("f_s"),
                v_s: v.number("v_s"),
            };
            sampled(LuGre::new(parameters)?, v, period_s)
        },
    },
    Entry {
        name: "maxwell-slip",
        summary: "springs in parallel that slip one after the other; input a displacement",
        parameters: &[
            Parameter::count("elements", 8, "number of springs, of equal stiffness"),
            Parameter::number("stiffness", 4.0, "stiffness of all together, force over displacement"),
            Parameter::number(
                "slip",
                0.8,
                "displacement at which the last spring slips; the others at equal parts of it",
            ),
        ],
        laws: spring_laws,
        make: |v, _| maxwell_slip(v),
    },
    Entry {
        name: "play",
        summary: "backlash: the output follows at a distance of at most r",
        parameters: &[
            Parameter::number("r", 0.3, "half-width, in the unit of the input"),
            Parameter::number("start", 0.0, "output before the first sample"),
        ],
        laws: || all_memory_laws().claim([Law::Odd]),
        make: |v, _| Ok(Box::new(Play::starting_at(v.number("r"), v.number("start"))?)),
    },
    Entry {
        name: "prandtl-ishlinskii",
        summary: "a gain and a weighted sum of plays",
        parameters: &[
            Parameter::number("gain", 0.5, "weight of the input itself"),
            Parameter::count("plays", 8, "number of plays, of half-widths in equal steps"),
            Parameter::number("widest", 0.8, "half-width of the widest play"),
            Parameter::number("weight", 1.0, "sum of the weights of the plays"),
            Parameter::number("decay", 1.0, "the weights fall by exp(-decay) from narrow to wide"),
        ],
        laws: || all_memory_laws().claim([Law::Odd]),
        make: |v, _| prandtl_ishlinskii(v),
    },
    Entry {
        name: "preisach",
        summary: "weighted relays over the half-plane alpha >= beta",
        parameters: &[
            Parameter::choice("form", &["staircase", "grid", "smooth"], "fast; relay by relay; density without steps"),
            Parameter::choice("density", &["uniform", "gaussian", "lorentzian"], "how the weight is spread"),
            Parameter::count("cells", 100, "cells along each side of the plane"),
            Parameter::number("lower", -1.0, "input at which all relays are down"),
            Parameter::number("upper", 1.0, "input at which all relays are up"),
            Parameter::choice("diagonal", &["included", "excluded"], "whether relays without memory belong to it"),
            Parameter::choice("levels", &["minus-plus", "zero-one"], "the two outputs of a relay"),
            Parameter::choice("start", &["all-off", "all-on", "demagnetised"], "what is remembered at first"),
            Parameter::number("saturation", 1.0, "output with all relays up"),
            Parameter::number("coercive", 0.3, "commonest (alpha - beta)/2").with("density", "gaussian"),
            Parameter::number("coercive_width", 0.2, "its spread").with("density", "gaussian"),
            Parameter::number("interaction", 0.0, "commonest (alpha + beta)/2").with("density", "lorentzian"),
            Parameter::number("interaction_width", 0.2, "its spread").with("density", "lorentzian"),
        ],
        laws: || all_memory_laws().claim([Law::Bounded { lowest: -1.0, highest: 1.0 }]),
        make: |v, _| preisach(v),
    },
    Entry {
        name: "reduced-frequency",
        summary: "normal force of a pitching wing, linear, with a lag; input an angle in rad",
        parameters: &[
            CHORD,
            SPEED,
            Parameter::number("alpha0", 0.5, "angle about which it is linear, rad"),
            Parameter::number("c_n0", 1.0, "normal force there"),
            Parameter::number("c_a_inf", 2.0, "angle derivative at high frequency, 1/rad"),
            Parameter::number("c_q_inf", 3.0, "pitch rate derivative at high frequency, 1/rad"),
            Parameter::number("lagging", 1.0, "part of the angle derivative that lags, 1/rad"),
            Parameter::number("tau_s", 0.05, "time constant of the lag, s"),
            SUB_STEPS,
        ],
        laws: || Laws::on(0.0, 1.0),
        make: |v, period_s| {
            let parameters = ReducedFrequencyParameters {
                wing: Wing { chord_m: v.number("chord_m"), speed_m_s: v.number("speed_m_s") },
                alpha0: v.number("alpha0"),
                c_n0: v.number("c_n0"),
                c_a_inf: v.number("c_a_inf"),
                c_q_inf: v.number("c_q_inf"),
                lagging: v.number("lagging"),
                tau_s: v.number("tau_s"),
            };
            sampled(ReducedFrequency::new(parameters)?, v, period_s)
        },
    },
    Entry {
        name: "relay",
        summary: "-1 or 1, with one threshold for going up and a lower one for coming down",
        parameters: &[
            Parameter::number("lower", -0.4, "comes down at and below this input"),
            Parameter::number("upper", 0.4, "goes up at and above this input"),
            Parameter::choice("start", &["down", "up"], "state before the first sample"),
        ],
        laws: || all_memory_laws().claim([Law::Bounded { lowest: -1.0, highest: 1.0 }]),
        make: |v, _| {
            let start = if v.choice("start") == "up" { RelayState::Up } else { RelayState::Down };
            Ok(Box::new(Relay::new(v.number("lower"), v.number("upper"), start)?))
        },
    },
    Entry {
        name: "stop",
        summary: "elastic, ideally plastic: follows the input's changes between -r and r",
        parameters: &[Parameter::number("r", 0.3, "where it yields, in the unit of the input")],
        laws: spring_laws,
        make: |v, _| Ok(Box::new(Stop::new(v.number("r"))?)),
    },
];
