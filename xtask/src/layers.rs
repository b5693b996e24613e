//! Checks the workspace against `xtask/layers.toml`: layers, allowed edges, the order of rooms within a crate, owners of outside crates.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Deserialize;

/// The rules of `layers.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rules {
    layer: BTreeMap<String, u8>,
    same_layer: BTreeMap<String, Vec<String>>,
    rooms: BTreeMap<String, Vec<String>>,
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
    let manifests =
        entries(&root.join("crates"))?.into_iter().chain([root.join("xtask")]).map(|p| p.join("Cargo.toml"));
    let mut found = Vec::new();
    for path in manifests.filter(|p| p.exists()) {
        let manifest: Manifest = toml::from_str(&std::fs::read_to_string(path)?)?;
        check(&rules, &manifest, &mut found);
    }
    for (name, order) in &rules.rooms {
        rooms(&root.join("crates").join(name).join("src"), name, order, &mut found)?;
    }
    Ok(found)
}

/// Checks that each room of a crate (a folder or file beside its `lib.rs`) names only rooms that come before it. Tests may look anywhere.
fn rooms(source: &Path, name: &str, order: &[String], found: &mut Vec<String>) -> anyhow::Result<()> {
    for entry in entries(source)? {
        let room = entry.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if room == "lib" {
            continue;
        }
        let Some(place) = order.iter().position(|r| *r == room) else {
            found.push(format!("{name}: the room `{room}` has no place in xtask/layers.toml"));
            continue;
        };
        let mut files = Vec::new();
        sources(&entry, &mut files)?;
        for file in files {
            let text = std::fs::read_to_string(&file)?;
            for other in named_rooms(&text) {
                if order.iter().position(|r| *r == other).is_some_and(|p| p > place) {
                    found.push(format!(
                        "{}: the room `{room}` stands before `{other}` and must not know it",
                        file.display()
                    ));
                }
            }
        }
    }
    Ok(())
}

/// What lies in a folder, in the order of its names.
fn entries(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder)?.map(|e| Ok(e?.path())).collect::<anyhow::Result<_>>()?;
    found.sort();
    Ok(found)
}

/// All source files at a path, in the order of their names.
fn sources(path: &Path, out: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    if path.is_dir() {
        return entries(path)?.iter().try_for_each(|e| sources(e, out));
    }
    if path.extension().is_some_and(|e| e == "rs") {
        out.push(path.to_owned());
    }
    Ok(())
}

/// The rooms that a source file names by `crate::`, outside comments and tests.
fn named_rooms(text: &str) -> BTreeSet<&str> {
    let code = text.split("#[cfg(test)]").next().unwrap_or(text);
    let lines = code.lines().filter(|l| !l.trim_start().starts_with("//"));
    let after = lines.flat_map(|l| l.split("crate::").skip(1));
    after.map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or(rest)).collect()
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

    fn rules() -> Rules {
        toml::from_str(&std::fs::read_to_string(root().join("xtask/layers.toml")).unwrap()).unwrap()
    }

    #[test]
    fn the_house_keeps_its_layers() {
        let found = breaches(root()).unwrap();
        assert!(found.is_empty(), "{}", found.join("\n"));
    }

    #[test]
    fn a_room_that_knows_what_stands_on_it_is_seen() {
        let text = "//! crate::answer\nuse crate::search::Search;\nlet x = crate::text::number(1.0);\n#[cfg(test)]\nmod tests { use crate::pipeline; }";
        assert_eq!(named_rooms(text).into_iter().collect::<Vec<_>>(), ["search", "text"]);
        let source = root().join("crates/hysid-diagnose/src");
        let mut turned = rules().rooms["hysid-diagnose"].clone();
        turned.reverse();
        let mut found = Vec::new();
        rooms(&source, "hysid-diagnose", &turned, &mut found).unwrap();
        assert!(found.iter().any(|f| f.contains("the room `search` stands before `model`")), "{found:?}");
    }

    #[test]
    fn a_breach_is_seen() {
        let rules = rules();
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
