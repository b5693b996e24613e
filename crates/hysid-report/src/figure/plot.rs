//! A figure over two axes: lines, points, stems, shaded bands and level lines.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::FigureError;
use super::legend::{Legend, Mark, Sample};
use crate::words::number;

/// Pixels around the axes, to their right, and for the vertical axis's labels.
const MARGIN: i32 = 6;
const RIGHT: i32 = 14;
const LEFT: i32 = 64;

/// A colour with a meaning, the same on every page. The set is told apart by people with colour-blindness too (Okabe-Ito).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// What was recorded.
    Measured,
    /// The first model: the baseline simulation, or one-step prediction.
    Before,
    /// The final model: the augmented simulation, or the free run.
    After,
    /// A further series.
    Other,
    /// What lies in the background: bounds, noise floor.
    Faint,
}

impl Tone {
    pub(super) fn rgb(self) -> RGBColor {
        match self {
            Self::Measured => RGBColor(60, 64, 72),
            Self::Before => RGBColor(213, 94, 0),
            Self::After => RGBColor(0, 114, 178),
            Self::Other => RGBColor(0, 158, 115),
            Self::Faint => RGBColor(150, 154, 160),
        }
    }
}

/// One series of a plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// What the legend says; empty for no entry.
    pub label: String,
    /// Its colour.
    pub tone: Tone,
    /// How it is drawn.
    pub mark: Mark,
    /// The points; those that are not finite are passed over.
    pub points: Vec<(f64, f64)>,
}

/// A shaded stretch of the horizontal axis, such as a hold-out.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// Where it begins.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// What the legend says; empty for no entry.
    pub label: String,
}

/// A figure over two axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    /// The horizontal axis, unit included.
    pub x_label: String,
    /// The vertical axis, unit included.
    pub y_label: String,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// The series, drawn in this order.
    pub layers: Vec<Layer>,
    /// Shaded stretches behind the series.
    pub bands: Vec<Band>,
    /// Horizontal level lines, drawn dashed.
    pub levels: Vec<f64>,
    /// Whether values are drawn over their decimal logarithm.
    pub logarithmic: LogAxes,
}

/// Which axes are logarithmic; points that are not above zero there are passed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LogAxes {
    /// Both axes are linear.
    #[default]
    None,
    /// The vertical axis.
    Y,
    /// Both axes.
    Both,
}

impl Plot {
    /// An empty plot of the usual size with these axis labels.
    pub fn new(x_label: impl Into<String>, y_label: impl Into<String>) -> Self {
        Self {
            x_label: x_label.into(),
            y_label: y_label.into(),
            size: (860, 300),
            layers: Vec::new(),
            bands: Vec::new(),
            levels: Vec::new(),
            logarithmic: LogAxes::None,
        }
    }

    /// The same plot with another size in pixels.
    pub fn sized(mut self, width: u32, height: u32) -> Self {
        self.size = (width, height);
        self
    }

    /// The same plot with one more layer.
    pub fn with(mut self, label: &str, tone: Tone, mark: Mark, points: Vec<(f64, f64)>) -> Self {
        self.layers.push(Layer { label: label.into(), tone, mark, points });
        self
    }

    /// The same plot with a shaded stretch.
    pub fn shaded(mut self, from: f64, to: f64, label: &str) -> Self {
        self.bands.push(Band { from, to, label: label.into() });
        self
    }

    /// The same plot with horizontal level lines.
    pub fn with_levels(mut self, levels: &[f64]) -> Self {
        self.levels.extend_from_slice(levels);
        self
    }

    /// The same plot with logarithmic axes.
    pub fn logarithmic(mut self, axes: LogAxes) -> Self {
        self.logarithmic = axes;
        self
    }

    /// The figure as SVG text.
    ///
    /// # Errors
    /// What the drawing library says; an empty plot is drawn as empty axes.
    pub fn svg(&self) -> Result<String, FigureError> {
        let mut text = String::new();
        {
            let area = SVGBackend::with_string(&mut text, self.size).into_drawing_area();
            self.draw(&area)?;
            area.present().map_err(FigureError::of)?;
        }
        Ok(text)
    }

    fn place(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        let log = |v: f64| if v > 0.0 { v.log10() } else { f64::NAN };
        let p = match self.logarithmic {
            LogAxes::None => (x, y),
            LogAxes::Y => (x, log(y)),
            LogAxes::Both => (log(x), log(y)),
        };
        (p.0.is_finite() && p.1.is_finite()).then_some(p)
    }

