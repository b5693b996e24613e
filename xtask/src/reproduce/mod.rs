//! `cargo xtask reproduce`: the tables and figures of Zhang, Zhu and Gu (2017), rebuilt cell by cell.
//!
//! For each cell: the printed value, ours as the authors must have computed it, ours by the right equations, and a mark. A cell is *claimed* where
//! this program says that it reproduces the printed digits; the task ends with status 1 if a claimed cell does not hold. What is not claimed
//! is shown all the same, with what was tried.

mod bouc_wen;
mod cell;
mod compare;
mod html;
mod markdown;
mod paper;
mod reduced_frequency;
mod table1;
mod table2;
mod table3;
mod wing;

use std::path::PathBuf;

use anyhow::{Context, ensure};
use clap::Args as ClapArgs;

use self::cell::Section;

/// Rebuild the paper's tables and figures, cell by cell.
#[derive(Debug, ClapArgs)]
pub struct Args {
    /// Where `reproduction.html` goes; `docs/reproduction.md` is written too unless `--check` is given.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Only check the claimed cells; write nothing into the repository.
    #[arg(long)]
    check: bool,
}

/// All sections, in the order of the page.
fn sections() -> anyhow::Result<Vec<Section>> {
    Ok(vec![
        table1::section()?,
        table2::section()?,
        table3::section()?,
        table3::errors_section()?,
        bouc_wen::section()?,
        wing::surrogate()?,
        wing::aerofoil(&crate::root().join("../shared/recordings/osu_s809_dynamic_stall"))?,
        compare::section()?,
    ])
}

/// Runs the task.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let sections = sections()?;
    for s in &sections {
        println!("{}: {}", s.title, s.summary());
    }
    let out = args.out.clone().unwrap_or_else(|| crate::root().join("target/reproduce"));
    std::fs::create_dir_all(&out).with_context(|| format!("{} cannot be made", out.display()))?;
    let page = out.join("reproduction.html");
    hysid_io::write_text(&page, &html::page(&sections))?;
    println!("{}", page.display());
    if !args.check {
        let text = crate::root().join("docs/reproduction.md");
        hysid_io::write_text(&text, &markdown::document(&sections))?;
        println!("{}", text.display());
    }
    let broken: Vec<String> = sections.iter().flat_map(Section::broken_claims).collect();
    ensure!(broken.is_empty(), "claimed cells that do not hold:\n{}", broken.join("\n"));
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_claimed_cell_of_the_three_tables_holds() {
        let sections = [super::table1::section(), super::table2::section(), super::table3::section()];
        let claimed: usize = sections.iter().map(|s| s.as_ref().unwrap().claimed()).sum();
        assert_eq!(claimed, 14 + 14 + 24 + 24);
        for section in sections {
            assert_eq!(section.unwrap().broken_claims(), Vec::<String>::new());
        }
    }
}
