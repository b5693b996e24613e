//! One case: what is concealed where, the recordings, and the label.

mod label;
mod needed;
mod noisy;
mod simulation;

pub use label::{Concealed, Group, Label};
pub use simulation::simulation;

use self::label::concealed;
use self::needed::{all_needed, simpler};
use self::noisy::{add_noise, record};
use crate::body::Kind;
use crate::design::{Design, Source, suits};
use crate::excite::Excitation;
use crate::input::Input;
use crate::law::{Effect, Law, Place};
use crate::machine::Machine;
use crate::noise::{Noise, convert};
use crate::seed::Random;
use crate::strength::{Tuned, measure, tune};

/// A recording: input, outputs with noise, outputs without.
#[derive(Debug, Clone)]
pub struct Record {
    /// Input as recorded.
    pub input: Input,
    /// Outputs as recorded.
    pub y: Vec<Vec<f64>>,
    /// Outputs without noise and converter.
    pub clean: Vec<Vec<f64>>,
}

/// A case with everything that the scorer may need.
#[derive(Debug, Clone)]
pub struct Case {
    /// Label.
    pub label: Label,
    /// Design.
    pub design: Design,
    /// True machine.
    pub machine: Machine,
    /// Recording to estimate from.
    pub est: Record,
    /// Hold-out recording.
    pub val: Record,
    /// A recording at 1.5 times the amplitude, never shown.
    pub louder: Option<Record>,
    /// `baseline.sim.toml`.
    pub simulation: String,
    /// It leaves the initial state free; the machine begins at rest.
    pub free_initial: bool,
    /// First time stamp in seconds.
    pub clock: f64,
}

/// What is asked of a case.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// Name of the folder.
    pub id: String,
    /// Sort of case.
    pub group: Group,
    /// Law of the first effect, where the bank plans it.
    pub law: Option<Law>,
    /// Noise of a control.
    pub noise: Option<Noise>,
}

const DRAWS: usize = 60;
/// Shares of the plants among those that suit an effect, in the order of [`Kind::ALL`].
const PLANTS: [f64; 13] = [25.0, 14.0, 9.0, 7.0, 4.0, 6.0, 4.0, 4.0, 3.0, 3.0, 4.0, 3.0, 14.0];
/// Detection needs information: `N DNR^2` of a case is at least this.
pub const LEAST_INFORMATION: f64 = 25.0;

impl Case {
    /// Draws a case of up to `longest` samples; `None` when no draw of this law makes the difficulty asked for.
    pub fn draw(wanted: &Wanted, longest: usize, random: &mut Random) -> Option<Self> {
        (0..DRAWS).find_map(|rejected| Self::attempt(wanted, longest, &mut random.fork(), rejected))
    }

