//! The plays that the laws of an actuator's hysteresis are sums of, in each of the forms that such a law is fitted in.
//!
//! The plain form is a density that falls off with the half-width, half of a normal one over twelve cells: two numbers follow a smooth loop, and
//! there is no weight that the recording leaves open. A faint loop is seen by one column for each width, where a column for each of three plays
//! would have to explain more than twice as much. Where the evidence asks for it there are
//! - three plays with half-widths that are shares of the input's reach;
//! - six of them;
//! - six whose half-widths are the multiples of one spacing that is fitted too. The initial loading curve of such an operator is made of
//!   straight pieces, and on a sharp recording pieces that end at the wrong places show;
//! - a density, or six plays, that an input before the recording has moved: all of them by one value from which it came, as after a
//!   monotonic way (a recording about an operating point that was approached from rest begins so).
//!
//! Reference: K. Kuhnen, Eur. J. Control 9 (2003) 407-418 (equidistant thresholds); M. Al Janaideh, S. Rakheja, C.-Y. Su, Mechatronics 19
//! (2009) 656-670 (densities that fall off); E. Della Torre, Magnetic Hysteresis, IEEE Press (1999) (normal ones).

use crate::mechanism::path::with_duration;
use crate::mechanism::play::moved_play;
use crate::mechanism::{Form, Grid, Law, Purpose};

/// Half-widths of a few plays as shares of half the input's range.
const RADII: [&[f64]; 2] = [&[0.1, 0.3, 0.6], &[0.06, 0.15, 0.28, 0.42, 0.58, 0.78]];
/// Plays with a spacing of their own.
const SPACED: usize = 6;
/// Cells of a density.
const CELLS: usize = 12;

/// The cells of a density of width `r_d` about a middle half-width or about zero, as text: the share of each and its half-width.
pub(super) fn density(middle: Option<&str>) -> impl Iterator<Item = (String, String)> {
    (0..CELLS).map(move |i| {
        let radius = format!("{i}.5*r_w");
        let away = middle.map_or_else(|| radius.clone(), |middle| format!("({radius} - {middle})"));
        (format!("exp(-({away}/r_d)^2)/{CELLS}"), radius)
    })
}

/// A law of such cells with their widths.
pub(super) fn widths(law: Law) -> Law {
    law.shape("r_d", "u", Grid::Reach("u", vec![0.2, 0.5, 1.0])).constant(
        "r_w",
        "u",
        Grid::Reach("u", vec![1.0 / CELLS as f64]),
    )
}

/// The plays of a law in one form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Plays(pub Purpose);

