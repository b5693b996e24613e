//! The guard of `--quick`: what the first five targets reached on the 60 cases, so that a step back is seen.
//!
//! The figures stand in `xtask/proof-guard.toml`, each with the direction in which it may not move.

use std::collections::BTreeMap;

use anyhow::{Context, ensure};
use serde::Deserialize;

use super::score::Score;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Guards {
    /// Largest value allowed, by the line's name.
    at_most: BTreeMap<String, f64>,
    /// Smallest value allowed.
    at_least: BTreeMap<String, f64>,
}

/// Fails where a line of the score falls behind its guard.
pub fn check(score: &Score) -> anyhow::Result<()> {
    let path = crate::root().join("xtask/proof-guard.toml");
    let text = std::fs::read_to_string(&path).with_context(|| format!("{}", path.display()))?;
    let found = breaches(&text, score)?;
    ensure!(found.is_empty(), "the proof falls behind its guard:\n{}", found.join("\n"));
    Ok(())
}

fn breaches(text: &str, score: &Score) -> anyhow::Result<Vec<String>> {
    let guards: Guards = toml::from_str(text)?;
    let value = |name: &str| {
        super::gates(score).find(|l| l.what == name).map(|l| l.value).with_context(|| format!("no line named {name:?}"))
    };
    let mut found = Vec::new();
    for (name, limit) in &guards.at_most {
        let v = value(name)?;
        if v.is_nan() || v > *limit {
            found.push(format!("{name}: {v:.3}, at most {limit} allowed"));
        }
    }
    for (name, limit) in &guards.at_least {
        let v = value(name)?;
        if v.is_nan() || v < *limit {
            found.push(format!("{name}: {v:.3}, at least {limit} wanted"));
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_back_is_seen() {
        let score = super::super::score::score(&[]);
        // Without cases every figure is undefined, which must not pass.
        let text = "[at_most]\n\"False alarms on controls\" = 0.1\n[at_least]\n\"Family right, DNR >= 0.5\" = 0.5\n";
        assert_eq!(breaches(text, &score).unwrap().len(), 2);
        assert!(breaches("[at_most]\n\"no such line\" = 1.0\n[at_least]\n", &score).is_err());
    }

    #[test]
    fn the_stored_guards_name_lines_that_exist() {
        let text = std::fs::read_to_string(crate::root().join("xtask/proof-guard.toml")).unwrap();
        assert!(breaches(&text, &super::super::score::score(&[])).is_ok());
    }
}
