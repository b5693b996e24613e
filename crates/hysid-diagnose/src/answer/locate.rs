//! Where a mismatch lives: intervals of time, bands of frequency, and the operating region in words.
//!
//! Everything here works on the *effect's* evidence, never on the raw residual: the plant smears a residual over its own memory.

use hysid_signal::power_spectrum;

use crate::evidence::Series;
use crate::evidence::quantile;

/// The windows of one series in which the evidence `r * g` of an effect is significant, merged, as rows.
///
/// `g` is the effect's whitened response, `r` the whitened residual (unit variance without mismatch).
pub fn active_rows(series: &Series, r: &[f64], g: &[f64]) -> Vec<std::ops::Range<usize>> {
    let n = series.rows.len();
    let windows = (n / 25).clamp(1, 40);
    let rows = |w: usize| series.rows.start + w * n / windows..series.rows.start + (w + 1) * n / windows;
    let energy: Vec<f64> = (0..windows).map(|w| g[rows(w)].iter().map(|x| x * x).sum()).collect();
    let mean = energy.iter().sum::<f64>() / windows as f64;
    let mut on: Vec<bool> = (0..windows)
        .map(|w| {
            let evidence: f64 = rows(w).map(|i| r[i] * g[i]).sum();
            energy[w] > 0.1 * mean && evidence > 2.0 * energy[w].sqrt()
        })
        .collect();
    for w in 1..windows.saturating_sub(1) {
        on[w] |= on[w - 1] && on[w + 1];
    }
    if on.iter().filter(|o| **o).count() * 10 >= windows * 7 {
        return vec![series.rows.clone()];
    }
    let mut out: Vec<std::ops::Range<usize>> = Vec::new();
    for w in (0..windows).filter(|&w| on[w]) {
        match out.last_mut() {
            Some(last) if last.end == rows(w).start => last.end = rows(w).end,
            _ => out.push(rows(w)),
        }
    }
    out
}

/// The bands in which the residual before has more than twice the power of the residual after, widest power first, at most three.
pub fn bands(before: &[f64], after: &[f64], period_s: f64) -> Vec<[f64; 2]> {
    let segment = (before.len() / 6).clamp(16, 2048).min(before.len());
    let (Ok((f, b)), Ok((_, a))) =
        (power_spectrum(before, period_s, segment), power_spectrum(after, period_s, segment))
    else {
        return Vec::new();
    };
    let total: f64 = b.iter().zip(&a).map(|(b, a)| (b - a).max(0.0)).sum();
    if total <= 0.0 {
        return Vec::new();
    }
    let mut out: Vec<([f64; 2], f64)> = Vec::new();
    let mut open: Option<(usize, f64)> = None;
    for i in 0..=f.len() {
        let on = i < f.len() && b[i] > 2.0 * a[i];
        match (on, open) {
            (true, None) => open = Some((i, b[i] - a[i])),
            (true, Some((s, p))) => open = Some((s, p + b[i] - a[i])),
            (false, Some((s, p))) => {
                out.push(([f[s], f[i - 1]], p));
                open = None;
            }
            _ => {}
        }
    }
    out.retain(|(_, p)| *p > 0.05 * total);
    out.sort_by(|x, y| y.1.total_cmp(&x.1));
    out.truncate(3);
    out.sort_by(|x, y| x.0[0].total_cmp(&y.0[0]));
    out.into_iter().map(|(band, _)| band).collect()
}

/// A signal along the trajectory that a region can be told in.
#[derive(Debug, Clone)]
pub struct Coordinate {
    /// As in `v`, `x1`, `u`.
    pub symbol: String,
    /// Its unit, or nothing.
    pub unit: String,
    /// Whether it is a velocity: small values are then reversals.
    pub velocity: bool,
    /// The signal, as long as the weights.
    pub values: Vec<f64>,
}

