//! Shapes that least squares cannot move (a moment, a period, a knee): the error as a function of one of them, the other unknowns following it.
//!
//! Along such a shape a fit has many minima, and a step that lowers the error ends in the nearest. So the response is simulated at many values of it, and
//! at each the other unknowns take what the tangents of the fit can take up (the error left is that of a variable projection whose second half is
//! linear). A run costs an eighth of a simulation in lanes, and no derivatives; only the lowest points are fitted.
//!
//! Reference: G. Golub, V. Pereyra, Separable nonlinear least squares: the variable projection method and its applications, Inverse Problems 19 (2003) R1-R26.

use rayon::prelude::*;

use crate::budget::Step;
use crate::evidence::{Projector, norm2};
use crate::mechanism::{Places, Shape};
use crate::model::Model;
use crate::model::base::{Base, QUANTILE};
use crate::model::hypothesis::{Effect, Hypothesis, Setting};

/// Values on either side of where the shape stands, over one spacing.
const ASIDE: usize = 12;
/// Scans, each over the two nearest values of the one before.
const SCANS: usize = 4;
/// Minima of the first scan that are followed.
const FOLLOWED: usize = 2;
/// Times that the other unknowns are fitted and the shape is scanned again.
const ROUNDS: usize = 2;
/// Iterations of a fit from the lowest point.
const ITERATIONS: usize = 3;
/// Log likelihood that a move must bring.
const LEAST: f64 = 1e-3;
/// Moments between the ends of a recording at which it is asked whether one says as much as another, and the log likelihood within which it does.
const MOMENTS: usize = 200;
const AS_GOOD: f64 = 0.05;
/// Samples on either side of a moment at which it is asked whether it could as well have been there.
const BESIDE: usize = 24;
/// Halvings of the way to a bound that are looked at, and cuts of the one in which the interval ends, each into so many parts.
const HALVINGS: i32 = 24;
const CUTS: usize = 3;
const PARTS: u32 = 8;

/// Moves the shapes of a set's `index`-th effect that least squares cannot move to where the error is least in their neighbourhood.
pub fn profile_shapes<'d>(setting: &Setting<'d>, h: &mut Hypothesis<'d>, index: usize) {
    let shapes: Vec<Shape> =
        h.effects[index].written.shapes.iter().filter(|s| s.searched && s.grid.len() >= 3).cloned().collect();
    for shape in &shapes {
        for _ in 0..ROUNDS {
            if setting.budget.omits(Step::Fits) {
                return;
            }
            let fitted = lowest(&h.base, shape).into_par_iter().filter_map(|value| {
                let mut from = h.base.values();
                from.parameters.insert(shape.name.clone(), value);
                setting.fit(h.base.model.simulation(), &from, Some(&h.base.whitener), 1, ITERATIONS)
            });
            let all: Vec<_> = fitted.filter(|b| b.log_likelihood > h.base.log_likelihood + LEAST).collect();
            match all.into_iter().max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood)) {
                Some(better) => h.base = better,
                None => break,
            }
        }
    }
}

/// Puts the moments of a set's effects into the middle of the time in which they could as well be. To be done last: a fit goes on from anywhere in it.
pub fn centre_moments<'d>(setting: &Setting<'d>, h: &mut Hypothesis<'d>) {
    let shapes = h.effects.iter().flat_map(Effect::moments);
    for shape in shapes.cloned().collect::<Vec<_>>() {
        if let Some(centred) = centred(setting, &h.base, &shape) {
            h.base = centred;
        }
    }
}

/// Takes the 95 % intervals of shapes that least squares cannot move by the profile of the error (a likelihood ratio): the tangents at one place tell nothing of how far a
/// moment or a knee may lie, and at a moment between two samples they are zero.
pub fn take_intervals(h: &mut Hypothesis<'_>) {
    let shapes = h.effects.iter().flat_map(|e| &e.written.shapes);
    let shapes = shapes.filter(|s| s.searched || s.places == Places::Moments);
    let found: Vec<(String, [f64; 2])> =
        shapes.filter_map(|shape| Some((shape.name.clone(), interval(&h.base, shape)?))).collect();
    h.base.profiled.extend(found);
}

