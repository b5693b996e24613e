//! A hypothesis: a set of effects, written into the user's simulation and fitted together with its parameters.
//!
//! Its evidence is the log likelihood of the residual under its own noise model, less half of `ln n` for each unknown that the effects
//! brought (the Bayes criterion).

use hysid_plant::Simulation;

use crate::budget::Budget;
use crate::data::{DataSet, held_out_blocks};
use crate::evidence::Whitener;
use crate::mechanism::{Amplitudes, Mechanism, Places, Purpose, Rewritten, Shape};
use crate::model::base::{Base, NoiseKind, Start, fit_simulation};
use crate::model::force::noise_of;
use crate::model::{Count, Model, Values};
use crate::refit::{Held, LmOptions, Problem, go_on};
use crate::slot::Slot;

/// An effect of a hypothesis.
#[derive(Debug, Clone)]
pub struct Effect {
    /// The mechanism.
    pub mechanism: &'static Mechanism,
    /// The slot at which it was written.
    pub slot: Slot,
    /// How it was written: names of its parameters and states, what is reported.
    pub written: Rewritten,
    /// Share that the simulation's own parameters absorb, from the screening.
    pub concealment: Option<f64>,
}

impl Effect {
    /// Whether the other is the same mechanism at the same slot.
    pub fn states_the_same(&self, other: &Self) -> bool {
        self.mechanism.id == other.mechanism.id && self.slot.label == other.slot.label
    }

    /// Whether it is a limit, which may act on one side or on both.
    pub fn is_a_limit(&self) -> bool {
        self.mechanism.law_at(&self.slot, Purpose::Screening).amplitudes == Amplitudes::OfTwoSides
    }

    /// Its shapes that are moments of a recording.
    pub fn moments(&self) -> impl Iterator<Item = &Shape> {
        self.written.shapes.iter().filter(|shape| shape.places == Places::Moments)
    }
}

/// A fitted set of effects.
#[derive(Debug)]
pub struct Hypothesis<'d> {
    /// The effects in the order in which they were written.
    pub effects: Vec<Effect>,
    /// The fitted simulation.
    pub base: Base<'d>,
    /// Log likelihood less the price of what the effects brought.
    pub log_evidence: f64,
}

/// Mechanisms and places of a set, sorted: two hypotheses with the same key are the same statement.
pub type Key = Vec<(&'static str, String)>;

/// Whether two effects are one law: sums of the same elements of one signal, or what acts at a place once.
pub fn are_one_law(a: (&Mechanism, &Slot), b: (&Mechanism, &Slot)) -> bool {
    let one_signal = || a.1.quantity("u").zip(b.1.quantity("u")).is_some_and(|(u, w)| u.expression == w.expression);
    let alike = || a.1.label == b.1.label || one_signal();
    let one_sum = a.0.family.members_imitate() && a.0.family == b.0.family && alike();
    one_sum || (a.0.family.acts_once() && a.0.id == b.0.id && a.1.is_at(b.1))
}

/// Share of the rows that must lie on either side of a moment; beside an effect with a memory, which forgets how it began only when its largest turns
/// have come.
const EITHER_SIDE: f64 = 0.03;
const BESIDE_A_MEMORY: f64 = 0.1;

impl Hypothesis<'_> {
    /// The statement that it makes.
    pub fn key(&self) -> Key {
        self.key_of(|_| true)
    }

    /// The statement without this one of its effects.
    pub fn key_without(&self, member: usize) -> Key {
        self.key_of(|i| i != member)
    }

    /// The statement of those of its effects that stay.
    pub fn key_of(&self, stays: impl Fn(usize) -> bool) -> Key {
        let members = self.effects.iter().enumerate().filter(|(i, _)| stays(*i));
        let mut key: Key = members.map(|(_, e)| (e.mechanism.id, e.slot.identity())).collect();
        key.sort();
        key
    }

    /// Whether two of its effects are one law.
    pub fn repeats_itself(&self) -> bool {
        let one = |a: &Effect, b: &Effect| are_one_law((a.mechanism, &a.slot), (b.mechanism, &b.slot));
        self.effects.iter().enumerate().any(|(i, a)| self.effects[..i].iter().any(|b| one(a, b)))
    }

    /// Whether an effect of it begins at a moment so near to an end of the recording that it may be what a state that nobody knows leaves as it dies away.
    pub fn changes_at_an_end(&self, effect: &Effect) -> bool {
        let remembers = self.effects.iter().any(|e| e.mechanism.family.has_memory());
        let least = if remembers { BESIDE_A_MEMORY } else { EITHER_SIDE };
        let values = self.base.values();
        effect.moments().any(|shape| {
            values.parameters.get(&shape.name).is_some_and(|moment| {
                let before = self.base.model.data().share_before(*moment);
                before < least || before > 1.0 - EITHER_SIDE
            })
        })
    }

    /// Its effects by name, sorted: mechanisms and labels of slots, which two places may share.
    pub fn names(&self) -> Vec<(&str, &str)> {
        self.sorted(|e| (e.mechanism.id, e.slot.label.as_str()))
    }

    /// The mechanisms of its effects, sorted.
    pub fn mechanisms(&self) -> Vec<&'static str> {
        self.sorted(|e| e.mechanism.id)
    }

    /// The families of its effects, sorted.
    pub fn families(&self) -> Vec<&'static str> {
        self.sorted(|e| e.mechanism.family.name())
    }

    fn sorted<'h, T: Ord>(&'h self, of: impl Fn(&'h Effect) -> T) -> Vec<T> {
        let mut all: Vec<T> = self.effects.iter().map(of).collect();
        all.sort_unstable();
        all
    }
}

