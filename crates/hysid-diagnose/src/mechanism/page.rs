//! `docs/catalogue.md`, printed from the catalogue.

use std::fmt::Write;

use super::conformance::specimens;
use super::{Change, Family, Grid, Law, Mechanism, Purpose, Role, catalogue};
use crate::slot::{Place, Slot, Structure};

/// The first half-width of a density's plays, by which its terms are known.
const FIRST_CELL: &str = "0.5*r_w";

/// A law's text with the terms of a density told once.
fn folded(text: &str) -> String {
    let mut left = text;
    let mut out = String::new();
    while let Some(at) = left.find(FIRST_CELL) {
        let start = left[..at].rfind(" + ").map_or(0, |i| i + 3);
        let length = left[start..].find(" + ").unwrap_or(left.len() - start);
        let term = &left[start..start + length];
        let (mut end, mut last) = (start + length, 0);
        loop {
            let next = format!(" + {}", term.replace(FIRST_CELL, &format!("{}.5*r_w", last + 1)));
            if !left[end..].starts_with(&next) {
                break;
            }
            end += next.len();
            last += 1;
        }
        let _ = write!(out, "{}sum({}; i = 0.5 .. {last}.5)", &left[..start], term.replace(FIRST_CELL, "i*r_w"));
        left = &left[end..];
    }
    out + left
}

fn law_text(law: &Law) -> String {
    match &law.change {
        Change::Force(text) => format!("resisting force `{text}`"),
        Change::Drive(text) => format!("external force `{text}`"),
        Change::Outflow(text) => format!("outflow `{text}`"),
        Change::Replace(text) => format!("becomes `{}`", folded(text)),
        Change::Outputs(texts) => format!("added to the outputs `{}`", texts.join("`, `")),
        Change::Inertia { force, mass } => format!("further mass `{mass}` with the force `{force}`"),
        Change::Separation { at, by } => {
            format!("the simulation's own separation becomes `{by}`, where `ahead` is the separation at `{at}`")
        }
    }
}

fn place_name(place: Place) -> &'static str {
    match place {
        Place::Input => "input",
        Place::Prescribed => "prescribed motion",
        Place::Between => "inside a cascade",
        Place::Command => "command of a controller",
        Place::Winding => "winding",
        Place::Force => "force on a moving part",
        Place::Connection => "force between two parts",
        Place::ForceLaw => "static force law",
        Place::Curve => "curve of a static relation",
        Place::Loop => "loop of the simulation",
        Place::Plays => "plays of the simulation",
        Place::Store => "store",
        Place::Circuit => "first-order electrical state",
        Place::Sensor => "sensor",
        Place::Sensors => "sensors of one part",
        Place::Parameter => "parameter",
        Place::Disturbance => "disturbance",
    }
}

fn parameters(law: &Law) -> String {
    let described = law.parameters.iter().map(|p| {
        let what = match &p.role {
            Role::Amplitude => match p.range {
                Some((low, high)) => format!("{low} to {high}"),
                None => "any".to_owned(),
            },
            Role::Shape(grid) | Role::Constant(grid) => match grid {
                Grid::Values(v) => format!("{} values", v.len()),
                Grid::Reach(s, v) => format!("{} shares of half the range of {s}", v.len()),
                Grid::Turns(s, v) => {
                    format!("{} shares of half the range of {s}, lines of the residual over {s}", v.len())
                }
                Grid::Waves(s, v, _) => format!("{} values, and one so small that a wave over {s} is a power", v.len()),
                Grid::Quantiles(s, v) => format!("{} quantiles of the size of {s}", v.len()),
                Grid::SignedQuantiles(s, v) => format!("{} quantiles of {s}", v.len()),
                Grid::Times(n) => format!("{n} moments"),
                Grid::Band(n) => format!("{n} frequencies of the excited band, peaks of the residual"),
                Grid::Memory(n) => format!("{n} time constants"),
                Grid::Peaks(n) => format!("peaks of the residual, else {n} frequencies"),
                Grid::Resolution => "the recorded steps".to_owned(),
            },
        };
        format!("`{}` [{}]: {what}", p.name, p.measure)
    });
    described.collect::<Vec<_>>().join("; ")
}