/// Where the profile of the error has risen by what one unknown does with a probability of 5 %, on either side of where the shape stands; the bound where it does
/// not rise so far. A moment may as well have been on the other side of one that it cannot have been at: as a machine slows down, and as it speeds up again.
fn interval(base: &Base<'_>, shape: &Shape) -> Option<[f64; 2]> {
    let error = Profile::of(base, shape)?;
    let here = error.here;
    let within = error.at(&[here]).first()? + QUANTILE.powi(2) * base.variance();
    let side = |bound: f64| {
        let place = |share: f64| here + share * (bound - here);
        // The first share of the way at which the error is too large, from the least on; and the last before it.
        let crossing = |shares: &[f64]| {
            let errors = error.at(&shares.iter().map(|s| place(*s)).collect::<Vec<_>>());
            errors.iter().position(|e| *e > within)
        };
        let halvings: Vec<f64> = (0..=HALVINGS).rev().map(|k| 0.5_f64.powi(k)).collect();
        let Some(first) = crossing(&halvings) else { return bound };
        let (mut inside, mut outside) = (if first > 0 { halvings[first - 1] } else { 0.0 }, halvings[first]);
        for _ in 0..CUTS {
            let cuts: Vec<f64> =
                (1..PARTS).map(|i| inside + (outside - inside) * f64::from(i) / f64::from(PARTS)).collect();
            let next = crossing(&cuts);
            outside = next.map_or(outside, |i| cuts[i]);
            inside = next.map_or(cuts.last().copied(), |i| i.checked_sub(1).map(|i| cuts[i])).unwrap_or(inside);
        }
        place(0.5 * (inside + outside))
    };
    let [low, high] = [side(error.bounds.0), side(error.bounds.1)];
    if shape.places != Places::Moments {
        return Some([low, high]);
    }
    let others = error.around(here, base.model.data().period_s, BESIDE).into_iter().filter(|at| at.1 <= within);
    Some(others.fold([low, high], |[low, high], (at, _)| [low.min(at), high.max(at)]))
}

/// The fit with a moment in that middle, where that is more than a step: while the machine stands still nothing
/// tells when its damping changed, and another recording moves on at another time.
fn centred<'d>(setting: &Setting<'d>, base: &Base<'d>, shape: &Shape) -> Option<Base<'d>> {
    let error = Profile::of(base, shape)?;
    let step = (error.bounds.1 - error.bounds.0) / MOMENTS as f64;
    let now = *error.at(&[error.here]).first()?;
    let as_good = |at: &&(f64, f64)| at.1 <= now + 2.0 * AS_GOOD;
    if !error.around(error.here, step, 1).iter().any(|at| at.0 != error.here && as_good(&at)) {
        return None;
    }
    let all = error.around(error.here, step, MOMENTS);
    let (before, after): (Vec<_>, Vec<_>) = all.into_iter().partition(|at| at.0 < error.here);
    let first = before.iter().rev().take_while(as_good).last().map_or(error.here, |at| at.0);
    let last = after.iter().take_while(as_good).last().map_or(error.here, |at| at.0);
    let middle = 0.5 * (first + last);
    if (middle - error.here).abs() < step {
        return None;
    }
    let mut from = base.values();
    from.parameters.insert(shape.name.clone(), middle);
    let fitted = setting.fit(base.model.simulation(), &from, Some(&base.whitener), 1, 0)?;
    (fitted.log_likelihood > base.log_likelihood - 2.0 * AS_GOOD).then_some(fitted)
}

/// Values of the shape at which the error is least, and less than where it stands; none where it cannot be told.
fn lowest(base: &Base<'_>, shape: &Shape) -> Vec<f64> {
    let Some(error) = Profile::of(base, shape) else { return Vec::new() };
    let here = error.here;
    let Some(&now) = error.at(&[here]).first() else { return Vec::new() };
    let step = shape.spacing(here) / ASIDE as f64;
    let scanned = error.around(here, step, ASIDE);
    let is_least = |i: usize| {
        let neighbour = |j: Option<usize>| j.and_then(|j| scanned.get(j)).map_or(f64::INFINITY, |s: &(f64, f64)| s.1);
        scanned[i].1 <= neighbour(i.checked_sub(1)) && scanned[i].1 <= neighbour(Some(i + 1))
    };
    let mut minima: Vec<(f64, f64)> = (0..scanned.len()).filter(|&i| is_least(i)).map(|i| scanned[i]).collect();
    minima.sort_by(|a, b| a.1.total_cmp(&b.1));
    minima.truncate(FOLLOWED);
    let finer = minima.into_iter().map(|mut least| {
        let mut step = step;
        for _ in 1..SCANS {
            let nearest = error.around(least.0, step / 4.0, 3);
            least = nearest.into_iter().fold(least, |a, b| if b.1 < a.1 { b } else { a });
            step /= 4.0;
        }
        least
    });
    finer.filter(|least| least.1 < now).map(|least| least.0).collect()
}