/// The place of the set with the most evidence among those of a pool that make a statement.
pub fn best_that_says(pool: &[Hypothesis<'_>], key: &Key) -> Option<usize> {
    let sets: Vec<(Key, f64)> = pool.iter().map(|h| (h.key(), h.log_evidence)).collect();
    best_place(&sets, key)
}

/// The same of sets by statement and evidence.
pub fn best_place(sets: &[(Key, f64)], key: &Key) -> Option<usize> {
    (0..sets.len()).filter(|&i| sets[i].0 == *key).max_by(|&a, &b| sets[a].1.total_cmp(&sets[b].1))
}

/// How well a hypothesis predicts blocks that it was not fitted to: log likelihood of the blocks, each row for
/// the share that it has in the fit, and each row's square (in units of its output's scale) for the standard error of a difference.
pub type OnBlocks = (f64, Vec<f64>);

/// How well a hypothesis predicts blocks of the estimation recordings when it is fitted to the rest.
///
/// The moments at which something begins stay as they were found: one that lies in a block, or between two, could be anywhere there for all that the
/// rest tells, and the block would be predicted by a guess.
pub fn block_score(setting: &Setting<'_>, h: &Hypothesis<'_>) -> Option<OnBlocks> {
    let data = setting.data;
    let weights = held_out_blocks(&data.layout, &data.y);
    let options = LmOptions::within(5, data.rows());
    let moments = h.effects.iter().flat_map(Effect::moments);
    let moments: Vec<usize> = moments.filter_map(|m| h.base.model.place_of(&m.name)).collect();
    let problem = Held::at(&h.base.model, &h.base.fit.theta, &moments);
    let fit = go_on(&problem, &h.base.fit, &data.layout, &h.base.whitener, Some(&weights), options)?;
    let white = h.base.whitener.apply(&data.layout, &fit.residual);
    let scales = data.scales();
    let (mut score, mut squares) = (0.0, Vec::new());
    for (run, s) in data.layout.runs() {
        let scale = h.base.whitener.log_scale_of(&data.layout, run, s) / s.rows.len() as f64;
        for row in s.rows.clone().filter(|&row| weights[row] == 0.0) {
            score -= 0.5 * white[row] * white[row] + scale;
            squares.push((fit.residual[row] / scales[s.output]).powi(2));
        }
    }
    // Rows that are no independent witnesses of the fit are none of the blocks either.
    (!squares.is_empty()).then_some((setting.noise.share() * score, squares))
}

/// What all fits share.
#[derive(Debug, Clone)]
pub struct Setting<'d> {
    /// The estimation data.
    pub data: &'d DataSet,
    /// The user's simulation.
    pub original: Simulation,
    /// Names of the states whose derivative an unknown force or flow may enter.
    pub pushed: Vec<String>,
    /// Integration steps in each period.
    pub substeps: usize,
    /// Labels of the outputs of which the recorded values lie on the steps of a fine converter, where its rounding is much of what is left.
    pub rounded: Vec<String>,
    /// Number of unknowns of the simulation without effects.
    pub own_unknowns: Count,
    /// Iterations of a refit on the short list.
    pub iterations: usize,
    /// How noise is modelled.
    pub noise: NoiseKind,
    /// The time that the search may take.
    pub budget: &'d Budget<'d>,
}

