//! The page: a headline, then sections of facts, tables, notes and figures. Nothing in it is fetched or run.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::figure::FigureError;

/// A page in the making.
#[derive(Debug, Clone, Default)]
pub struct Page {
    title: String,
    headline: String,
    lead: String,
    body: Vec<Markup>,
    foot: Vec<String>,
}

/// How a cell of a table is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    /// Text.
    Left,
    /// Numbers.
    Right,
}

/// A table: one heading and one alignment for each column.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The columns' headings and how their cells are set.
    pub columns: Vec<(String, Align)>,
    /// The rows, as text.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table with these columns.
    pub fn new(columns: &[(&str, Align)]) -> Self {
        Self { columns: columns.iter().map(|(h, a)| ((*h).to_string(), *a)).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }
}

/// The weight of a note.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tenor {
    /// Something to know.
    Plain,
    /// Something to beware of.
    Warning,
}

impl Page {
    /// A page whose browser title and overline is `title`, whose large first sentence is `headline`, followed by `lead`.
    pub fn new(title: impl Into<String>, headline: impl Into<String>, lead: impl Into<String>) -> Self {
        Self { title: title.into(), headline: headline.into(), lead: lead.into(), ..Self::default() }
    }

    /// Begins a section; `intro` may be empty.
    pub fn section(&mut self, heading: &str, intro: &str) {
        self.body.push(html! { h2 { (heading) } @if !intro.is_empty() { p.intro { (intro) } } });
    }

    /// Adds facts side by side: a large value with what it is below it.
    pub fn facts(&mut self, facts: &[(String, String)]) {
        self.body.push(html! {
            div.facts { @for (value, what) in facts { div.fact { span.value { (value) } span.what { (what) } } } }
        });
    }

    /// Adds a paragraph.
    pub fn text(&mut self, text: &str) {
        self.body.push(html! { p { (text) } });
    }

    /// Adds text that is set as it is, such as an equation or a command.
    pub fn code(&mut self, text: &str) {
        self.body.push(html! { pre { (text) } });
    }

    /// Adds a list of notes; nothing where there are none.
    pub fn notes(&mut self, tenor: Tenor, notes: &[String]) {
        if notes.is_empty() {
            return;
        }
        let class = match tenor {
            Tenor::Plain => "notes",
            Tenor::Warning => "notes warning",
        };
        self.body.push(html! { ul class=(class) { @for note in notes { li { (note) } } } });
    }

    /// Adds a table.
    pub fn table(&mut self, table: &Table) {
        let class = |a: Align| if a == Align::Right { "number" } else { "" };
        self.body.push(html! {
            div.scroll { table {
                thead { tr { @for (heading, align) in &table.columns { th class=(class(*align)) { (heading) } } } }
                tbody { @for row in &table.rows { tr {
                    @for (cell, (_, align)) in row.iter().zip(&table.columns) { td class=(class(*align)) { (cell) } }
                } } }
            } }
        });
    }

    /// Adds a figure (SVG text that this crate drew) with its caption.
    pub fn figure(&mut self, svg: Result<String, FigureError>, caption: &str) {
        self.body.push(figure(svg, caption));
    }

    /// Adds two figures side by side, one below the other on a narrow screen.
    pub fn figures(&mut self, figures: Vec<(Result<String, FigureError>, String)>) {
        self.body.push(html! { div.pair { @for (svg, caption) in figures { (figure(svg, &caption)) } } });
    }

    /// Adds a line to the foot of the page.
    pub fn foot(&mut self, line: impl Into<String>) {
        self.foot.push(line.into());
    }

    /// The page as HTML text.
    pub fn render(&self) -> String {
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    title { (self.title) }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    header { p.overline { (self.title) } h1 { (self.headline) } @if !self.lead.is_empty() { p.lead { (self.lead) } } }
                    main { @for part in &self.body { (part) } }
                    @if !self.foot.is_empty() { footer { @for line in &self.foot { p { (line) } } } }
                }
            }
        }
        .into_string()
    }
}

fn figure(svg: Result<String, FigureError>, caption: &str) -> Markup {
    html! {
        figure {
            @match svg {
                // Drawn by `crate::figure`, which escapes its labels.
                Ok(text) => (PreEscaped(responsive(&text))),
                Err(error) => p.missing { (error) },
            }
            figcaption { (caption) }
        }
    }
}