/// The error of a fit as a function of one shape.
struct Profile<'a, 'd> {
    base: &'a Base<'d>,
    /// The simulation in which the shape is a number.
    model: Model<'d>,
    name: &'a str,
    /// Where it stands, and its bounds.
    here: f64,
    bounds: (f64, f64),
    /// What the other unknowns can take up.
    others: Projector,
}

impl<'a, 'd> Profile<'a, 'd> {
    fn of(base: &'a Base<'d>, shape: &'a Shape) -> Option<Self> {
        let mut document = base.model.simulation().clone();
        let parameter = document.parameter_mut(&shape.name)?;
        let bounds = (parameter.lower(), parameter.upper());
        parameter.fixed = true;
        let model = Model::new(&document, base.model.data(), base.model.substeps()).ok()?;
        let place = base.model.place_of(&shape.name)?;
        let layout = &base.model.data().layout;
        let columns = base.fit.jacobian.iter().enumerate().filter(|(i, _)| *i != place);
        let others = Projector::new(columns.map(|(_, c)| base.whitener.apply(layout, c)));
        Some(Self { base, model, name: &shape.name, here: base.fit.theta[place], bounds, others })
    }

    /// The error at these values: the sum of squares that the other unknowns leave; infinite where the simulation diverges.
    fn at(&self, values: &[f64]) -> Vec<f64> {
        let data = self.model.data();
        let theta = self.model.theta(&self.base.values());
        let settings: Vec<Vec<(String, f64)>> = values.iter().map(|v| vec![(self.name.to_owned(), *v)]).collect();
        let runs = self.model.tangents_with(&theta, &[], &settings);
        let left = |run: Option<(Vec<f64>, Vec<Vec<f64>>)>| {
            let (prediction, _) = run?;
            let residual: Vec<f64> = data.y.iter().zip(&prediction).map(|(y, p)| y - p).collect();
            let mut white = self.base.whitener.apply(&data.layout, &residual);
            self.others.remove(&mut white);
            Some(norm2(&white)).filter(|e| e.is_finite())
        };
        runs.into_iter().map(|run| left(run).unwrap_or(f64::INFINITY)).collect()
    }

    /// So many values on either side of one, a step apart and within the bounds, each with its error.
    fn around(&self, middle: f64, step: f64, aside: usize) -> Vec<(f64, f64)> {
        let (low, high) = self.bounds;
        let all = (0..=2 * aside).map(|i| middle + (i as f64 - aside as f64) * step);
        let values: Vec<f64> = all.filter(|v| (low..=high).contains(v)).collect();
        let errors = self.at(&values);
        values.into_iter().zip(errors).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::data::DataSet;
    use crate::mechanism::Mechanism;
    use crate::model::Values;
    use crate::model::base::NoiseKind;
    use crate::model::hypothesis::{calibrated, recorded};
    use crate::oscillator::{BASELINE, PERIOD, REAL, drive, normal, respond, rms};
    use crate::search::candidate::Candidate;
    use crate::search::fitting::refit;
    use crate::search::screen::screen;
    use crate::slot::Slot;
    use hysid_plant::Simulation;

    /// The spring of the oscillator with a further stiffness beyond a knee, in metres, and its candidate in the screening.
    fn with_a_knee(knee: f64, check: impl FnOnce(&Setting<'_>, &Hypothesis<'_>, &Candidate)) {
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let mut random = normal(6);
        let u = drive(900, &mut random);
        let mut y = respond(&u, REAL, |x, _| 60.0 * (x - knee).max(0.0));
        let noise = 0.01 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * random());
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
        let found =
            screen(&none.base, &setting.original, &[], &none.base.evidence(), &|m, _| m.id == "bilinear_stiffness");
        check(&setting, &none, &found[0]);
    }

    /// The fit of all other unknowns beside a shape that is held.
    fn held_at<'d>(setting: &Setting<'d>, h: &Hypothesis<'d>, shape: &Shape, value: f64) -> Base<'d> {
        let mut held = h.base.model.simulation().clone();
        held.parameter_mut(&shape.name).unwrap().fixed = true;
        held.parameter_mut(&shape.name).unwrap().value = value;
        let mut from = h.base.values();
        from.parameters.insert(shape.name.clone(), value);
        setting.fit(&held, &from, Some(&h.base.whitener), 1, 30).unwrap()
    }

