//! The page of a diagnosis holds what the verdict says, for every kind of verdict.

use std::collections::BTreeMap;

use hysid_diagnose::answer::picture::{MapPicture, Picture, RecordPicture, Role};
use hysid_diagnose::file::*;
use hysid_report::Provenance;
use hysid_report::diagnosis::page;

fn file(verdict: VerdictKind) -> DiagnosisFile {
    let named = verdict != VerdictKind::NoSignificantMismatch;
    let effect = EffectRecord {
        mechanism: "coulomb_friction".into(),
        family: "dry_friction".into(),
        slot: "state:v".into(),
        probability: 0.97,
        family_probability: 0.99,
        support: 0.97,
        family_support: 0.99,
        concealment: Some(0.93),
        sentence: "Dry friction of about 20 N opposes the motion.".into(),
        parameters: vec![ParameterRecord {
            name: "F_c".into(),
            value: 20.3,
            low: Some(19.8),
            high: Some(20.9),
            unit: "N".into(),
        }],
    };
    DiagnosisFile {
        schema: SCHEMA.into(),
        verdict,
        summary: "What the verdict rests on.".into(),
        mismatch: MismatchRecord {
            p_value: Some(0.005),
            residual_rms: BTreeMap::new(),
            noise_rms: BTreeMap::new(),
            detectable: vec![DetectableRecord {
                mechanism: "cubic_stiffness".into(),
                slot: "state:v".into(),
                smallest: 0.12,
                unit: "N/m^3".into(),
            }],
        },
        location: named.then(|| LocationRecord {
            slot: "state:v".into(),
            block: "damping".into(),
            time_s: vec![[0.0, 12.4]],
            band_hz: vec![],
            region: "near velocity reversals".into(),
        }),
        effects: if named { vec![effect] } else { vec![] },
        alternatives: vec![],
        fit: vec![],
        remaining: None,
        correction: None,
        experiment: None,
        calibrated_parameters: vec![],
        notes: vec!["The recording has 2 gaps.".into()],
        seed: 7,
    }
}

fn picture() -> Picture {
    Picture {
        title: "Servo <axis>".into(),
        records: vec![RecordPicture {
            recording: "val.csv".into(),
            output: "q_m".into(),
            unit: "m".into(),
            role: Role::HoldOut,
            place: 0,
            samples: vec![0, 1, 2],
            scored: vec![true; 3],
            time_s: vec![0.0, 0.1, 0.2],
            measured: vec![0.0, 1.0, f64::NAN],
            before: vec![0.1, 0.8, 0.5],
            after: Some(vec![0.0, 1.01, 0.4]),
            noise_rms: 0.01,
            every: 1,
        }],
        maps: vec![MapPicture {
            output: "q_m".into(),
            x_label: "x (m)".into(),
            y_label: "v (m/s)".into(),
            x_edges: vec![0.0, 1.0],
            y_edges: vec![0.0, 1.0],
            before: vec![3.0],
            after: None,
        }],
        ..Picture::default()
    }
}

fn provenance() -> Provenance {
    Provenance { command: "hysid diagnose a.sim.toml".into(), version: "0.1.0".into() }
}

#[test]
fn every_verdict_has_its_headline() {
    let cases = [
        (VerdictKind::NoSignificantMismatch, "No significant mismatch"),
        (VerdictKind::Named, "Missing: coulomb friction"),
        (VerdictKind::Family, "family dry friction"),
        (VerdictKind::Ambiguous, "cannot tell what"),
        (VerdictKind::NotInCatalogue, "the catalogue does not hold"),
    ];
    for (verdict, expected) in cases {
        let html = page(&file(verdict), &picture(), &provenance());
        for part in [
            expected,
            "Servo &lt;axis&gt;",
            "hold-out, never used",
            "seed 7",
            "The recording has 2 gaps.",
            "0.12",
            "What to do next",
        ] {
            assert!(html.contains(part), "{verdict:?}: the page does not say `{part}`");
        }
        assert_eq!(html.contains("19.8 to 20.9"), verdict != VerdictKind::NoSignificantMismatch);
    }
}

#[test]
fn what_the_catalogue_does_not_hold_is_told_before_what_comes_nearest() {
    let signature =
        SignatureRecord { memory: "none".into(), rate_dependent: false, symmetry: "even".into(), side: "plant".into() };
    let term = |term: &str, slot: &str| TermRecord { term: term.into(), slot: slot.into(), coefficient: 0.1, err: 0.4 };
    let terms = vec![term("w*b", "state:a"), term("w*a", "state:b")];
    let correction = CorrectionRecord { slot: "state:a".into(), terms, signature, ratio: Some(0.3) };
    let of = |verdict: VerdictKind| {
        let html =
            page(&DiagnosisFile { correction: Some(correction.clone()), ..file(verdict) }, &picture(), &provenance());
        let place = |text: &str| html.find(text).unwrap_or_else(|| panic!("the page does not say `{text}`"));
        assert!(place("w*b") < place("state:b"), "each term has its place");
        (place("A sparse model"), place("Dry friction of about"), html.contains("probability of coulomb friction"))
    };
    let (correction, effect, told) = of(VerdictKind::NotInCatalogue);
    assert!(correction < effect && !told);
    let (correction, effect, told) = of(VerdictKind::Named);
    assert!(effect < correction && told);
}

#[test]
fn a_simulation_that_follows_nothing_is_told_so() {
    let mut lost = picture();
    lost.records[0].role = Role::Estimation;
    lost.records[0].before = vec![0.5; 3];
    let of = |picture: &Picture| page(&file(VerdictKind::NoSignificantMismatch), picture, &provenance());
    assert!(of(&lost).contains("does not follow the recording") && of(&lost).contains("Do not keep this simulation"));
    assert!(!of(&picture()).contains("does not follow the recording"));
}

#[test]
fn what_the_hold_out_refutes_is_not_recommended() {
    let of = |ratio: f64| {
        let mut file = file(VerdictKind::Named);
        file.fit.push(FitRecord {
            recording: "val.csv".into(),
            output: "q_m".into(),
            rmse_before: Some(1.0),
            rmse_after: Some(ratio),
            ratio: Some(ratio),
            ratio_low: Some(0.9 * ratio),
            ratio_high: Some(1.1 * ratio),
            rmse_black_box: None,
        });
        page(&file, &picture(), &provenance())
    };
    let (worse, better) = (of(1.5), of(0.5));
    for part in ["the hold-out does not bear it out", "Do not use augmented.sim.toml"] {
        assert!(worse.contains(part) && !better.contains(part), "{part}");
    }
    assert!(better.contains("Use augmented.sim.toml") && !worse.contains("Use augmented.sim.toml"));
}
