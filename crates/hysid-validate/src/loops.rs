//! Loops in the plane of input and output: where each cycle is and what area it encloses.

use hysid_signal::{Segment, Turn, turning_points};

/// One cycle of the input, from one minimum to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct Loop {
    /// Its samples; the last is the minimum that closes the cycle.
    pub range: Segment,
    /// Signed area, the integral of y du once around, in the product of the units of `u` and `y`. Where `u` is a displacement and `y` the force
    /// that moves it, this is the energy lost in the cycle (above 0 for a loop run through clockwise). An output that lags its input gives
    /// a negative area.
    pub area: f64,
    /// Largest minus smallest input in the cycle.
    pub width: f64,
    /// Largest minus smallest output in the cycle.
    pub height: f64,
    /// How far the output is from where the cycle began, in the unit of `y`: 0 for a closed loop.
    pub gap: f64,
}

/// The loops of a recording: one for each cycle of `u` between minima that stand out by more than `threshold` (in the unit of `u`).
///
/// A cycle with a missing sample is left out. The area is by the trapezoidal rule, with the loop closed by a straight line.
pub fn loop_areas(u: &[f64], y: &[f64], threshold: f64) -> Vec<Loop> {
    let minima: Vec<usize> =
        turning_points(u, threshold).iter().filter(|p| p.turn == Turn::Minimum).map(|p| p.index).collect();
    minima
        .windows(2)
        .filter_map(|pair| {
            let range = pair[0]..pair[1] + 1;
            let (u, y) = (u.get(range.clone())?, y.get(range.clone())?);
            if u.iter().chain(y).any(|x| !x.is_finite()) {
                return None;
            }
            let next = |i: usize| (i + 1) % u.len();
            let area = (0..u.len()).map(|i| 0.5 * (y[i] + y[next(i)]) * (u[next(i)] - u[i])).sum();
            let extent =
                |x: &[f64]| x.iter().copied().fold(f64::MIN, f64::max) - x.iter().copied().fold(f64::MAX, f64::min);
            let gap = y.last()? - y.first()?;
            Some(Loop { range, area, width: extent(u), height: extent(y), gap })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_of_an_ellipse() {
        let wave = |lag: f64| (0..4000).map(|n| (n as f64 * 0.01 - lag).sin()).collect::<Vec<f64>>();
        for (lag, sign) in [(0.4, -1.0), (-0.4, 1.0)] {
            // u = sin t, y = 2 sin(t - lag): the integral of y du over a period is -2 pi sin(lag).
            let y: Vec<f64> = wave(lag).iter().map(|y| 2.0 * y).collect();
            let loops = loop_areas(&wave(0.0), &y, 0.1);
            assert_eq!(loops.len(), 5);
            for l in &loops {
                let expected = sign * std::f64::consts::TAU * 0.4_f64.sin();
                assert!((l.area - expected).abs() < 1e-3, "{} {expected}", l.area);
                assert!((l.width - 2.0).abs() < 1e-3 && (l.height - 4.0).abs() < 1e-3 && l.gap.abs() < 0.02);
            }
        }
    }

    #[test]
    fn a_function_without_memory_has_no_area_and_a_gap_is_left_out() {
        let u: Vec<f64> = (0..3000).map(|n| (n as f64 * 0.01).sin()).collect();
        let mut y: Vec<f64> = u.iter().map(|u| u.powi(3) + u).collect();
        let loops = loop_areas(&u, &y, 0.1);
        assert!(loops.iter().all(|l| l.area.abs() < 1e-4));
        y[700] = f64::NAN;
        assert_eq!(loop_areas(&u, &y, 0.1).len(), loops.len() - 1);
    }
}
