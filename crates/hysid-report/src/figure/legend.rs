//! The legend of a figure: a strip above the axes, so that it never covers data.
//!
//! Entries stand side by side and go on in a further row where they do not fit. Widths are estimated from the number of
//! characters, since the page's reader chooses the font.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::FigureError;

/// How a layer's points are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// Joined by a line.
    Line,
    /// Joined by a dashed line.
    Dashed,
    /// A dot each.
    Dots,
    /// A vertical line from zero each, as in a correlogram.
    Stems,
}

/// What stands beside a label.
#[derive(Debug, Clone, Copy)]
pub(super) enum Sample {
    /// The mark of a layer.
    Mark(Mark, RGBColor),
    /// A patch of a shaded stretch.
    Patch(RGBAColor),
}

/// An entry: what is drawn and what it is called.
pub(super) type Entry<'a> = (&'a str, Sample);

const FONT: u32 = 12;
const ROW: i32 = 18;
/// Width of a sample, and of the gap between it and its label.
const SAMPLE: i32 = 18;
const GAP: i32 = 6;

/// The legend's entries, row by row, each with its horizontal place.
pub(super) struct Legend<'a> {
    rows: Vec<Vec<(i32, Entry<'a>)>>,
}

impl<'a> Legend<'a> {
    /// Places entries between `left` and `right`, in pixels; entries without a label are left out.
    pub(super) fn new(entries: impl IntoIterator<Item = Entry<'a>>, left: i32, right: i32) -> Self {
        let mut rows: Vec<Vec<(i32, Entry<'a>)>> = Vec::new();
        let mut x = left;
        for (label, sample) in entries.into_iter().filter(|e| !e.0.is_empty()) {
            let width = SAMPLE + GAP + (0.6 * f64::from(FONT) * label.chars().count() as f64).ceil() as i32;
            if rows.is_empty() || (x > left && x + width > right) {
                rows.push(Vec::new());
                x = left;
            }
            if let Some(row) = rows.last_mut() {
                row.push((x, (label, sample)));
            }
            x += width + 2 * GAP;
        }
        Self { rows }
    }

    /// Height in pixels; 0 without entries.
    pub(super) fn height(&self) -> i32 {
        if self.rows.is_empty() { 0 } else { ROW * self.rows.len() as i32 + GAP }
    }

    /// Draws the entries into the strip, which is as high as [`Legend::height`].
    pub(super) fn draw(&self, strip: &DrawingArea<SVGBackend<'_>, Shift>) -> Result<(), FigureError> {
        let style =
            ("sans-serif", FONT).into_font().color(&RGBColor(70, 74, 82)).pos(Pos::new(HPos::Left, VPos::Center));
        for (i, row) in self.rows.iter().enumerate() {
            let y = GAP + ROW * i as i32 + ROW / 2;
            for (x, (label, sample)) in row {
                draw_sample(strip, *x, y, *sample).map_err(FigureError::of)?;
                strip.draw(&Text::new(*label, (x + SAMPLE + GAP, y), style.clone())).map_err(FigureError::of)?;
            }
        }
        Ok(())
    }
}

fn draw_sample(
    strip: &DrawingArea<SVGBackend<'_>, Shift>,
    x: i32,
    y: i32,
    sample: Sample,
) -> Result<(), impl std::fmt::Display + use<>> {
    let piece = |from: i32, to: i32, color: RGBColor| {
        strip.draw(&PathElement::new([(x + from, y), (x + to, y)], color.stroke_width(2)))
    };
    match sample {
        Sample::Patch(color) => strip.draw(&Rectangle::new([(x, y - 5), (x + SAMPLE, y + 5)], color.filled())),
        Sample::Mark(Mark::Line, color) => piece(0, SAMPLE, color),
        Sample::Mark(Mark::Dashed, color) => piece(0, 7, color).and_then(|()| piece(11, SAMPLE, color)),
        Sample::Mark(Mark::Dots, color) => strip.draw(&Circle::new((x + SAMPLE / 2, y), 3, color.filled())),
        Sample::Mark(Mark::Stems, color) => {
            let middle = x + SAMPLE / 2;
            strip.draw(&PathElement::new([(middle, y - 6), (middle, y + 6)], color.stroke_width(2)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_stay_within_the_width_and_take_further_rows() {
        let sample = Sample::Mark(Mark::Line, BLACK);
        let cases: [(&[&str], usize); 4] = [
            (&[], 0),
            (&["", ""], 0),
            (&["recorded", "before", "after"], 1),
            (&["recorded", "what a very long label says", "another one that is long too", "after"], 2),
        ];
        for (labels, rows) in cases {
            let legend = Legend::new(labels.iter().map(|l| (*l, sample)), 70, 400);
            assert_eq!(legend.rows.len(), rows, "{labels:?}");
            assert_eq!(legend.height() == 0, rows == 0);
            let shown = legend.rows.iter().flatten().count();
            assert_eq!(shown, labels.iter().filter(|l| !l.is_empty()).count());
            assert!(legend.rows.iter().all(|r| r[0].0 == 70));
        }
    }
}
