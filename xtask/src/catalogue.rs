//! `cargo xtask catalogue`: print `docs/catalogue.md`, and recover every mechanism from its own noise-free simulation.

use std::fs;

use clap::Subcommand;
use hysid_diagnose::mechanism::conformance::benches;
use hysid_diagnose::mechanism::{catalogue, catalogue_page};

/// The catalogue of mechanisms: its page, and the heavy part of its conformance suite.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Write docs/catalogue.md.
    Page,
    /// Fit every mechanism at every slot of the specimens to its own noise-free simulation; a table on standard output.
    Recover {
        /// Only mechanisms whose name contains this.
        #[arg(default_value = "")]
        name: String,
    },
}

/// Largest remainder, as a share of the effect, that counts as recovered.
const RECOVERED: f64 = 0.02;

pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.what {
        What::Page => {
            fs::write(crate::root().join("docs/catalogue.md"), catalogue_page())?;
            Ok(())
        }
        What::Recover { name } => recover(name),
    }
}

fn recover(name: &str) -> anyhow::Result<()> {
    let benches = benches();
    let (mut tried, mut recovered) = (0, 0);
    println!("{:<32}{:<44}{:>12}", "mechanism", "simulation and slot", "left/effect");
    for mechanism in catalogue().iter().filter(|m| m.id.contains(name)) {
        for bench in &benches {
            for (slot, signals) in bench.slots(mechanism) {
                let at = format!("{} {}", bench.title().chars().take(20).collect::<String>(), slot);
                match bench.recovery(mechanism, &slot, &signals) {
                    Some(left) => {
                        tried += 1;
                        recovered += usize::from(left <= RECOVERED);
                        let mark = if left <= RECOVERED { "" } else { "  not recovered" };
                        println!("{:<32}{at:<44}{left:>12.2e}{mark}", mechanism.id);
                    }
                    None => println!("{:<32}{at:<44}{:>12}", mechanism.id, "invisible"),
                }
            }
        }
    }
    println!("recovered {recovered} of {tried}");
    Ok(())
}