/// The region in which the weights are concentrated, in words; `None` where they are spread like the samples.
pub fn region(coordinates: &[Coordinate], weight: &[f64]) -> Option<String> {
    let total: f64 = weight.iter().sum();
    let n = weight.len() as f64;
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    let mut best: Option<(f64, String)> = None;
    for c in coordinates {
        let mut sorted: Vec<f64> = c.values.clone();
        sorted.sort_by(f64::total_cmp);
        let mut absolute: Vec<f64> = c.values.iter().map(|v| v.abs()).collect();
        absolute.sort_by(f64::total_cmp);
        let q = |s: &[f64], p: f64| quantile(s, p).unwrap_or(0.0);
        let scale = q(&absolute, 0.99);
        let number = |x: f64| crate::text::number(x);
        let unit = if c.unit.is_empty() { String::new() } else { format!(" {}", c.unit) };
        let s = &c.symbol;
        let mut offer = |inside: &dyn Fn(f64) -> bool, words: String| {
            let (mut samples, mut share) = (0.0, 0.0);
            for (v, w) in c.values.iter().zip(weight) {
                if inside(*v) {
                    samples += 1.0;
                    share += w;
                }
            }
            let (p, m) = (share / total, samples / n);
            if p <= m || m <= 0.0 || m >= 1.0 {
                return;
            }
            let gain = p * (p / m).ln() + (1.0 - p).max(1e-12) * ((1.0 - p).max(1e-12) / (1.0 - m)).ln();
            if best.as_ref().is_none_or(|(b, _)| gain > *b) {
                best = Some((gain, words));
            }
        };
        for p in [0.1, 0.2, 0.35] {
            let limit = q(&absolute, p);
            if limit > 0.0 && limit < 0.5 * scale {
                let near = if c.velocity { "near velocity reversals, " } else { "" };
                offer(&|v| v.abs() < limit, format!("{near}|{s}| < {}{unit}", number(limit)));
            }
        }
        for p in [0.5, 0.65, 0.8, 0.9, 0.95] {
            let (limit, high, low) = (q(&absolute, p), q(&sorted, p), q(&sorted, 1.0 - p));
            offer(&|v| v.abs() > limit, format!("|{s}| > {}{unit}", number(limit)));
            offer(&|v| v > high, format!("{s} > {}{unit}", number(high)));
            offer(&|v| v < low, format!("{s} < {}{unit}", number(low)));
        }
    }
    best.filter(|(gain, _)| *gain > 0.08).map(|(_, words)| words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evidence_in_one_part_is_found_there() {
        let s = Series { stretch: 0, output: 0, first: 0, rows: 0..1000 };
        let g: Vec<f64> = (0..1000).map(|i| if i >= 600 { (i as f64).sin() } else { 0.0 }).collect();
        let r: Vec<f64> = g.iter().enumerate().map(|(i, g)| 2.0 * g + ((i * 7919) % 13) as f64 / 6.0 - 1.0).collect();
        let a = active_rows(&s, &r, &g);
        assert_eq!(a.len(), 1);
        assert!(a[0].start >= 575 && a[0].start <= 650 && a[0].end == 1000, "{a:?}");
    }

    #[test]
    fn a_region_is_told_in_the_coordinate_that_concentrates_the_weight() {
        let v: Vec<f64> = (0..1000).map(|i| (i as f64 * 0.37).sin()).collect();
        let x: Vec<f64> = (0..1000).map(|i| (i as f64 * 0.11).cos()).collect();
        let c = |symbol: &str, values: &Vec<f64>, velocity| Coordinate {
            symbol: symbol.into(),
            unit: "m".into(),
            velocity,
            values: values.clone(),
        };
        let weight: Vec<f64> = x.iter().map(|x| if *x > 0.9 { 1.0 } else { 0.01 }).collect();
        let words = region(&[c("v", &v, true), c("x", &x, false)], &weight).unwrap();
        assert!(words.starts_with("x > "), "{words}");
        let weight: Vec<f64> = v.iter().map(|v| if v.abs() < 0.15 { 1.0 } else { 0.01 }).collect();
        let words = region(&[c("v", &v, true), c("x", &x, false)], &weight).unwrap();
        assert!(words.starts_with("near velocity reversals, |v| < 0.1"), "{words}");
        assert!(region(&[c("v", &v, true)], &vec![1.0; 1000]).is_none());
    }

    #[test]
    fn a_band_is_where_the_effect_took_power_away() {
        let n = 4000;
        let before: Vec<f64> = (0..n)
            .map(|i| (2.0 * std::f64::consts::PI * 5.0 * i as f64 * 0.01).sin() + 0.01 * ((i * 7919) % 101) as f64)
            .collect();
        let after: Vec<f64> = (0..n).map(|i| 0.01 * ((i * 7919) % 101) as f64).collect();
        let b = bands(&before, &after, 0.01);
        assert_eq!(b.len(), 1);
        assert!(b[0][0] <= 5.0 && b[0][1] >= 5.0 && b[0][1] - b[0][0] < 2.0, "{b:?}");
    }
}
