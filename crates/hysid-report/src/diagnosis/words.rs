//! Words and numbers as people read them.

use hysid_diagnose::file::{DiagnosisFile, VerdictKind};

/// An identifier of the file format as words.
pub(super) fn plain(identifier: &str) -> String {
    identifier.replace('_', " ")
}

/// The verdict as a headline.
pub(super) fn headline(file: &DiagnosisFile) -> String {
    let mechanisms: Vec<String> = file.effects.iter().map(|e| plain(&e.mechanism)).collect();
    let families: Vec<String> = file.effects.iter().map(|e| plain(&e.family)).collect();
    match file.verdict {
        VerdictKind::NoSignificantMismatch => "No significant mismatch".into(),
        VerdictKind::Named => format!("Missing: {}", mechanisms.join(" and ")),
        VerdictKind::Family => format!("Missing: something of the family {}", families.join(" and ")),
        VerdictKind::Ambiguous => "Something is missing, and this recording cannot tell what".into(),
        VerdictKind::NotInCatalogue => "Something is missing that the catalogue does not hold".into(),
    }
}