impl<'d> Setting<'d> {
    /// The same by plain squares, each row of which counts for this share of one.
    pub fn in_plain_squares(&self, share: f64) -> Self {
        Self { noise: NoiseKind::White(share), ..self.clone() }
    }

    /// Fits a document from values; the noise model is that given, then its own.
    pub fn fit(
        &self,
        document: &Simulation,
        start: &Values,
        noise: Option<&Whitener>,
        rounds: usize,
        iterations: usize,
    ) -> Option<Base<'d>> {
        self.fit_from(document, Start::Values(start), noise, rounds, iterations)
    }

    /// The noise of what a document leaves at these values.
    pub fn noise_at(&self, document: &Simulation, values: &Values) -> Option<Whitener> {
        let model = Model::new(document, self.data, self.substeps).ok()?;
        let theta = model.theta(values);
        let residual = model.residual(&theta)?;
        Some(noise_of(&model, &theta, &residual, &self.pushed).0)
    }

    /// Goes on with a fitted document; the noise model is that given, then its own.
    pub fn further(
        &self,
        base: &Base<'_>,
        noise: Option<&Whitener>,
        rounds: usize,
        iterations: usize,
    ) -> Option<Base<'d>> {
        self.fit_from(base.model.simulation(), Start::Fit(&base.fit), noise, rounds, iterations)
    }

    fn fit_from(
        &self,
        document: &Simulation,
        start: Start<'_>,
        noise: Option<&Whitener>,
        rounds: usize,
        iterations: usize,
    ) -> Option<Base<'d>> {
        let model = Model::new(document, self.data, self.substeps).ok()?;
        let options = LmOptions::within(iterations, self.data.rows());
        fit_simulation(model, start, &self.pushed, noise, rounds, options, self.noise)
    }

    /// A fitted document as a hypothesis.
    pub fn hypothesis(&self, effects: Vec<Effect>, base: Base<'d>) -> Hypothesis<'d> {
        let log_evidence = self.evidence(&base);
        Hypothesis { effects, base, log_evidence }
    }

    /// The evidence of a fitted document.
    pub fn evidence(&self, base: &Base<'_>) -> f64 {
        let further = base.model.count().beyond(self.own_unknowns);
        base.log_likelihood - self.noise.price(self.own_unknowns.lasting, further, self.data.rows())
    }
}

/// For tests: a recording of an input and an output, as data of a simulation.
#[cfg(test)]
pub fn recorded<const N: usize>(simulation: &Simulation, period_s: f64, columns: [(&str, Vec<f64>); N]) -> DataSet {
    use hysid_signal::{Channel, Clock, Recording};
    let channels = columns.map(|(name, samples)| Channel { name: name.into(), samples }).into();
    let recording = Recording::new("est.csv", Clock { start_s: 0.0, period_s }, channels).unwrap();
    DataSet::new(simulation, &[recording], 3).unwrap()
}

/// For tests: what a simulation records where a state has another derivative, its one output with a noise of this share of its rms.
#[cfg(test)]
pub fn lacking_a_law(
    simulation: &Simulation,
    (state, derivative): (&str, &str),
    period_s: f64,
    (input, u): (&str, Vec<f64>),
    (noise, random): (f64, &mut dyn FnMut() -> f64),
) -> DataSet {
    use hysid_plant::{Compiled, Drive, Expr, Run};
    let mut truth = simulation.clone();
    truth.state_mut(state).unwrap().derivative = Expr::parse(derivative).unwrap();
    let compiled = Compiled::new(&truth).unwrap();
    let run = Drive::new(0.0, period_s, u.len(), vec![u.clone()]).unwrap();
    let mut y = compiled.simulate(&Run::new(&run, &compiled.theta())).outputs.swap_remove(0);
    let noise = noise * crate::oscillator::rms(&y);
    y.iter_mut().for_each(|y| *y += noise * random());
    recorded(simulation, period_s, [(input, u), (&simulation.outputs[0].column, y)])
}