    fn attempt(wanted: &Wanted, longest: usize, random: &mut Random, rejected: usize) -> Option<Self> {
        let control = wanted.group == Group::Control;
        let law = wanted.law.unwrap_or(Law::Coulomb);
        let weights: Vec<f64> =
            Kind::ALL.iter().zip(PLANTS).map(|(k, w)| if control || suits(*k, law) { w } else { 0.0 }).collect();
        let kind = Kind::ALL[random.weighted(&weights)];
        let dnr = match wanted.group {
            Group::Control => 0.0,
            _ if law == Law::Quantisation => random.pick(&[1.0, 3.0]),
            Group::Single => random.pick(&[0.1, 0.2, 0.5, 1.0, 3.0]),
            Group::Pair | Group::Triple => random.pick(&[0.5, 1.0, 3.0]),
            Group::Outside => random.pick(&[0.2, 0.5, 1.0, 3.0]),
        };
        let samples = samples(dnr, longest, random)?;
        let design = Design::draw(kind, samples, random);
        let noise_kind = wanted.noise.unwrap_or_else(|| {
            [Noise::White, Noise::Autoregressive, Noise::Process, Noise::Outliers]
                [random.weighted(&[70.0, 18.0, 8.0, 4.0])]
        });
        let noise_level =
            if design.gains.is_some() { random.pick(&[0.005, 0.01]) } else { random.pick(&[0.005, 0.01, 0.02, 0.05]) };
        let source = design.source(random, design.excitation, samples);
        let mut laws = if control { Vec::new() } else { vec![law] };
        let more = match wanted.group {
            Group::Pair => 1,
            Group::Triple => 2,
            _ => 0,
        };
        for _ in 0..more {
            laws.push(companion(kind, &laws, random)?);
        }
        let units: Vec<Effect> = laws.iter().map(|l| design.effect(*l, &source, random)).collect::<Option<_>>()?;
        let seen = noise_kind.samples(random, samples);
        let tuned = if control {
            measure(&design, &source, &[], &[], noise_level, &seen, 0)?
        } else {
            tune(&design, &source, &units, dnr, noise_level, &seen)?
        };
        if machine_is_silenced(&tuned) || !all_needed(&design, &tuned) {
            return None;
        }
        let bits = 12 + random.below(5) as u32;
        let headroom = random.uniform(1.1, 2.0);
        let machine = tuned.machine.clone();
        let looped = matches!(source, Source::Reference(_));
        let mut est = Record { input: tuned.input.clone(), y: tuned.y.clone(), clean: tuned.y.clone() };
        add_noise(&mut est, &machine, noise_kind, &tuned.sigma, looped.then_some(&seen), random)?;
        let clocked = machine.effects.iter().any(|e| matches!(e.law.place(), Place::Parameter | Place::Disturbance));
        let length = if clocked { samples } else { samples.min(4000) };
        let excitation = if random.chance(0.5) { design.excitation } else { Excitation::SteppedMultisine };
        let fresh = design.source(random, excitation, length);
        let val_noise = noise_kind.samples(random, length);
        let mut val = record(&design, &machine, &fresh, &val_noise, &tuned)?;
        add_noise(&mut val, &machine, noise_kind, &tuned.sigma, looped.then_some(&val_noise), random)?;
        let turns_over = |r: &Record| r.clean[0].iter().any(|v| v.abs() > 2.6);
        if kind == Kind::Pendulum && (turns_over(&est) || turns_over(&val)) {
            // Past the top the motion is chaotic and no free run means anything.
            return None;
        }
        let mut louder = record(&design, &machine, &fresh.louder(1.5), &val_noise, &tuned);
        for (column, s) in louder.iter_mut().flat_map(|l| &mut l.y).zip(&tuned.sigma) {
            column.iter_mut().for_each(|v| *v += s * random.normal());
        }
        for record in [&mut est, &mut val] {
            for (column, clean) in record.y.iter_mut().zip(&tuned.y) {
                let full = clean.iter().fold(0.0_f64, |a, v| a.max(v.abs())) * headroom * 1.3;
                convert(column, bits, full);
            }
        }
        let declared: Vec<f64> = kind
            .parameters()
            .iter()
            .zip(&design.theta)
            .map(|(name, v)| {
                let wrong = if *name == "a_s" { random.uniform(0.1, 0.2) } else { random.uniform(0.1, 0.4) };
                v * (1.0 + random.sign() * wrong)
            })
            .collect();
        let clock = if random.chance(0.3) { 0.5 * design.period } else { 0.0 };
        // The file says `sign`: a smoothed law creeps where the machine sticks, and even at a thousandth of the speed the creep adds up to
        // more than the noise. A smoothed law is a fault of the simulation and an effect of its own.
        let regularised = machine.effects.iter().find(|e| e.law == Law::SolverArtefact).map(|e| e.p[0]);
        let free_initial = random.chance(0.3);
        let simulation = simulation(&design, &declared, regularised, if free_initial { "\"free\"" } else { "0.0" });
        let names = kind.parameters();
        let mut effects: Vec<Concealed> = machine.effects.iter().map(|e| concealed(&design, e)).collect();
        for (i, law) in simpler(&design, &tuned) {
            effects[i].same.push((law.name(), law.family()));
        }
        let label = Label {
            id: wanted.id.clone(),
            group: wanted.group,
            plant: kind,
            excitation: design.excitation,
            hold: design.hold,
            samples,
            period: design.period,
            noise: noise_kind,
            noise_level,
            sigma: tuned.sigma.clone(),
            bits,
            dnr_asked: if law.fixed() { tuned.dnr } else { dnr },
            dnr: if control { 0.0 } else { tuned.dnr },
            effects,
            theta: names.iter().copied().zip(design.theta.iter().copied()).collect(),
            declared: names.iter().copied().zip(declared).collect(),
            rejected,
        };
        Some(Self { label, design, machine, est, val, louder, simulation, free_initial, clock })
    }
}

/// A limit that leaves little of the signal is not a concealed effect but a broken channel.
fn machine_is_silenced(tuned: &Tuned) -> bool {
    let command = match &tuned.input {
        Input::Held { values, .. } => values.as_slice(),
        Input::Motion { .. } => &[],
    };
    tuned.machine.effects.iter().any(|e| {
        let signal = match e.law {
            Law::OutputSaturation => tuned.y[0].as_slice(),
            Law::InputSaturation => command,
            _ => return false,
        };
        let limited = signal.iter().filter(|v| v.abs() >= e.p[0]).count();
        limited > signal.len() / 3
    })
}

/// A length up to `longest` that leaves enough information at this difficulty; `None` where there is none.
fn samples(dnr: f64, longest: usize, random: &mut Random) -> Option<usize> {
    let lengths = [1000, 2000, 4000, 8000, 20_000];
    let weights = [30.0, 30.0, 27.0, 9.0, 4.0];
    let allowed: Vec<f64> = lengths
        .iter()
        .zip(weights)
        .map(|(n, w)| {
            let little = dnr > 0.0 && *n as f64 * dnr * dnr < LEAST_INFORMATION;
            if little || *n > longest { 0.0 } else { w }
        })
        .collect();
    allowed.iter().any(|w| *w > 0.0).then(|| lengths[random.weighted(&allowed)])
}

/// A further effect of another family that suits the plant and does not stand in the way of those already there.
fn companion(kind: Kind, have: &[Law], random: &mut Random) -> Option<Law> {
    let clash = |a: Law, b: Law| {
        let hysteresis = |l: Law| matches!(l.family(), "actuator_hysteresis" | "play");
        let friction = |l: Law| matches!(l.family(), "dry_friction" | "presliding" | "hysteretic_spring");
        // Friction that is unequal in the two directions is dry friction and a constant force, sticking included: one machine, three labels.
        let unequal = |a: Law, b: Law| a.family() == "dry_friction" && b.family() == "bias";
        a.family() == b.family()
            || unequal(a, b)
            || unequal(b, a)
            || (hysteresis(a) && hysteresis(b))
            || (friction(a) && friction(b))
            || (a.place() == Place::Parameter && b.place() == Place::Parameter)
    };
    let list: Vec<Law> = Law::ALL
        .iter()
        .copied()
        .filter(|l| l.sociable() && suits(kind, *l) && !have.iter().any(|h| clash(*h, *l)))
        .collect();
    (!list.is_empty()).then(|| random.pick(&list))
}