/// Lets a figure shrink with the page: a fixed size becomes a view box.
fn responsive(svg: &str) -> String {
    svg.replacen("<svg ", "<svg role=\"img\" preserveAspectRatio=\"xMidYMid meet\" ", 1)
}

const STYLE: &str = "
:root { color: #1f2328; background: #f6f7f9; font: 16px/1.55 system-ui, 'Segoe UI', Helvetica, Arial, sans-serif; }
body { max-width: 60rem; margin: 0 auto; padding: 2rem 1.25rem 3rem; }
.overline { text-transform: uppercase; letter-spacing: .08em; font-size: .78rem; color: #6a717b; margin: 0; }
h1 { font-size: 1.85rem; line-height: 1.25; margin: .25rem 0 .5rem; }
h2 { font-size: 1.2rem; margin: 2.4rem 0 .4rem; border-top: 1px solid #dfe2e6; padding-top: 1.2rem; }
.lead { font-size: 1.08rem; color: #3d444d; margin: 0 0 1rem; max-width: 48rem; }
.intro { color: #4b535d; margin-top: 0; max-width: 48rem; }
.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(9.5rem, 1fr)); gap: .8rem; margin: 1.2rem 0; }
.fact { background: #fff; border: 1px solid #e3e6ea; border-radius: .6rem; padding: .8rem 1rem; }
.fact .value { display: block; font-size: 1.35rem; font-weight: 600; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
.fact .what { display: block; font-size: .85rem; color: #5c646e; }
figure { margin: 1rem 0; background: #fff; border: 1px solid #e3e6ea; border-radius: .6rem; padding: .6rem .6rem .4rem; }
figure svg { display: block; width: 100%; height: auto; }
figcaption { font-size: .88rem; color: #5c646e; padding: .2rem .4rem .3rem; }
.pair { display: grid; grid-template-columns: repeat(auto-fill, minmax(22rem, 1fr)); gap: 1rem; align-items: start; }
.pair figure { margin: 0; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; background: #fff; font-size: .93rem; margin: .6rem 0; }
th, td { text-align: left; padding: .38rem .7rem; border-bottom: 1px solid #e8eaed; vertical-align: top; }
th { font-size: .8rem; color: #5c646e; font-weight: 600; white-space: nowrap; }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
pre { background: #fff; border: 1px solid #e3e6ea; border-radius: .6rem; padding: .8rem 1rem; overflow-x: auto; font-size: .9rem; white-space: pre-wrap; }
.notes { padding-left: 1.2rem; } .notes li { margin: .25rem 0; }
.warning { background: #fff4e5; border-left: 4px solid #d55e00; border-radius: .3rem; padding: .6rem 1rem .6rem 2rem; }
.missing { color: #a33; }
footer { margin-top: 3rem; border-top: 1px solid #dfe2e6; color: #6a717b; font-size: .85rem; }
footer p { margin: .3rem 0; overflow-wrap: anywhere; }
@media print { :root { background: #fff; } figure, .fact { break-inside: avoid; } }
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_users_write_is_escaped() {
        let mut page = Page::new("<script>", "a & b", "");
        page.text("</p><script>alert(1)</script>");
        let mut table = Table::new(&[("<b>", Align::Left)]);
        table.row(["<i>".to_string()]);
        page.table(&table);
        let html = page.render();
        assert!(!html.contains("<script>"));
        assert!(html.contains("&lt;b&gt;") && html.contains("&lt;i&gt;") && html.contains("a &amp; b"));
    }

    #[test]
    fn nothing_is_fetched() {
        let mut page = Page::new("t", "h", "l");
        page.figure(crate::figure::Plot::new("x", "y").svg(), "caption");
        let html = page.render();
        let links = html.matches("http").count();
        assert_eq!(links, html.matches("http://www.w3.org/2000/svg").count());
    }

    #[test]
    fn a_figure_that_failed_is_told() {
        let mut page = Page::new("t", "h", "");
        page.figure(Err(FigureError("no cells".into())), "c");
        assert!(page.render().contains("no cells"));
    }
}
