//! Checks the workspace against `xtask/layers.toml`: layers, allowed edges, owners of outside crates.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

/// The rules of `layers.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rules {
    layer: BTreeMap<String, u8>,
    same_layer: BTreeMap<String, Vec<String>>,
    owner: BTreeMap<String, Vec<String>>,
    forbidden: BTreeMap<String, Vec<String>>,
}

#[derive(Debug, Deserialize)]
struct Manifest {
    package: Package,
    #[serde(default)]
    dependencies: BTreeMap<String, toml::Value>,
    #[serde(default, rename = "dev-dependencies")]
    dev_dependencies: BTreeMap<String, toml::Value>,
}

#[derive(Debug, Deserialize)]
struct Package {
    name: String,
}

/// Every breach of the rules below `root`, a sentence each; empty when the house is in order.
pub fn breaches(root: &Path) -> anyhow::Result<Vec<String>> {
    let rules: Rules = toml::from_str(&std::fs::read_to_string(root.join("xtask/layers.toml"))?)?;
    let mut manifests = vec![root.join("xtask/Cargo.toml")];
    for entry in std::fs::read_dir(root.join("crates"))? {
        manifests.push(entry?.path().join("Cargo.toml"));
    }
    manifests.sort();
    let mut found = Vec::new();
    for path in manifests.iter().filter(|p| p.exists()) {
        let manifest: Manifest = toml::from_str(&std::fs::read_to_string(path)?)?;
        check(&rules, &manifest, &mut found);
    }
    Ok(found)
}

fn check(rules: &Rules, manifest: &Manifest, found: &mut Vec<String>) {
    let name = &manifest.package.name;
    let Some(layer) = rules.layer.get(name) else {
        found.push(format!("{name} has no layer in xtask/layers.toml"));
        return;
    };
    for dependency in manifest.dependencies.keys() {
        if let Some(below) = rules.layer.get(dependency) {
            let excused = rules.same_layer.get(name).is_some_and(|e| e.contains(dependency));
            if below > layer || (below == layer && !excused) {
                found.push(format!("{name} (layer {layer}) depends on {dependency} (layer {below})"));
            }
        }
    }
    for dependency in manifest.dependencies.keys().chain(manifest.dev_dependencies.keys()) {
        if rules.owner.get(dependency).is_some_and(|owners| !owners.contains(name)) {
            found.push(format!("{name} names {dependency}, which belongs to {:?}", rules.owner[dependency]));
        }
        if rules.forbidden.get(dependency).is_some_and(|barred| barred.contains(name)) {
            found.push(format!("{name} depends on {dependency}, which it must not know"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root() -> &'static Path {
        Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace")
    }

    #[test]
    fn the_house_keeps_its_layers() {
        let found = breaches(root()).unwrap();
        assert!(found.is_empty(), "{}", found.join("\n"));
    }

    #[test]
    fn a_breach_is_seen() {
        let rules: Rules = toml::from_str(&std::fs::read_to_string(root().join("xtask/layers.toml")).unwrap()).unwrap();
        let check_one = |text: &str| {
            let mut found = Vec::new();
            check(&rules, &toml::from_str(text).unwrap(), &mut found);
            found.len()
        };
        let cases = [
            ("[package]\nname='hysid-signal'\n[dependencies]\nhysid-narx='1'", 1),
            ("[package]\nname='hysid-io'\n[dependencies]\nhysid-select='1'", 1),
            ("[package]\nname='hysid-narx'\n[dependencies]\nfaer='1'", 1),
            ("[package]\nname='hysid-plant'\n[dev-dependencies]\nhysid-concealed='1'", 1),
            ("[package]\nname='unknown'", 1),
            ("[package]\nname='hysid-dictionary'\n[dependencies]\nhysid-hysteresis='1'", 0),
        ];
        for (text, expected) in cases {
            assert_eq!(check_one(text), expected, "{text}");
        }
    }
}
