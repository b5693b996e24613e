//! Words and numbers as people read them.

use hysid_diagnose::answer::picture::Picture;
use hysid_diagnose::file::{DiagnosisFile, VerdictKind};

/// An identifier of the file format as words.
pub(super) fn plain(identifier: &str) -> String {
    identifier.replace('_', " ")
}

/// Whether the augmented simulation is worse on the hold-out than the simulation as it is.
fn is_refuted(file: &DiagnosisFile) -> bool {
    file.fit.iter().any(|f| f.refuted().is_some())
}

/// The verdict as a headline.
pub(super) fn headline(file: &DiagnosisFile, picture: &Picture) -> String {
    let mechanisms: Vec<String> = file.effects.iter().map(|e| plain(&e.mechanism)).collect();
    let families: Vec<String> = file.effects.iter().map(|e| plain(&e.family)).collect();
    let refuted = if is_refuted(file) { ", by this recording; the hold-out does not bear it out" } else { "" };
    match file.verdict {
        VerdictKind::NoSignificantMismatch if !picture.unexplained().is_empty() => {
            "The simulation does not follow the recording, and nothing tells what is missing".into()
        }
        VerdictKind::NoSignificantMismatch => "No significant mismatch".into(),
        VerdictKind::Named => format!("Missing: {}{refuted}", mechanisms.join(" and ")),
        VerdictKind::Family => format!("Missing: something of the family {}{refuted}", families.join(" and ")),
        VerdictKind::Ambiguous => "Something is missing, and this recording cannot tell what".into(),
        VerdictKind::NotInCatalogue => "Something is missing that the catalogue does not hold".into(),
    }
}

/// A slot of the file format as words.
pub(super) fn place(slot: &str) -> String {
    match slot.split_once(':') {
        Some(("input", name)) => format!("the input {name}"),
        Some(("state", name)) => format!("the equation of {name}"),
        Some(("output", name)) => format!("the output {name}"),
        Some(("parameter", name)) => format!("the parameter {name}"),
        _ => plain(slot),
    }
}

/// A sentence of the file with the identifiers that the file names in words.
pub(super) fn told(text: &str, file: &DiagnosisFile) -> String {
    let effects = file.effects.iter().map(|e| (&e.mechanism, &e.family, &e.slot));
    let rivals = file.alternatives.iter().map(|a| (&a.mechanism, &a.family, &a.slot));
    effects.chain(rivals).fold(text.to_owned(), |text, (mechanism, family, slot)| {
        text.replace(mechanism.as_str(), &plain(mechanism))
            .replace(family.as_str(), &plain(family))
            .replace(&format!("at {slot} ("), &format!("at {} (", place(slot)))
    })
}

/// What an engineer does with this verdict.
pub(super) fn next_step(file: &DiagnosisFile, picture: &Picture) -> &'static str {
    match file.verdict {
        VerdictKind::NoSignificantMismatch if !picture.unexplained().is_empty() => {
            "Do not keep this simulation: it does not follow the recording. Look whether the columns, the units and the input are those that it is meant for, and whether the input that moves this machine was recorded."
        }
        VerdictKind::NoSignificantMismatch if file.fit.iter().any(|f| f.outdone().is_some()) => {
            "Do not trust this verdict: a model without physics predicts the hold-out far better than the simulation. Look at the residual below, and record the same input twice: what repeats is no noise."
        }
        VerdictKind::NoSignificantMismatch => {
            "Nothing needs to be added: keep the simulation with the recalibrated parameters below. An effect can still be hidden where it is smaller than the recording would have shown; see the table."
        }
        _ if is_refuted(file) => {
            "Do not use augmented.sim.toml beyond the recordings that it was fitted to: on the hold-out it is worse than the simulation as it is. Look at the residual there, and whether what is missing acts in both recordings."
        }
        VerdictKind::Named => {
            "Use augmented.sim.toml: it is the simulation with the effect in it, calibrated. Check that its parameters are plausible for your machine."
        }
        VerdictKind::Family => {
            "The kind of effect is certain, its exact law is not. augmented.sim.toml holds the likeliest law; on recordings like these its siblings would do as well."
        }
        VerdictKind::Ambiguous => {
            if file.experiment.is_some() {
                "Do not take any of these for the physics yet: an augmented simulation, where one is written, predicts recordings like these. Record again in the way proposed here, and diagnose both recordings together."
            } else {
                "Do not take any of these for the physics yet: an augmented simulation, where one is written, predicts recordings like these. Another recording, of larger motion or in another band, may tell more; diagnose both together."
            }
        }
        VerdictKind::NotInCatalogue if file.fit.iter().all(|f| f.ratio.is_none()) => {
            "Look for physics at the place named below. No simulation is written: nothing that was found can be trusted on another recording."
        }
        VerdictKind::NotInCatalogue => {
            "Look for physics at the place named below. The correction predicts better than the simulation alone, but do not use it outside the range of the recordings."
        }
    }
}