/// The page as Markdown.
pub fn catalogue_page() -> String {
    let mut page = String::from(
        "# The catalogue of mechanisms\n\n\
         Printed from the code (`crates/hysid-diagnose/src/mechanism`); a test holds the two equal. Symbols of a law: `x`, `v` displacement and\n\
         velocity at the slot, `u` input, `y` output, `s` what a store holds, `p` the parameter, `F` the size of the forces, `k`, `m` the\n\
         simulation's own stiffness and mass there, `t` time, `T` duration, `h` sampling period. In brackets stands what a parameter is measured\n\
         in: its unit, and its natural size on a recording. `w` is the weight of a form that exists for screening only. Where an input `control`\n\
         controls the simulation's own damping (the voltage of a magnetorheological damper), the forces of `dry_friction`, `presliding` and\n\
         `hysteretic_spring` are multiplied by `1 + b_c*control`. Laws are shown in their plain form; what not every form of a law tells stands in\n\
         square brackets in its sentence, where `{|F|}` is a size and `{F:grows/falls}` the word for a sign. `sum(...; i = 0.5 .. 11.5)` stands for one term for each `i` in steps of 1.\n",
    );
    let structures: Vec<Structure> = specimens().iter().map(Structure::of).collect();
    for family in Family::ALL {
        let members: Vec<&Mechanism> = catalogue().iter().copied().filter(|m| m.family == *family).collect();
        if members.is_empty() {
            continue;
        }
        let _ = write!(page, "\n## {family}\n");
        for mechanism in members {
            entry(&mut page, mechanism, &structures);
        }
    }
    page
}

/// One form of a law, with the form that it is screened in.
fn form(refit: &Law, screening: &Law) -> String {
    let mut text = law_text(refit);
    if screening.change != refit.change {
        let _ = write!(text, "; screened as {}", law_text(screening));
    }
    for state in &refit.states {
        let _ = write!(text, "; state {}' = `{}`", state.name, state.derivative);
    }
    let _ = write!(text, "\n  - parameters: {}", parameters(refit));
    text
}

fn entry(page: &mut String, mechanism: &Mechanism, structures: &[Structure]) {
    let _ = write!(page, "\n### {}\n\n{}\n\n", mechanism.id, mechanism.signature);
    let mut told: Vec<String> = Vec::new();
    for place in mechanism.places {
        let slots: Vec<Slot> =
            structures.iter().flat_map(|s| mechanism.slots(s)).filter(|s| s.place == *place).collect();
        let Some(first) = slots.first() else { continue };
        let refitted = |slot: &Slot| mechanism.law_at(slot, Purpose::Refit);
        // A simulation that has the separation itself takes another law.
        let stalling = slots.iter().find(|s| s.separation().is_some() && refitted(s).change != refitted(first).change);
        for slot in std::iter::once(first).chain(stalling) {
            let text = form(&refitted(slot), &mechanism.law_at(slot, Purpose::Screening));
            match told.iter().position(|t| t.ends_with(&text)) {
                Some(at) => {
                    if let Some(t) = told.get_mut(at) {
                        *t = format!("{}, {t}", place_name(*place));
                    }
                }
                None => told.push(format!("{}: {text}", place_name(*place))),
            }
        }
    }
    for text in told {
        let _ = writeln!(page, "- {text}");
    }
    let list = |names: &[&str]| names.join(", ");
    if !mechanism.contains.is_empty() {
        let _ = writeln!(page, "- contains: {}", list(mechanism.contains));
    }
    if !mechanism.confusable.is_empty() {
        let _ = writeln!(page, "- mistaken for: {}", list(mechanism.confusable));
    }
    if !mechanism.needs.is_empty() {
        let needs: Vec<String> = mechanism.needs.iter().map(super::Need::describe).collect();
        let _ = writeln!(page, "- needs: {}", needs.join("; "));
    }
    let _ = writeln!(page, "- told as: {}", mechanism.sentence);
    let _ = writeln!(page, "- {}", mechanism.reference);
}

#[cfg(test)]
mod tests {
    use super::folded;

    #[test]
    fn terms_of_a_density_are_told_once() {
        let check = |text: &str, expected: &str| assert_eq!(folded(text), expected);
        check("u + p*(play(u, r_1) - u)", "u + p*(play(u, r_1) - u)");
        let three = "p*f(0.5*r_w) + p*f(1.5*r_w) + p*f(2.5*r_w)";
        check(&format!("u + {three} + a*u"), "u + sum(p*f(i*r_w); i = 0.5 .. 2.5) + a*u");
        let twice = "u + sum(p*f(i*r_w); i = 0.5 .. 2.5) + b*max(u + sum(p*f(i*r_w); i = 0.5 .. 1.5), 0)";
        check(&format!("u + {three} + b*max(u + p*f(0.5*r_w) + p*f(1.5*r_w), 0)"), twice);
    }

    #[test]
    fn the_page_in_the_documents_is_this_one() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/catalogue.md");
        let written = std::fs::read_to_string(path).unwrap_or_default();
        assert!(written == super::catalogue_page(), "docs/catalogue.md is stale: run `cargo xtask catalogue page`");
    }
}
