//! The HTML page with the figures.

use hysid_report::page::{Align, Page, Table, Tenor};

use super::cell::Section;
use super::markdown::remark;

/// The page.
pub fn page(sections: &[Section]) -> String {
    let cells: Vec<_> = sections.iter().flat_map(|s| &s.cells).collect();
    let agreeing = cells.iter().filter(|c| c.agrees()).count();
    let mut page = Page::new(
        "Reproduction",
        format!("{agreeing} of {} printed cells to the last digit", cells.len()),
        "Zhang, Zhu and Gu (2017), rebuilt cell by cell: as the authors must have computed it, and by the right equations.",
    );
    page.facts(
        &sections
            .iter()
            .filter(|s| !s.cells.is_empty())
            .map(|s| {
                let agreeing = s.cells.iter().filter(|c| c.agrees()).count();
                (format!("{agreeing} / {}", s.cells.len()), s.title.clone())
            })
            .collect::<Vec<_>>(),
    );
    for s in sections {
        page.section(&s.title, "");
        page.notes(Tenor::Plain, &s.settings);
        if !s.cells.is_empty() {
            let mut columns = vec![
                ("cell", Align::Left),
                ("printed", Align::Right),
                ("as the authors computed it", Align::Right),
                ("mark", Align::Left),
            ];
            if !s.right_label.is_empty() {
                columns.push((s.right_label.as_str(), Align::Right));
            }
            columns.push(("remark", Align::Left));
            let mut table = Table::new(&columns);
            for c in &s.cells {
                let mut row = vec![c.name.clone(), c.printed.to_owned(), c.rounded(), c.mark().to_owned()];
                if !s.right_label.is_empty() {
                    row.push(c.right.clone());
                }
                row.push(remark(c));
                table.row(row);
            }
            page.table(&table);
        }
        for g in &s.grids {
            page.text(&g.caption);
            let columns: Vec<(&str, Align)> = g.columns.iter().map(|c| (c.as_str(), Align::Left)).collect();
            let mut table = Table::new(&columns);
            g.rows.iter().for_each(|r| table.row(r.iter().cloned()));
            page.table(&table);
        }
        for note in &s.notes {
            page.text(note);
        }
        for (plot, caption) in &s.figures {
            page.figure(plot.svg(), caption);
        }
    }
    page.foot("Written by `cargo xtask reproduce`.");
    page.render()
}
