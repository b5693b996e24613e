//! The catalogue: every mechanism that the diagnosis can name, one file each.
//!
//! **A mechanism is a rewriting of the simulation.** Given a simulation and a [`Slot`], [`Mechanism::rewrite`] returns another
//! simulation in the same language, with amplitudes whose zero is the baseline, shape parameters on a grid, and perhaps new
//! states or operators with memory. Features, refits, composition and the file that the user gets all come from that one
//! rewriting.
//!
//! A mechanism's file holds data: the law as text ([`Law`]), the places where it can stand, what the recording must show for
//! it to be seen ([`Need`]), a sentence for people, a reference. `docs/catalogue.md` is printed from it. To add one: write
//! its file beside its family, list it in [`catalogue`], run the conformance suite ([`conformance`]).

pub mod conformance;
mod copies;
mod enter;
mod excitation;
mod family;
mod form;
mod grid;
mod law;
mod page;
mod resolution;
mod rewrite;
mod rewritten;
mod sentence;
mod signals;
mod survey;

mod actuator;
mod aero;
mod bias;
mod damping;
mod drive;
mod friction;
mod hysteresis;
mod input;
mod limit;
mod mode;
pub mod numerics;
mod path;
mod play;
mod presliding;
mod sensor;
mod stiffness;
mod storage;
mod time;
mod viscous_memory;

use crate::slot::{Place, Slot, Structure};

pub use excitation::Need;
pub(crate) use family::SLOW;
pub use family::{Block, Family};
pub use form::{Form, Purpose};
pub use grid::Grid;
pub(crate) use grid::{log_grid, log_steps};
pub use law::{Amplitudes, Change, Derived, Law, LawParameter, LawState, Role, Start};
pub use page::catalogue_page;
pub use rewrite::RewriteError;
pub use rewritten::{Amplitude, Places, Reported, Rewritten, Shape};
pub use sentence::{Value, number_with_unit};
pub use signals::{Signals, band_but_for, excited_band, mean, rms};
pub use survey::{Stretch, SurveyError, survey};

/// One entry of the catalogue.
#[derive(Debug)]
pub struct Mechanism {
    /// The name in `diagnosis.json`.
    pub id: &'static str,
    /// Its family.
    pub family: Family,
    /// The part of the simulation in which it stands; at an input or a sensor that part is named instead.
    pub block: Block,
    /// Where it can stand.
    pub places: &'static [Place],
    /// A further condition on the slot.
    pub applies: fn(&Slot) -> bool,
    /// Patterns of a baseline that already has it at the slot. Capital letters of one character match anything.
    pub already: &'static [&'static str],
    /// The law at a slot.
    pub law: fn(&Slot, Purpose) -> Law,
    /// Mechanisms that it turns into at special values of its parameters: it must earn what it has more than they.
    pub contains: &'static [&'static str],
    /// What it is often mistaken for.
    pub confusable: &'static [&'static str],
    /// What the recording must show for it to be seen.
    pub needs: &'static [Need],
    /// For people; `{name}` stands for a reported value with its unit, `{place}` for where it is.
    pub sentence: &'static str,
    /// How it shows.
    pub signature: &'static str,
    /// Where the law comes from.
    pub reference: &'static str,
}

/// For `Mechanism::applies`: every slot of the right place.
pub(crate) fn anywhere(_: &Slot) -> bool {
    true
}

impl Mechanism {
    /// The slots of a simulation at which this mechanism is a candidate: of the right kind, and the baseline has not got it
    /// there.
    pub fn slots(&self, structure: &Structure) -> Vec<Slot> {
        structure.slots.iter().filter(|slot| self.fits(slot) && !self.is_in(slot)).cloned().collect()
    }

    /// Whether the slot is of the right kind.
    pub fn fits(&self, slot: &Slot) -> bool {
        self.places.contains(&slot.place) && (self.applies)(slot)
    }

    /// Whether the baseline already has this mechanism at the slot.
    pub fn is_in(&self, slot: &Slot) -> bool {
        self.already.iter().any(|pattern| slot.shows(pattern))
    }

