//! Which criterion finds the terms of the known system under noise? `cargo run --release -p hysid-select --example parsimony`
//!
//! The known 11-term system with equation noise, 84 candidates; true terms found, spurious terms, and the free run of the
//! model on a fresh input without noise, over 20 seeds each.

#[path = "../tests/select/common/mod.rs"]
#[allow(dead_code, reason = "the tests use the rest")]
mod common;

use common::{narx, true_terms};
use hysid_dictionary::{Design, Model, Record, Signals, Spec, Term};
use hysid_select::{Criterion, Options, PressForm, select};

const SEEDS: u64 = 20;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let dictionary = Spec::narx(Signals::siso(), 3, 1..=3, 3).build()?;
    let (fresh_u, fresh_y) = narx(2000, 4711, 0.0);
    let spread = std(&fresh_y);
    println!(
        "| samples | noise | criterion | true terms found of 11, mean (least) | spurious, mean (most) | free run / std(y), median (worst) |"
    );
    println!("|---:|---:|---|---|---|---|");
    for (samples, noises) in [(10_000, &[0.0, 0.01, 0.05, 0.2][..]), (1000, &[0.01, 0.05, 0.2][..])] {
        let tenth = samples / 10;
        let blocks: Vec<_> = (0..10).map(|b| b * tenth..((b + 1) * tenth).min(samples - 3)).collect();
        let criteria = [
            ("PRESS", Criterion::Press(PressForm::Exact)),
            ("PRESS with the price of the search", Criterion::SearchedPress),
            ("ten blocks", Criterion::Blocks(blocks)),
            ("AIC", Criterion::Aic),
            ("BIC", Criterion::Bic),
        ];
        for &noise in noises {
            for (name, criterion) in &criteria {
                let options = Options { criterion: criterion.clone(), ..Options::default() };
                let (mut found, mut spurious, mut errors) = (Vec::new(), Vec::new(), Vec::new());
                for seed in 1..=SEEDS {
                    let (u, y) = narx(samples, seed, noise);
                    let design = Design::new(&dictionary, &[Record::siso(&u, &y)])?;
                    let s = select(&design, &design.target(), &options)?;
                    let terms: Vec<Term> = s.terms.iter().map(|&j| dictionary.terms()[j].clone()).collect();
                    let hits = true_terms().iter().filter(|t| terms.contains(t)).count();
                    found.push(hits as f64);
                    spurious.push((terms.len() - hits) as f64);
                    let model = Model::new(Signals::siso(), terms, s.theta.clone())?;
                    let run = model.free_run(&[&fresh_u], &fresh_y[..3], fresh_u.len(), 100.0)?;
                    let e: Vec<f64> = run.y.iter().zip(&fresh_y).map(|(a, b)| a - b).collect();
                    let rms = (e.iter().map(|v| v * v).sum::<f64>() / e.len() as f64).sqrt() / spread;
                    errors.push(if run.diverged_at.is_some() { f64::INFINITY } else { rms });
                }
                errors.sort_by(f64::total_cmp);
                let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
                let least = found.iter().copied().fold(f64::INFINITY, f64::min);
                let most = spurious.iter().copied().fold(0.0, f64::max);
                println!(
                    "| {samples} | {noise} | {name} | {:.2} ({least}) | {:.2} ({most}) | {:.1e} ({:.1e}) |",
                    mean(&found),
                    mean(&spurious),
                    errors[errors.len() / 2],
                    errors[errors.len() - 1]
                );
            }
        }
    }
    Ok(())
}

fn std(y: &[f64]) -> f64 {
    let mean = y.iter().sum::<f64>() / y.len() as f64;
    (y.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / y.len() as f64).sqrt()
}