    /// A simulation with a jump of this parameter, fitted to data.
    fn with_a_jump<'d>(
        original: Simulation,
        data: &'d DataSet,
        budget: &'d Budget<'d>,
        slot: &str,
    ) -> (Setting<'d>, Hypothesis<'d>) {
        let (setting, none) = calibrated(original, data, NoiseKind::White(1.0), budget);
        let wanted = |m: &Mechanism, s: &Slot| m.id == "abrupt_change" && s.label == slot;
        let found = screen(&none.base, &setting.original, &[], &none.base.evidence(), &wanted);
        let h = refit(&setting, &none, &found[0]).unwrap();
        (setting, h)
    }

    /// Beside a fit of all the others with the shape held, iterated to its end; far from where the shape stands their tangents no longer hold.
    #[test]
    fn the_profile_is_the_error_with_the_others_refitted() {
        with_a_knee(0.08, |setting, none, candidate| {
            let h = refit(setting, none, candidate).unwrap();
            let shape = &h.effects[0].written.shapes[0];
            let profile = Profile::of(&h.base, shape).unwrap();
            let step = 0.03 * shape.spacing(profile.here);
            for value in [profile.here, profile.here - step, profile.here + step] {
                let fitted = held_at(setting, &h, shape, value);
                let white = h.base.whitener.apply(&setting.data.layout, &fitted.fit.residual);
                let (exact, found) = (norm2(&white), profile.at(&[value])[0]);
                assert!((found / exact - 1.0).abs() < 0.01, "{value}: {found} for {exact}");
            }
        });
    }

    #[test]
    fn an_interval_ends_where_the_likelihood_of_a_refit_has_fallen_by_its_quantile() {
        with_a_knee(0.08, |setting, none, candidate| {
            let mut h = refit(setting, none, candidate).unwrap();
            take_intervals(&mut h);
            let shape = &h.effects[0].written.shapes[0];
            let told = h.base.intervals().into_iter().find(|i| i.name == shape.name).unwrap();
            let ends = told.ends.unwrap();
            assert!(ends[0] < told.value && told.value < ends[1] && (ends[1] - ends[0]) < 0.02, "{told:?}");
            for end in ends {
                let fitted = held_at(setting, &h, shape, end);
                let white = |b: &Base<'_>| norm2(&h.base.whitener.apply(&setting.data.layout, &b.fit.residual));
                let rise = (white(&fitted) - white(&h.base)) / h.base.variance();
                assert!((rise / QUANTILE.powi(2) - 1.0).abs() < 0.1, "{end}: {rise}");
            }
        });
    }

    #[test]
    fn a_knee_is_found_from_a_spacing_away() {
        let knee = 0.08;
        with_a_knee(knee, |setting, none, candidate| {
            let mut h = refit(setting, none, candidate).unwrap();
            let shape = h.effects[0].written.shapes[0].clone();
            let away = knee - 0.8 * shape.spacing(knee);
            let mut from: Values = h.base.values();
            from.parameters.insert(shape.name.clone(), away);
            h.base = setting.fit(h.base.model.simulation(), &from, None, 1, 0).unwrap();
            let before = h.base.log_likelihood;
            profile_shapes(setting, &mut h, 0);
            let found = h.base.values().parameters[&shape.name];
            assert!((found - knee).abs() < 0.01 && h.base.log_likelihood > before, "{found}, from {away}");
        });
    }

    /// The damping changes while the oscillator stands still: the time between the last swing before and the first one after is found by brute force.
    #[test]
    fn a_moment_at_rest_lies_in_the_middle_of_the_rest() {
        let original = Simulation::parse(BASELINE, "test.sim.toml").unwrap();
        let mut random = normal(6);
        let rest = 300..1500;
        let mut u = drive(1900, &mut random);
        u[rest.clone()].fill(0.0);
        let (steps, (_, c, _)) = (std::cell::Cell::new(0u32), REAL);
        let changes = f64::from(1450u32) * PERIOD;
        let mut y = respond(&u, REAL, |_, v| {
            let t = f64::from(steps.replace(steps.get() + 1)) * PERIOD / 40.0;
            if t > changes { 1.5 * c * v } else { 0.0 }
        });
        let noise = 0.01 * rms(&y);
        y.iter_mut().for_each(|y| *y += noise * random());
        let data = recorded(&original, PERIOD, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (setting, mut h) = with_a_jump(original, &data, &budget, "parameter:c");
        centre_moments(&setting, &mut h);
        let shape = h.effects[0].moments().next().unwrap();
        let profile = Profile::of(&h.base, shape).unwrap();
        let moments: Vec<f64> = (0..3800).map(|n| 0.5 * f64::from(n) * PERIOD).collect();
        let errors = profile.at(&moments);
        let here = moments.iter().position(|t| *t >= profile.here).unwrap();
        let as_good = |n: &usize| errors[*n] <= errors[here] + 2.0 * AS_GOOD;
        let first = moments[(0..=here).rev().take_while(as_good).last().unwrap()];
        let last = moments[(here..moments.len()).take_while(as_good).last().unwrap()];
        assert!(last - first > 50.0 * PERIOD && last < 1505.0 * PERIOD, "{first} to {last}");
        let middle = 0.5 * (first + last);
        assert!((profile.here - middle).abs() < 0.1 * (last - first), "{} of {first} to {last}", profile.here);
        // The tangents see nothing of it there; the interval is that of all moments at which the error is small enough.
        let within = errors[here] + QUANTILE.powi(2) * h.base.variance();
        let all: Vec<f64> = moments.iter().zip(&errors).filter(|(_, e)| **e <= within).map(|(t, _)| *t).collect();
        let name = shape.name.clone();
        take_intervals(&mut h);
        let told = h.base.intervals().into_iter().find(|i| i.name == name).unwrap();
        let [low, high] = told.ends.unwrap();
        assert!(low < changes && changes < high, "{low} to {high}");
        let off = |a: f64, b: Option<&f64>| (a - b.unwrap()).abs();
        assert!(off(low, all.first()).max(off(high, all.last())) < PERIOD, "{low} to {high}, {all:?}");
    }

    /// What a brake that gives way takes off the speed of a drive adds up to how far the drive has come: it may have given way there on the way out as well as on
    /// the way back, and not where it turned.
    #[test]
    fn a_moment_may_lie_on_either_side_of_a_turning_point() {
        let text = "[time]\ncolumn = \"t_s\"\n[inputs]\nu = \"u_N\"\n[parameters]\nb = { value = 1.0, min = 0.1, max = 9.0 }\n[states]\n\
                    x = { derivative = \"w\", initial = 0.0 }\nw = { derivative = \"u - b*w\", initial = 0.0 }\n[outputs]\nx_m = \"x\"\n";
        let original = Simulation::parse(text, "drive.sim.toml").unwrap();
        let (period, n) = (0.1, 1000);
        let u: Vec<f64> = (0..n).map(|i| (0.25 * f64::from(i) * period).sin()).collect();
        let changed = original.to_toml().replace("u - b*w", "u - b*(1 + 0.04*step(t - 37.7))*w");
        let changed = hysid_plant::Compiled::new(&Simulation::parse(&changed, "changed.sim.toml").unwrap()).unwrap();
        let drive = hysid_plant::Drive::new(0.0, period, u.len(), vec![u.clone()]).unwrap();
        let mut y = changed.simulate(&hysid_plant::Run::new(&drive, &changed.theta())).outputs.swap_remove(0);
        let mut random = normal(3);
        y.iter_mut().for_each(|y| *y += 0.03 * random());
        let data = recorded(&original, period, [("u_N", u), ("x_m", y)]);
        let budget = Budget::new(&|_| false);
        let (_, mut h) = with_a_jump(original, &data, &budget, "parameter:b");
        take_intervals(&mut h);
        let shape = h.effects[0].moments().next().unwrap();
        let profile = Profile::of(&h.base, shape).unwrap();
        let within = profile.at(&[profile.here])[0] + QUANTILE.powi(2) * h.base.variance();
        let around = profile.around(profile.here, period, BESIDE);
        let told = h.base.intervals().into_iter().find(|i| i.name == shape.name).unwrap().ends.unwrap();
        let refuted = |at: &&(f64, f64)| told[0] < at.0 && at.0 < told[1] && at.1 > within;
        assert!(around.iter().any(|at| refuted(&at)), "one stretch of moments");
        assert!(around.iter().all(|(t, e)| *e > within || (told[0]..=told[1]).contains(t)));
    }
}