    /// The block of `diagnosis.json` at that slot.
    pub fn block_at(&self, slot: &Slot) -> Block {
        match (slot.place, self.block) {
            (_, Block::TimeVariation | Block::Disturbance) => self.block,
            (Place::Input | Place::Prescribed | Place::Between | Place::Command | Place::Winding | Place::Plays, _) => {
                Block::Input
            }
            (Place::Sensor, _) => Block::Output,
            _ => self.block,
        }
    }

    /// The other members of its family.
    pub fn siblings(&self) -> impl Iterator<Item = &'static Mechanism> + '_ {
        catalogue().iter().copied().filter(|m| m.family == self.family && m.id != self.id)
    }

    /// The law at a slot. Friction and hysteresis follow what the damping of the simulation follows: where an input controls it, their size
    /// too.
    pub(crate) fn law_at(&self, slot: &Slot, purpose: Purpose) -> Law {
        let law = (self.law)(slot, purpose);
        if slot.has("control") && self.family.follows_control() { law.controlled() } else { law }
    }

    /// What the law at a slot can be fitted as, with the law in that form, the plain one first; forms that it has not got are left out.
    pub fn forms(&self, slot: &Slot) -> Vec<(Purpose, Law)> {
        let mut known: Vec<(Purpose, Law)> = Vec::new();
        for purpose in Purpose::FITTED {
            let law = self.law_at(slot, purpose);
            if known.iter().all(|(_, other)| *other != law) {
                known.push((purpose, law));
            }
        }
        known
    }

    /// What it is fitted as at first, where these are the amplitudes of its screening form that explain a residual best: a law of two sides of which one
    /// does next to nothing as [`Form::Other`] (above) or [`Form::Few`] (below), but for one that the signal never reached; of laws that are screened one by one the form with this amplitude;
    /// a law that is there or not, and of which less than the whole is there, as [`Form::Soft`]; a wave that is a power at the best of these `shapes` as [`Form::Other`].
    pub(crate) fn fitted_first(&self, slot: &Slot, amplitudes: &[(String, f64)], shapes: &[(String, f64)]) -> Purpose {
        let screened = self.law_at(slot, Purpose::Screening);
        let power = |(p, (_, value)): (&LawParameter, &(String, f64))| match &p.role {
            Role::Shape(Grid::Waves(_, multiples, _)) => multiples.iter().all(|m| value < m),
            _ => false,
        };
        let shaped = screened.parameters.iter().filter(|p| matches!(p.role, Role::Shape(_)));
        if shaped.zip(shapes).any(power) {
            return Purpose::Form(Form::Other);
        }
        match (screened.amplitudes, amplitudes) {
            (Amplitudes::Apart, [(name, _)]) => {
                let amplitude = |p: &&LawParameter| p.role == Role::Amplitude;
                let has_it = |law: &Law| law.parameters.iter().filter(amplitude).map(|p| &p.name).eq([name]);
                self.forms(slot).into_iter().find(|(_, law)| has_it(law)).map_or(Purpose::Refit, |(form, _)| form)
            }
            (Amplitudes::Share, [(_, share)]) if *share < WHOLE => Purpose::Form(Form::Soft),
            (Amplitudes::OfTwoSides, [(_, above), (_, below)]) => {
                let idle = |this: &f64, other: &f64| *this != 0.0 && this.abs() < IDLE * other.abs();
                if idle(below, above) {
                    Purpose::Form(Form::Other)
                } else if idle(above, below) {
                    Purpose::Form(Form::Few)
                } else {
                    Purpose::Refit
                }
            }
            _ => Purpose::Refit,
        }
    }