    fn draw(&self, area: &DrawingArea<SVGBackend<'_>, Shift>) -> Result<(), FigureError> {
        let layers: Vec<(&Layer, Vec<(f64, f64)>)> =
            self.layers.iter().map(|l| (l, l.points.iter().filter_map(|&p| self.place(p)).collect())).collect();
        let all = || layers.iter().flat_map(|(_, p)| p.iter());
        let stems = self.layers.iter().any(|l| l.mark == Mark::Stems);
        let levels: Vec<f64> = self.levels.iter().filter_map(|&v| self.place((1.0, v))).map(|p| p.1).collect();
        let xs = padded(all().map(|p| p.0), 0.0);
        let ys = padded(all().map(|p| p.1).chain(levels.iter().copied()).chain(stems.then_some(0.0)), 0.06);
        let shade = RGBColor(0, 114, 178).mix(0.08);
        let patches = self.bands.iter().map(|b| (b.label.as_str(), Sample::Patch(shade)));
        let marks = self.layers.iter().map(|l| (l.label.as_str(), Sample::Mark(l.mark, l.tone.rgb())));
        let legend = Legend::new(patches.chain(marks), LEFT + MARGIN, self.size.0 as i32 - RIGHT);
        let (strip, below) = area.split_vertically(legend.height());
        legend.draw(&strip)?;
        let mut chart = ChartBuilder::on(&below)
            .margin(MARGIN)
            .margin_right(RIGHT)
            .set_label_area_size(LabelAreaPosition::Left, LEFT)
            .set_label_area_size(LabelAreaPosition::Bottom, 40)
            .build_cartesian_2d(xs.0..xs.1, ys.0..ys.1)
            .map_err(FigureError::of)?;
        let x_log = self.logarithmic == LogAxes::Both;
        let y_log = self.logarithmic != LogAxes::None;
        let text = |size: u32| ("sans-serif", size).into_font().color(&RGBColor(70, 74, 82));
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(RGBColor(228, 230, 234))
            .axis_style(RGBColor(150, 154, 160))
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .x_labels(8)
            .y_labels(6)
            .x_label_formatter(&|v| tick(*v, xs, x_log))
            .y_label_formatter(&|v| tick(*v, ys, y_log))
            .axis_desc_style(text(14))
            .label_style(text(12))
            .draw()
            .map_err(FigureError::of)?;
        for band in &self.bands {
            let (from, to) = (band.from.clamp(xs.0, xs.1), band.to.clamp(xs.0, xs.1));
            let whole = Rectangle::new([(from, ys.0), (to, ys.1)], shade.filled());
            chart.draw_series([whole]).map_err(FigureError::of)?;
        }
        for level in levels {
            let style = Tone::Faint.rgb().stroke_width(1);
            chart
                .draw_series(DashedLineSeries::new([(xs.0, level), (xs.1, level)], 5, 4, style))
                .map_err(FigureError::of)?;
        }
        for (layer, points) in layers {
            let color = layer.tone.rgb();
            let line = color.stroke_width(if points.len() > 600 { 1 } else { 2 });
            match layer.mark {
                Mark::Line => chart.draw_series(LineSeries::new(points, line)).map(|_| ()),
                Mark::Dashed => chart.draw_series(DashedLineSeries::new(points, 6, 4, line)).map(|_| ()),
                Mark::Dots => chart
                    .draw_series(points.into_iter().map(|p| Circle::new(p, 2, color.mix(0.7).filled())))
                    .map(|_| ()),
                Mark::Stems => chart
                    .draw_series(points.into_iter().map(|(x, y)| PathElement::new([(x, 0.0), (x, y)], line)))
                    .map(|_| ()),
            }
            .map_err(FigureError::of)?;
        }
        Ok(())
    }
}

/// The range of `values` with a relative margin; a fixed range where there are none or they are all the same.
fn padded(values: impl Iterator<Item = f64>, margin: f64) -> (f64, f64) {
    let (low, high) = hysid_signal::range(values);
    if low > high {
        return (0.0, 1.0);
    }
    let span = high - low;
    // A span too small for the axis to step through is widened, else the drawing library would not end.
    let least = 1e-9 * low.abs().max(high.abs()).max(1e-290);
    if span <= least {
        let half = 0.5 * low.abs().max(1e-12);
        return (low - half, high + half);
    }
    (low - margin * span, high + margin * span)
}

/// A tick's text: as many digits as the axis needs, an exponent where the numbers are large or small.
fn tick(value: f64, range: (f64, f64), logarithmic: bool) -> String {
    if logarithmic {
        // Within about a decade there may be no power of ten to name.
        if range.1 - range.0 < 1.3 {
            return number(10f64.powf(value));
        }
        return if (value - value.round()).abs() < 1e-6 { format!("1e{}", value.round()) } else { String::new() };
    }
    let span = range.1 - range.0;
    if value.abs() < 1e-9 * span {
        return "0".into();
    }
    let largest = range.0.abs().max(range.1.abs());
    if !(1e-3..1e5).contains(&largest) {
        return format!("{value:.2e}").replace(".00e", "e");
    }
    let decimals = (1.0 - (span / 5.0).log10()).ceil().clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_names_its_axes_and_layers() {
        let svg = Plot::new("time (s)", "y (mm)")
            .with("recorded", Tone::Measured, Mark::Line, vec![(0.0, 1.0), (1.0, 2.0)])
            .shaded(0.5, 1.0, "hold-out")
            .svg()
            .unwrap();
        for part in ["<svg", "time (s)", "y (mm)", "recorded", "hold-out", "polyline"] {
            assert!(svg.contains(part), "{part} is not in the figure");
        }
    }

    #[test]
    fn awkward_data_are_drawn_all_the_same() {
        let cases: [Vec<(f64, f64)>; 6] = [
            vec![],
            vec![(1.0, 1.0)],
            vec![(0.0, 5.0), (1.0, 5.0)],
            vec![(0.0, f64::NAN), (1.0, f64::INFINITY)],
            vec![(0.0, 1e300), (1.0, -1e300)],
            vec![(0.0, 1e-300), (1.0, 2e-300)],
        ];
        for points in cases {
            for axes in [LogAxes::None, LogAxes::Y, LogAxes::Both] {
                let plot = Plot::new("x", "y").with("s", Tone::After, Mark::Line, points.clone()).logarithmic(axes);
                assert!(plot.svg().is_ok(), "{points:?} {axes:?}");
            }
        }
    }

    #[test]
    fn ticks_have_the_digits_that_the_axis_needs() {
        let cases = [(0.25, (0.0, 1.0), "0.25"), (2000.0, (0.0, 5000.0), "2000"), (3.0e-5, (0.0, 1e-4), "3e-5")];
        for (value, range, expected) in cases {
            assert_eq!(tick(value, range, false), expected);
        }
    }
}
