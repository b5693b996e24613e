//! A value over a grid of cells, as colours: where over displacement and velocity a mismatch lives, or a confusion table.

use plotters::prelude::*;

use super::FigureError;

/// Which colours stand for which values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// From white (zero) to blue (largest).
    Sequential,
    /// Orange below zero, white at zero, blue above, symmetric.
    Diverging,
}

/// A value over a grid of cells. A cell that is not finite (no sample fell into it) stays grey.
#[derive(Debug, Clone, PartialEq)]
pub struct Map {
    /// The horizontal axis, unit included.
    pub x_label: String,
    /// The vertical axis, unit included.
    pub y_label: String,
    /// Borders of the columns, ascending: one more than there are columns.
    pub x_edges: Vec<f64>,
    /// Borders of the rows, ascending: one more than there are rows.
    pub y_edges: Vec<f64>,
    /// Values row by row, the lowest row first.
    pub values: Vec<f64>,
    /// The colours.
    pub scale: Scale,
    /// Width and height in pixels.
    pub size: (u32, u32),
}

impl Map {
    /// The figure as SVG text.
    ///
    /// # Errors
    /// Borders that do not fit the values, or what the drawing library says.
    pub fn svg(&self) -> Result<String, FigureError> {
        let columns = self.x_edges.len().saturating_sub(1);
        let rows = self.y_edges.len().saturating_sub(1);
        let ascending = |e: &[f64]| e.windows(2).all(|w| w[0] < w[1]);
        if columns * rows != self.values.len() || !ascending(&self.x_edges) || !ascending(&self.y_edges) {
            return Err(FigureError(format!("{columns} x {rows} cells, {} values", self.values.len())));
        }
        let (Some(x0), Some(x1)) = (self.x_edges.first(), self.x_edges.last()) else {
            return Err(FigureError("a map without cells".into()));
        };
        let (Some(y0), Some(y1)) = (self.y_edges.first(), self.y_edges.last()) else {
            return Err(FigureError("a map without cells".into()));
        };
        let largest = self.values.iter().filter(|v| v.is_finite()).fold(0.0f64, |m, v| m.max(v.abs()));
        let mut text = String::new();
        {
            let area = SVGBackend::with_string(&mut text, self.size).into_drawing_area();
            let mut chart = ChartBuilder::on(&area)
                .margin(6)
                .set_label_area_size(LabelAreaPosition::Left, 64)
                .set_label_area_size(LabelAreaPosition::Bottom, 40)
                .build_cartesian_2d(*x0..*x1, *y0..*y1)
                .map_err(FigureError::of)?;
            let style = |size: u32| ("sans-serif", size).into_font().color(&RGBColor(70, 74, 82));
            chart
                .configure_mesh()
                .disable_mesh()
                .x_desc(&self.x_label)
                .y_desc(&self.y_label)
                .x_label_formatter(&|v| compact(*v))
                .y_label_formatter(&|v| compact(*v))
                .x_labels(6)
                .y_labels(6)
                .axis_desc_style(style(14))
                .label_style(style(12))
                .draw()
                .map_err(FigureError::of)?;
            let cells = (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))).map(|(r, c)| {
                let corners = [(self.x_edges[c], self.y_edges[r]), (self.x_edges[c + 1], self.y_edges[r + 1])];
                Rectangle::new(corners, colour(self.values[r * columns + c], largest, self.scale).filled())
            });
            chart.draw_series(cells).map_err(FigureError::of)?;
            area.present().map_err(FigureError::of)?;
        }
        Ok(text)
    }
}

fn compact(value: f64) -> String {
    // Edges that a sum should have brought to zero.
    if value.abs() < 1e-12 {
        "0".into()
    } else if (1e-3..1e5).contains(&value.abs()) {
        let decimals = (2.0 - value.abs().log10().floor()).clamp(0.0, 6.0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.1e}")
    }
}

fn colour(value: f64, largest: f64, scale: Scale) -> RGBColor {
    if !value.is_finite() {
        return RGBColor(236, 237, 239);
    }
    let share = if largest > 0.0 { (value / largest).clamp(-1.0, 1.0) } else { 0.0 };
    let full = match scale {
        Scale::Diverging if share < 0.0 => (213.0, 94.0, 0.0),
        _ => (0.0, 114.0, 178.0),
    };
    let mix = |end: f64| (255.0 + (end - 255.0) * share.abs()).round() as u8;
    RGBColor(mix(full.0), mix(full.1), mix(full.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(values: Vec<f64>) -> Map {
        Map {
            x_label: "x (mm)".into(),
            y_label: "v (mm/s)".into(),
            x_edges: vec![0.0, 1.0, 2.0],
            y_edges: vec![0.0, 1.0],
            values,
            scale: Scale::Diverging,
            size: (400, 300),
        }
    }

    #[test]
    fn colours_follow_the_sign() {
        assert_eq!(colour(0.0, 2.0, Scale::Diverging), RGBColor(255, 255, 255));
        assert_eq!(colour(2.0, 2.0, Scale::Diverging), RGBColor(0, 114, 178));
        assert_eq!(colour(-2.0, 2.0, Scale::Diverging), RGBColor(213, 94, 0));
        assert_eq!(colour(f64::NAN, 2.0, Scale::Diverging), RGBColor(236, 237, 239));
    }

    #[test]
    fn values_must_fit_the_grid() {
        assert!(map(vec![1.0, -1.0]).svg().unwrap().contains("x (mm)"));
        assert!(map(vec![1.0]).svg().is_err());
    }
}
