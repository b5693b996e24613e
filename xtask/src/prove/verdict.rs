//! What the program under test said, read from `diagnosis.json` without any of its own types.

use anyhow::Context;
use serde_json::Value;

/// An effect that was stated.
#[derive(Debug, Clone, Default)]
pub struct Stated {
    /// Mechanism.
    pub mechanism: String,
    /// Family.
    pub family: String,
    /// Slot.
    pub slot: String,
    /// Probability of the mechanism.
    pub probability: f64,
    /// Probability of the family (that of the mechanism where it is not given).
    pub family_probability: f64,
    /// Support of mechanism and family before recalibration (the probabilities where it is not given).
    pub support: (f64, f64),
    /// Name, value, low and high end of each parameter.
    pub parameters: Vec<(String, f64, f64, f64)>,
}

/// A rival that was stated.
#[derive(Debug, Clone, Default)]
pub struct Alternative {
    /// Mechanism.
    pub mechanism: String,
    /// Family.
    pub family: String,
    /// Its probability.
    pub probability: f64,
    /// Separation from the likeliest set.
    pub separation: Option<f64>,
}

/// The verdict.
#[derive(Debug, Clone, Default)]
pub struct Verdict {
    /// `named`, `family`, `ambiguous`, `not_in_catalogue` or `no_significant_mismatch`.
    pub kind: String,
    /// p-value of the mismatch test.
    pub p_value: Option<f64>,
    /// Effects, likeliest first.
    pub effects: Vec<Stated>,
    /// Rivals.
    pub alternatives: Vec<Alternative>,
    /// Sum of squared held-out errors before and after, by its own account.
    pub own_fit: Option<(f64, f64)>,
    /// Smallest held-out error of a black box over that after, by its own account.
    pub own_black_box: Option<f64>,
    /// Intervals of time where the mismatch is.
    pub time_s: Vec<[f64; 2]>,
    /// The proposed experiment.
    pub experiment: Option<Experiment>,
}

/// The proposed experiment.
#[derive(Debug, Clone, Default)]
pub struct Experiment {
    /// Shape of the input.
    pub shape: String,
    /// Level as a multiple of the recording's.
    pub level: f64,
    /// Band in Hz.
    pub band: [f64; 2],
    /// Expected squared distance in units of the noise.
    pub separation: f64,
    /// The mechanisms that it is to tell apart.
    pub between: Vec<String>,
}

impl Verdict {
    /// Reads the text of `diagnosis.json`.
    pub fn read(text: &str) -> anyhow::Result<Self> {
        let v: Value = serde_json::from_str(text).context("diagnosis.json is not JSON")?;
        let kind = v["verdict"].as_str().context("diagnosis.json has no verdict")?.to_string();
        let effects = list(&v["effects"]).iter().map(stated).collect();
        let alternatives = list(&v["alternatives"])
            .iter()
            .map(|a| Alternative {
                mechanism: word(&a["mechanism"]),
                family: word(&a["family"]),
                probability: a["probability"].as_f64().unwrap_or(0.0),
                separation: a["separation"].as_f64(),
            })
            .collect();
        let mut own_fit = None;
        let mut own_black_box = None;
        for f in list(&v["fit"]) {
            if let (Some(before), Some(after)) = (f["rmse_before"].as_f64(), f["rmse_after"].as_f64()) {
                let (b, a) = own_fit.unwrap_or((0.0, 0.0));
                own_fit = Some((b + before * before, a + after * after));
                if let Some(black) = f["rmse_black_box"].as_f64() {
                    own_black_box = Some(own_black_box.map_or(black / after, |least: f64| least.min(black / after)));
                }
            }
        }
        let time_s =
            list(&v["location"]["time_s"]).iter().filter_map(|i| Some([i[0].as_f64()?, i[1].as_f64()?])).collect();
        let e = &v["experiment"];
        let experiment = e["shape"].as_str().map(|shape| Experiment {
            shape: shape.to_string(),
            level: e["level"].as_f64().unwrap_or(1.0),
            band: [e["band_hz"][0].as_f64().unwrap_or(0.0), e["band_hz"][1].as_f64().unwrap_or(0.0)],
            separation: e["expected_separation"].as_f64().unwrap_or(0.0),
            between: list(&e["between"]).iter().flat_map(|set| names(&word(set))).collect(),
        });
        Ok(Self {
            kind,
            p_value: v["mismatch"]["p_value"].as_f64(),
            effects,
            alternatives,
            own_fit,
            own_black_box,
            time_s,
            experiment,
        })
    }

    /// Whether it said that something is missing.
    pub fn alarmed(&self) -> bool {
        self.kind != "no_significant_mismatch"
    }

    /// The best guess: the stated effects; where none is stated, the first rival.
    pub fn guess(&self) -> Vec<Stated> {
        if !self.effects.is_empty() || !self.alarmed() || self.kind == "not_in_catalogue" {
            return self.effects.clone();
        }
        self.alternatives
            .iter()
            .take(1)
            .map(|a| Stated { mechanism: a.mechanism.clone(), family: a.family.clone(), ..Stated::default() })
            .collect()
    }
}

fn list(v: &Value) -> &[Value] {
    v.as_array().map_or(&[], Vec::as_slice)
}

fn word(v: &Value) -> String {
    v.as_str().unwrap_or_default().to_string()
}

/// The mechanisms of a set that is written as a sum.
fn names(set: &str) -> Vec<String> {
    set.split(" + ").map(str::to_owned).collect()
}

fn stated(v: &Value) -> Stated {
    let probability = v["probability"].as_f64().unwrap_or(0.0);
    let family_probability = v["family_probability"].as_f64().unwrap_or(probability).max(probability);
    Stated {
        mechanism: word(&v["mechanism"]),
        family: word(&v["family"]),
        slot: word(&v["slot"]),
        probability,
        family_probability,
        support: (
            v["support"].as_f64().unwrap_or(probability),
            v["family_support"].as_f64().unwrap_or(family_probability),
        ),
        parameters: list(&v["parameters"])
            .iter()
            .map(|p| {
                let number = |key: &str| p[key].as_f64().unwrap_or(f64::NAN);
                (word(&p["name"]), number("value"), number("low"), number("high"))
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_contracts_example_is_read() {
        let text = r#"{"schema":"hysid.diagnosis/1","verdict":"named","mismatch":{"p_value":0.005},
            "location":{"slot":"state:v","time_s":[[0.0,12.4]]},
            "effects":[{"mechanism":"coulomb_friction","family":"dry_friction","slot":"state:v","probability":0.97,
                        "parameters":[{"name":"F_c","value":20.3,"low":19.8,"high":20.9,"unit":"N"}]}],
            "alternatives":[{"mechanism":"dahl_friction","family":"presliding","slot":"state:v","probability":0.02}],
            "fit":[{"recording":"VAL.csv","output":"q","rmse_before":3.0,"rmse_after":4.0,"rmse_black_box":8.0}],
            "experiment":null}"#;
        let v = Verdict::read(text).unwrap();
        assert!(v.alarmed());
        assert_eq!(v.effects[0].parameters[0], ("F_c".into(), 20.3, 19.8, 20.9));
        assert_eq!((v.own_fit, v.own_black_box), (Some((9.0, 16.0)), Some(2.0)));
        assert_eq!((v.time_s.len(), v.effects[0].family_probability), (1, 0.97));
        assert!(v.experiment.is_none());
    }
}