/// For tests: a simulation calibrated on a data set from its own values, and what its fits share.
#[cfg(test)]
pub fn calibrated<'d>(
    original: Simulation,
    data: &'d DataSet,
    noise: NoiseKind,
    budget: &'d Budget<'d>,
) -> (Setting<'d>, Hypothesis<'d>) {
    let mut setting = Setting {
        data,
        pushed: crate::model::force::pushed(&original),
        original,
        substeps: 2,
        rounded: Vec::new(),
        own_unknowns: Count::default(),
        iterations: 12,
        noise,
        budget,
    };
    let base = setting.fit(&setting.original, &Values::default(), None, 3, 25).unwrap();
    setting.own_unknowns = base.model.count();
    let none = setting.hypothesis(Vec::new(), base);
    (setting, none)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oscillator::{drive, normal};
    use crate::search::fitting::refit;
    use crate::search::screen::screen;

    #[test]
    fn the_best_set_that_makes_a_statement_is_found() {
        let key = |ids: &[&'static str]| -> Key { ids.iter().map(|id| (*id, String::new())).collect() };
        let sets =
            [(key(&[]), 0.0), (key(&["a"]), 55.0), (key(&["b"]), 90.0), (key(&["a"]), 60.0), (key(&["a", "b"]), 100.0)];
        assert_eq!(best_place(&sets, &key(&["a"])), Some(3));
        assert_eq!(best_place(&sets, &key(&["a", "b"])), Some(4));
        assert_eq!(best_place(&sets, &key(&["c"])), None);
    }

    #[test]
    fn a_law_that_acts_once_is_not_said_twice() {
        use crate::mechanism::conformance::specimens;
        use crate::mechanism::mechanism;
        use crate::slot::Structure;

        let two_masses = specimens().into_iter().find(|s| s.title.starts_with("Two masses")).unwrap();
        let structure = Structure::of(&two_masses);
        let alike = |first: &str, second: &str| {
            let [(a, at), (b, there)] =
                [first, second].map(|id| mechanism(id).map(|m| (m, m.slots(&structure))).unwrap());
            let same = are_one_law((a, &at[0]), (b, &there[0]));
            // The force on a part and the one between it and the other share a label.
            let elsewhere = at.iter().zip(&there).skip(1).any(|(_, other)| are_one_law((a, &at[0]), (b, other)));
            (same, elsewhere)
        };
        assert_eq!(alike("stribeck_friction", "stribeck_friction"), (true, false));
        assert_eq!(alike("stribeck_friction", "quadratic_damping"), (false, false));
        assert_eq!(alike("unmodelled_mode", "unmodelled_mode"), (false, false));
        assert!(alike("prandtl_ishlinskii", "preisach").0);
    }

    #[test]
    fn a_moment_in_a_block_is_not_guessed() {
        // A tank whose outlet jumps in the third block of ten, which is held out: little of it is left when the block ends.
        let text = "[time]\nperiod_s = 0.1\nhold = \"zero\"\n[inputs]\nu = \"inflow\"\n[parameters]\nA = { value = 6.0, min = 1.0, max = 30.0 }\n\
                    k = { value = 3.0, min = 0.5, max = 9.0 }\n[states]\nh = { derivative = \"(u - k*h)/A\", initial = \"free\" }\n[outputs]\nlevel_m = \"h\"\n";
        let (n, moment) = (1000, 240);
        let mut random = normal(4);
        let u: Vec<f64> = drive(n, &mut random).into_iter().map(|u| 30.0 + u).collect();
        let mut h = 8.0;
        let mut y: Vec<f64> = Vec::new();
        for (i, u) in u.iter().enumerate() {
            y.push(h);
            let k = if i < moment { 4.0 } else { 4.1 };
            h = u / k + (h - u / k) * f64::exp(-0.1 * k / 4.8);
        }
        let noise = 0.02;
        y.iter_mut().for_each(|y| *y += noise * random());
        let original = Simulation::parse(text, "tank.sim.toml").unwrap();
        let data = recorded(&original, 0.1, [("inflow", u), ("level_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let jump = |m: &Mechanism, s: &Slot| m.id == "abrupt_change" && s.label == "parameter:k";
        let found = screen(&none.base, &setting.original, &[], &none.base.evidence(), &jump);
        let set = refit(&setting, &none, &found[0]).unwrap();
        let left = |h: &Hypothesis<'_>| {
            let (_, squares) = block_score(&setting, h).unwrap();
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt() * data.scales()[0]
        };
        assert!(left(&set) < 1.1 * noise, "{} beside {} and a noise of {noise}", left(&set), left(&none));
    }
}
