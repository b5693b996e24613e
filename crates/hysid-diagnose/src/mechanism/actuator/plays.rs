//! The plays that the laws of an actuator's hysteresis are sums of, in each of the forms that such a law is fitted in.
//!
//! Three plays are what most recordings tell. More are taken where the evidence asks for them:
//! - a density that falls off with the half-width, half of a normal one over twelve cells: two numbers follow a smooth loop, and there is no
//!   weight that the recording leaves open;
//! - six plays with half-widths that are shares of the input's reach;
//! - six whose half-widths are the multiples of one spacing that is fitted too. The initial loading curve of such an operator is made of
//!   straight pieces, and on a sharp recording pieces that end at the wrong places show.
//!
//! Reference: K. Kuhnen, Eur. J. Control 9 (2003) 407-418 (equidistant thresholds); M. Al Janaideh, S. Rakheja, C.-Y. Su, Mechatronics 19
//! (2009) 656-670 (densities that fall off); E. Della Torre, Magnetic Hysteresis, IEEE Press (1999) (normal ones).

use crate::mechanism::{Form, Grid, Law, Purpose};

/// Half-widths of a few plays as shares of half the input's range.
const RADII: [&[f64]; 2] = [&[0.1, 0.3, 0.6], &[0.06, 0.15, 0.28, 0.42, 0.58, 0.78]];
/// Plays with a spacing of their own.
const SPACED: usize = 6;
/// Cells of a density.
const CELLS: usize = 12;

/// The plays of a law in one form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Plays(pub Purpose);

impl Plays {
    /// The half-widths of plays that stand where the input's reach says.
    fn radii(self) -> &'static [f64] {
        if self.0 == Purpose::Form(Form::Finer) { RADII[1] } else { RADII[0] }
    }

    /// What each play weighs, and its half-width.
    fn terms(self) -> Vec<(String, String)> {
        match self.0 {
            Purpose::Form(Form::Smooth) => (0..CELLS)
                .map(|i| {
                    let radius = format!("{i}.5*r_w");
                    (format!("p/{CELLS}*exp(-({radius}/r_d)^2)"), radius)
                })
                .collect(),
            Purpose::Form(Form::Spaced) => (1..=SPACED).map(|i| (format!("p_{i}"), format!("{i}*r_s"))).collect(),
            Purpose::Screening | Purpose::Refit | Purpose::Form(Form::Finer) => {
                (1..=self.radii().len()).map(|i| (format!("p_{i}"), format!("r_{i}"))).collect()
            }
        }
    }

    /// The input and, for each play, its weight times what `play` makes of its half-width less the input: for large swings the gain stays
    /// what it was.
    pub fn sum(self, play: impl Fn(&str) -> String) -> String {
        let part = |(weight, radius): (String, String)| format!(" + {weight}*({} - u)", play(&radius));
        format!("u{}", self.terms().into_iter().map(part).collect::<String>())
    }

    /// A law that puts this text in the place of the input, with the parameters that [`Plays::sum`] names.
    pub fn law(self, text: impl Into<String>) -> Law {
        let law = Law::replace(text);
        let weight = |law: Law, i: usize| law.amplitude(format!("p_{i}"), "1", -0.2, 1.0);
        let law = match self.0 {
            Purpose::Form(Form::Smooth) => law
                .amplitude("p", "1", -0.2, 5.0)
                .shape("r_d", "u", Grid::Reach("u", vec![0.2, 0.5, 1.0]))
                .constant("r_w", "u", Grid::Reach("u", vec![1.0 / CELLS as f64])),
            Purpose::Form(Form::Spaced) => (1..=SPACED)
                .fold(law, weight)
                .shape("r_s", "u", Grid::Reach("u", [0.8, 1.0, 1.2].map(|s| s / (SPACED + 1) as f64).to_vec())),
            Purpose::Screening | Purpose::Refit | Purpose::Form(Form::Finer) => {
                self.radii().iter().zip(1..).fold(law, |law, (share, i)| {
                    weight(law, i).constant(format!("r_{i}"), "u", Grid::Reach("u", vec![*share]))
                })
            }
        };
        let weights: Vec<String> = self.terms().into_iter().map(|(weight, _)| weight).collect();
        law.report("share", "1", weights.join(" + "))
    }
}