impl Plays {
    /// The half-widths of plays that stand where the input's reach says.
    fn radii(self) -> &'static [f64] {
        if self.0 == Purpose::Form(Form::Few) { RADII[0] } else { RADII[1] }
    }

    /// What each play weighs, and its half-width.
    fn terms(self) -> Vec<(String, String)> {
        match self.0 {
            Purpose::Form(Form::Spaced) => (1..=SPACED).map(|i| (format!("p_{i}"), format!("{i}*r_s"))).collect(),
            Purpose::Form(Form::Few | Form::Finer | Form::FinerUnsettled) => {
                (1..=self.radii().len()).map(|i| (format!("p_{i}"), format!("r_{i}"))).collect()
            }
            _ => density(None).map(|(share, radius)| (format!("p*{share}"), radius)).collect(),
        }
    }

    /// The plays of a law that always came from 0.
    pub fn settled(purpose: Purpose) -> Self {
        Self(match purpose {
            Purpose::Form(Form::Unsettled) => Purpose::Form(Form::Other),
            Purpose::Form(Form::FinerUnsettled) => Purpose::Form(Form::Finer),
            other => other,
        })
    }

    /// Whether the plays remember what was before the recording.
    fn unsettled(self) -> bool {
        matches!(self.0, Purpose::Form(Form::Unsettled | Form::FinerUnsettled))
    }

    /// A play of this half-width, as text: where an input that came from 0, or from `u_s`, has moved it by the first sample.
    pub fn play(self, radius: &str) -> String {
        if self.unsettled() { moved_play("u", radius, "u_s") } else { format!("play(u, {radius})") }
    }

    /// A law of these plays with what moved them before the recording.
    pub fn moved(self, law: Law) -> Law {
        if self.unsettled() {
            with_duration(law).shape("u_s", "u", Grid::Values(vec![-2.0, 0.0, 2.0])).within(-10.0, 10.0)
        } else {
            law
        }
    }

    /// The input and, for each play, its weight times what `play` makes of its half-width less the input: for large swings the gain stays
    /// what it was.
    pub fn sum(self, play: impl Fn(&str) -> String) -> String {
        let part = |(weight, radius): (String, String)| format!(" + {weight}*({} - u)", play(&radius));
        format!("u{}", self.terms().into_iter().map(part).collect::<String>())
    }

    /// [`Plays::sum`] of the plays as they are.
    pub fn simply(self) -> String {
        self.sum(|r| self.play(r))
    }

    /// A law that puts this text in the place of the input, with the parameters that [`Plays::sum`] names.
    pub fn law(self, text: impl Into<String>) -> Law {
        let law = Law::replace(text);
        let weight = |law: Law, i: usize| law.amplitude(format!("p_{i}"), "1", -0.2, 1.0);
        let law = match self.0 {
            Purpose::Form(Form::Spaced) => (1..=SPACED).fold(law, weight).shape(
                "r_s",
                "u",
                Grid::Reach("u", [0.8, 1.0, 1.2].map(|s| s / (SPACED + 1) as f64).to_vec()),
            ),
            Purpose::Form(Form::Few | Form::Finer | Form::FinerUnsettled) => {
                self.radii().iter().zip(1..).fold(law, |law, (share, i)| {
                    weight(law, i).constant(format!("r_{i}"), "u", Grid::Reach("u", vec![*share]))
                })
            }
            _ => widths(law.amplitude("p", "1", -0.2, 5.0)),
        };
        let law = self.moved(law);
        let weights: Vec<String> = self.terms().into_iter().map(|(weight, _)| weight).collect();
        law.report("share", "1", weights.join(" + "))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::collections::BTreeMap;

    use hysid_plant::{Compiled, Direction, Drive, Run, Simulation};

    use super::*;
    use crate::mechanism::{Signals, mechanism};
    use crate::slot::Structure;

    /// What a law of plays answers to an input that is held from sample to sample, with its parameters as given.
    fn answer(purpose: Purpose, values: &[(&str, f64)], input: &[f64]) -> (Vec<f64>, Simulation) {
        let text = "title = \"Actuator\"\n[time]\nperiod_s = 0.01\n[inputs]\nu = \"u_V\"\n[parameters]\n\
                    g = { value = 1.0, min = 0.1, max = 10.0, unit = \"um/V\" }\n[outputs]\ny_um = \"g*u\"\n";
        let simulation = Simulation::parse(text, "actuator.sim.toml").unwrap();
        let law = mechanism("prandtl_ishlinskii").unwrap();
        let slot = law.slots(&Structure::of(&simulation)).swap_remove(0);
        let signals = Signals::new(0.01, 0.0, BTreeMap::from([("u".to_owned(), vec![-10.0, 10.0, -10.0, 10.0])]));
        let mut written = law.rewrite(&simulation, &slot, &signals, purpose).unwrap().simulation;
        for (name, value) in values {
            written.parameter_mut(name).unwrap_or_else(|| panic!("{purpose:?} has no {name}")).value = *value;
        }
        (response(&written, input), written)
    }

    /// The output of a simulation under an input.
    pub fn response(simulation: &Simulation, input: &[f64]) -> Vec<f64> {
        let compiled = Compiled::new(simulation).unwrap();
        let drive = Drive::new(0.0, 0.01, input.len(), vec![input.to_vec()]).unwrap();
        compiled.simulate(&Run::new(&drive, &compiled.theta())).outputs.swap_remove(0)
    }

    fn values(purpose: Purpose) -> Vec<(&'static str, f64)> {
        let six = [("p_1", 0.03), ("p_2", 0.08), ("p_3", 0.02), ("p_4", 0.06), ("p_5", 0.01), ("p_6", 0.05)];
        match purpose {
            Purpose::Form(Form::Few) => six[..3].to_vec(),
            Purpose::Form(Form::Finer | Form::FinerUnsettled) => six.to_vec(),
            Purpose::Form(Form::Spaced) => six.into_iter().chain([("r_s", 1.3)]).collect(),
            _ => vec![("p", 0.4), ("r_d", 4.0)],
        }
    }

    /// Both branches of a loop of plays are the initial loading curve, doubled (Masing's rule).
    #[test]
    fn a_loop_is_twice_its_initial_loading_curve() {
        let steps = 400;
        let up: Vec<f64> = (0..=steps).map(|i| 9.0 * f64::from(i) / f64::from(steps)).collect();
        let down: Vec<f64> = up.iter().map(|u| 9.0 - 2.0 * u).collect();
        let back: Vec<f64> = down.iter().map(|u| -u).collect();
        for purpose in Purpose::FITTED {
            let (y, _) = answer(purpose, &values(purpose), &[&up[..], &down[..], &back[..]].concat());
            let (loading, rest) = y.split_at(up.len());
            let (falling, rising) = rest.split_at(up.len());
            for (i, first) in loading.iter().enumerate() {
                let (fall, rise) = (falling[0] - falling[i], rising[i] - rising[0]);
                assert!((fall - 2.0 * first).abs() < 1e-9, "{purpose:?} at {}: {fall} for {first}", down[i]);
                assert!((rise - fall).abs() < 1e-9, "{purpose:?}: the loop is not closed");
            }
            assert!((rising[steps as usize] - falling[0]).abs() < 1e-9, "{purpose:?}: the loop is not closed");
        }
    }

    /// Plays that came from somewhere answer as those that came from 0 do to an input that is counted from there.
    #[test]
    fn what_was_before_the_recording_is_one_value() {
        let input: Vec<f64> = (0..200).map(|i| 5.0 + 2.0 * (0.1 * f64::from(i)).sin() + 0.01 * f64::from(i)).collect();
        for (settled, unsettled) in [
            (Purpose::Refit, Purpose::Form(Form::Unsettled)),
            (Purpose::Form(Form::Finer), Purpose::Form(Form::FinerUnsettled)),
        ] {
            for from in [-3.0, 0.0, 3.0, 5.0, 6.5, 20.0] {
                let mut set = values(unsettled);
                set.push(("u_s", from));
                let (found, _) = answer(unsettled, &set, &input);
                let counted: Vec<f64> = input.iter().map(|u| u - from).collect();
                let (expected, _) = answer(settled, &values(settled), &counted);
                let apart = found.iter().zip(&expected).map(|(a, b)| (a - b - from).abs()).fold(0.0, f64::max);
                assert!(apart < 1e-9, "{unsettled:?} from {from}: {apart}");
            }
        }
    }

    /// The initial loading curve of a normal density is its integral, taken twice: twelve cells give it to a thousandth of the reach.
    #[test]
    fn twelve_cells_are_a_density() {
        let (share, width, reach) = (0.4, 4.0, 10.0);
        let up: Vec<f64> = (0..=100).map(|i| 0.1 * f64::from(i)).collect();
        let (y, _) = answer(Purpose::Refit, &[("p", share), ("r_d", width)], &up);
        let fine = 20_000;
        let cell = reach / f64::from(fine);
        for (u, y) in up.iter().zip(y) {
            let lost = |i: i32| {
                let r = cell * (f64::from(i) + 0.5);
                (-(r / width).powi(2)).exp() * cell / reach * r.min(*u)
            };
            let expected = u - share * (0..fine).map(lost).sum::<f64>();
            assert!((y - expected).abs() < 1e-3 * reach, "{y} for {expected} at {u}");
        }
    }

    /// The derivative by a half-width that is fitted is that of the response.
    #[test]
    fn the_response_moves_with_a_fitted_half_width() {
        let input: Vec<f64> =
            (0..300).map(|i| 9.0 * (0.05 * f64::from(i)).sin() * (0.013 * f64::from(i)).cos()).collect();
        for (purpose, name, at) in [(Purpose::Refit, "r_d", 4.0), (Purpose::Form(Form::Spaced), "r_s", 1.3)] {
            let shifted = |by: f64| -> Vec<f64> {
                let mut set = values(purpose);
                set.iter_mut().filter(|(n, _)| *n == name).for_each(|(_, v)| *v = at + by);
                answer(purpose, &set, &input).0
            };
            let (_, written) = answer(purpose, &values(purpose), &input);
            let compiled = Compiled::new(&written).unwrap();
            let drive = Drive::new(0.0, 0.01, input.len(), vec![input.clone()]).unwrap();
            let direction = Direction::Parameter(compiled.parameter_index(name).unwrap());
            let theta = compiled.theta();
            let tangents = compiled.sensitivities(&Run::new(&drive, &theta), &[direction]).tangents;
            let step = 1e-6;
            let numeric = shifted(step).into_iter().zip(shifted(-step)).map(|(a, b)| (a - b) / (2.0 * step));
            let wrong = numeric.zip(&tangents[0][0]).filter(|(n, t)| (n - *t).abs() > 1e-4).count();
            // At a knee the two sides differ.
            assert!(wrong <= input.len() / 50, "{purpose:?}: {wrong} samples");
        }
    }
}