    /// The parameter of the simulation that this law can take the place of: the size of a law of another family, there already, that this one contains.
    /// Dahl's friction beside a dry friction of the simulation is the same friction twice.
    pub(crate) fn stands_for<'s>(&self, slot: &'s Slot) -> Option<&'s str> {
        let contained = self.contains.iter().filter_map(|id| mechanism(id)).filter(|m| m.family != self.family);
        contained.into_iter().find_map(|m| slot.size_beside(m.already))
    }

    /// What the recording lacks for this mechanism to be seen at the slot, in words; `None` when nothing is lacking.
    pub fn lacking(&self, signals: &Signals) -> Option<String> {
        let missing: Vec<String> = self.needs.iter().filter_map(|need| need.lacking(signals)).collect();
        if missing.is_empty() { None } else { Some(missing.join("; ")) }
    }

    /// Whether the law can be written at all: the step of a sensor that shows none cannot, and a threshold that is always exceeded is an offset.
    pub fn is_written_from(&self, signals: &Signals) -> bool {
        self.needs.iter().all(|need| match need {
            Need::Steps => signals.resolution().is_some(),
            Need::Below(..) => need.lacking(signals).is_none(),
            _ => true,
        })
    }
}

/// Share of a law that is there or not from which it passes for the whole: what noise of a twentieth of a step before a converter leaves of its stair.
const WHOLE: f64 = 0.75;

/// Share of what a law does on one side below which it does nothing on the other.
const IDLE: f64 = 0.3;

/// Every mechanism, in the order of the families.
pub fn catalogue() -> &'static [&'static Mechanism] {
    CATALOGUE
}

static CATALOGUE: &[&Mechanism] = &[
    &friction::COULOMB_FRICTION,
    &friction::ASYMMETRIC_FRICTION,
    &friction::STRIBECK_FRICTION,
    &friction::LOAD_DEPENDENT_FRICTION,
    &presliding::DAHL_FRICTION,
    &presliding::LUGRE_FRICTION,
    &presliding::ELASTOPLASTIC_FRICTION,
    &damping::QUADRATIC_DAMPING,
    &damping::POWER_LAW_DAMPING,
    &damping::DISPLACEMENT_DEPENDENT_DAMPING,
    &stiffness::CUBIC_STIFFNESS,
    &stiffness::QUINTIC_STIFFNESS,
    &stiffness::GAP_STOP,
    &stiffness::QUADRATIC_STIFFNESS,
    &stiffness::BILINEAR_STIFFNESS,
    &stiffness::SPRING_CLEARANCE,
    &hysteresis::BOUC_WEN,
    &hysteresis::ASYMMETRIC_BOUC_WEN,
    &hysteresis::PINCHING,
    &hysteresis::DEGRADATION,
    &play::BACKLASH,
    &actuator::PREISACH,
    &actuator::PRANDTL_ISHLINSKII,
    &actuator::ASYMMETRIC_HYSTERESIS,
    &actuator::RATE_DEPENDENT_HYSTERESIS,
    &input::DEAD_ZONE,
    &input::INPUT_SATURATION,
    &input::INPUT_POLYNOMIAL,
    &path::DELAY,
    &path::ACTUATOR_LAG,
    &path::SENSOR_LAG,
    &time::PARAMETER_DRIFT,
    &time::DISSIPATION_HEATING,
    &time::ABRUPT_CHANGE,
    &mode::UNMODELLED_MODE,
    &bias::INPUT_OFFSET,
    &bias::OUTPUT_OFFSET,
    &stiffness::GRAVITY,
    &stiffness::COGGING,
    &mode::POSITION_DEPENDENT_INERTIA,
    &viscous_memory::VISCOELASTIC,
    &viscous_memory::LOG_CREEP,
    &sensor::OUTPUT_SATURATION,
    &sensor::QUANTISATION,
    &sensor::RECTIFIED_OUTPUT,
    &sensor::SENSOR_DRIFT,
    &drive::BACK_EMF,
    &storage::LEAKAGE,
    &storage::OVERFLOW,
    &aero::STALL_LAG,
    &time::PERIODIC_DISTURBANCE,
    &numerics::SOLVER_ARTEFACT,
];

/// The mechanism of that name.
pub fn mechanism(id: &str) -> Option<&'static Mechanism> {
    catalogue().iter().copied().find(|m| m.id == id)
}
