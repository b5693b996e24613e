//! The signature of a correction: what the families of generic signals say of memory, rate, symmetry and side.

use super::shapes::Kind;
use super::terms::Term;
use super::view::View;
use crate::evidence::{Whitener, norm2};
use crate::file::SignatureRecord;
use crate::model::base::Base;

/// The signature: which families of terms see the residual.
pub fn signature(
    base: &Base<'_>,
    terms: &[Term],
    noise: &Whitener,
    chosen: &[usize],
    coefficients: &[f64],
) -> SignatureRecord {
    let view = View::new(base, noise);
    let family = |wanted: &dyn Fn(&Term) -> bool| -> f64 {
        let columns: Vec<&[f64]> = terms.iter().filter(|t| wanted(t)).map(|t| t.column.as_slice()).collect();
        view.score(&columns)
    };
    let plant = |t: &Term| t.side == "plant";
    // Hundreds of columns are made orthogonal for each.
    let (fixed, (play, lag)) = rayon::join(
        || family(&|t| plant(t) && matches!(t.kind, Kind::Odd | Kind::Even)),
        || (family(&|t| t.kind == Kind::Play), family(&|t| plant(t) && t.kind == Kind::Lag)),
    );
    let memory = if play.max(lag) <= fixed + 6.0 {
        "none"
    } else if play >= lag {
        "rate_independent"
    } else {
        "rate_dependent"
    };
    // Of what the correction is made of: all functions of the time together see more than any law.
    let of_time = |t: &Term| t.kind == Kind::Time;
    let made_of =
        |side: &str| chosen.iter().any(|&i| if of_time(&terms[i]) { side == "time" } else { terms[i].side == side });
    let sides: Vec<&str> = ["plant", "input", "output", "time"].into_iter().filter(|side| made_of(side)).collect();
    let sees = |side: &str| match side {
        "time" => family(&of_time),
        _ => family(&|t| t.side == side && !of_time(t)),
    };
    let side = match sides[..] {
        [only] => only,
        _ => {
            let scores = sides.iter().map(|side| (*side, sees(side)));
            scores.fold(("plant", f64::NEG_INFINITY), |best, x| if x.1 > best.1 { x } else { best }).0
        }
    };
    let energy = |wanted: &dyn Fn(Kind) -> bool| -> f64 {
        chosen
            .iter()
            .zip(coefficients)
            .filter(|(i, _)| wanted(terms[**i].kind))
            .map(|(i, c)| c * c * norm2(&terms[*i].column))
            .sum()
    };
    let (odd, even) = (energy(&|k| k != Kind::Even), energy(&|k| k == Kind::Even));
    let symmetry = if odd > 9.0 * even {
        "odd"
    } else if even > 9.0 * odd {
        "even"
    } else {
        "mixed"
    };
    SignatureRecord {
        memory: memory.into(),
        rate_dependent: memory == "rate_dependent",
        symmetry: symmetry.into(),
        side: side.into(),
    }
}
