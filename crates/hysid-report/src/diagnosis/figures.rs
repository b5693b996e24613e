//! The figures of a diagnosis, drawn from the series that `hysid-diagnose` gives.

use hysid_diagnose::answer::picture::{LawPicture, MapPicture, RecordPicture, Role, SpectrumPicture};

use crate::figure::{FigureError, LogAxes, Map, Mark, Plot, Scale, Tone, envelope};

/// Stretches that a long series is drawn with: about as many as the figure has pixels.
const BUCKETS: usize = 700;
/// Points at most of a loop.
const LOOP_POINTS: usize = 4000;

fn with_unit(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_string() } else { format!("{name} ({unit})") }
}

/// What a recording was used for, in words.
pub(super) fn role(role: Role) -> &'static str {
    match role {
        Role::Estimation => "used for the diagnosis",
        Role::HoldOut => "hold-out, never used",
    }
}

/// Shades what was held out: each piece between gaps, since blocks of one recording are pieces too.
fn shade(mut plot: Plot, record: &RecordPicture) -> Plot {
    if record.role == Role::HoldOut {
        let entries: Vec<(f64, f64)> = record.time_s.iter().copied().zip(record.measured.iter().copied()).collect();
        for (i, piece) in entries.split(|(_, y)| y.is_nan()).filter(|piece| !piece.is_empty()).enumerate() {
            plot = plot.shaded(piece[0].0, piece[piece.len() - 1].0, if i == 0 { "hold-out" } else { "" });
        }
    }
    plot
}

/// Recording, baseline and augmented simulation over time.
pub(super) fn over_time(record: &RecordPicture) -> Result<String, FigureError> {
    let line = |y: &[f64]| envelope(&record.time_s, y, BUCKETS);
    let mut plot = shade(Plot::new("time (s)", with_unit(&record.output, &record.unit)), record)
        .with("recorded", Tone::Measured, Mark::Line, line(&record.measured))
        .with("before", Tone::Before, Mark::Line, line(&record.before));
    if let Some(after) = &record.after {
        plot = plot.with("after", Tone::After, Mark::Line, line(after));
    }
    plot.svg()
}

/// The residuals over time with the noise floor.
pub(super) fn residual_over_time(record: &RecordPicture) -> Result<String, FigureError> {
    let residual = |y: &[f64]| {
        let e: Vec<f64> = record.measured.iter().zip(y).map(|(m, y)| m - y).collect();
        envelope(&record.time_s, &e, BUCKETS)
    };
    let mut plot = shade(Plot::new("time (s)", with_unit("residual", &record.unit)), record).sized(860, 220).with(
        "before",
        Tone::Before,
        Mark::Line,
        residual(&record.before),
    );
    if let Some(after) = &record.after {
        plot = plot.with("after", Tone::After, Mark::Line, residual(after));
    }
    if record.noise_rms > 0.0 {
        plot = plot.with_levels(&[2.0 * record.noise_rms, -2.0 * record.noise_rms]);
    }
    plot.svg()
}

/// Spectra of recording, residuals and noise.
pub(super) fn spectrum(s: &SpectrumPicture) -> Result<String, FigureError> {
    let line = |y: &[f64]| envelope(&s.frequency_hz, y, BUCKETS);
    let mut plot = Plot::new("frequency (Hz)", with_unit("amplitude", &s.unit))
        .logarithmic(LogAxes::Both)
        .with("recorded", Tone::Measured, Mark::Line, line(&s.measured))
        .with("residual before", Tone::Before, Mark::Line, line(&s.before));
    if let Some(after) = &s.after {
        plot = plot.with("residual after", Tone::After, Mark::Line, line(after));
    }
    plot.with("noise", Tone::Faint, Mark::Dashed, line(&s.noise)).svg()
}

/// One map of the mean residual.
pub(super) fn map(m: &MapPicture, values: &[f64]) -> Result<String, FigureError> {
    Map {
        x_label: m.x_label.clone(),
        y_label: m.y_label.clone(),
        x_edges: m.x_edges.clone(),
        y_edges: m.y_edges.clone(),
        values: values.to_vec(),
        scale: Scale::Diverging,
        size: (430, 320),
    }
    .svg()
}

/// A law or loop. A long one is thinned by leaving out points, since an envelope would break the loop.
pub(super) fn law(l: &LawPicture) -> Result<String, FigureError> {
    let step = l.points.len().div_ceil(LOOP_POINTS).max(1);
    let points: Vec<(f64, f64)> = l.points.iter().copied().step_by(step).collect();
    Plot::new(&l.x_label, &l.y_label).sized(430, 320).with("", Tone::After, Mark::Line, points).svg()
}
