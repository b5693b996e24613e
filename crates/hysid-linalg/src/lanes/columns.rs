//! One vector against columns that lie one after the other: the reflections of a QR factorisation, and differences of many multiples.
//!
//! Products and sums are rounded apart and taken in the order of the plain loops, whatever the processor: the bits are those of
//! [`dot`](crate::dot) and of `y -= a x` for one column after the other. Several columns are under way at a time, so that no addition
//! waits for the one before.

#[cfg(target_arch = "x86_64")]
use super::form::x86;
use super::form::{Form, Plain};
use super::{LANE, Lane, Machine};

/// Columns that are under way at a time.
const TOGETHER: usize = 4;
/// Lanes of a vector that stay in registers while all columns pass.
const HELD: usize = 8;

/// Reflects columns, each as long as `x`, with what stands above each in `tops`: with s = (top v0 + x'y) scale, y -= s x and
/// top -= s v0 for a column y.
///
/// # Panics
/// When there are fewer columns than tops.
pub fn reflect(v0: f64, scale: f64, x: &[f64], tops: &mut [f64], columns: &mut [f64]) {
    let columns = &mut columns[..tops.len() * x.len()];
    in_form_of!(Machine::detect(), reflect_in(v0: f64, scale: f64, x: &[f64], tops: &mut [f64], columns: &mut [f64]));
}

/// # Safety
/// As for [`Form`].
#[inline(always)]
unsafe fn reflect_in<F: Form>(v0: f64, scale: f64, x: &[f64], tops: &mut [f64], columns: &mut [f64]) {
    let rows = x.len();
    for (tops, columns) in tops.chunks_mut(TOGETHER).zip(columns.chunks_mut(TOGETHER * rows.max(1))) {
        // SAFETY: the caller's.
        unsafe {
            match tops {
                [_, _, _, _] => reflect_some::<F, 4>(v0, scale, x, tops, columns),
                [_, _, _] => reflect_some::<F, 3>(v0, scale, x, tops, columns),
                [_, _] => reflect_some::<F, 2>(v0, scale, x, tops, columns),
                _ => reflect_some::<F, 1>(v0, scale, x, tops, columns),
            }
        }
    }
}

/// # Safety
/// As for [`Form`]; `C` tops and columns.
#[allow(clippy::needless_range_loop, reason = "places in registers, not a walk through an array")]
#[inline(always)]
unsafe fn reflect_some<F: Form, const C: usize>(v0: f64, scale: f64, x: &[f64], tops: &mut [f64], columns: &mut [f64]) {
    let rows = x.len();
    assert!(tops.len() == C && columns.len() == C * rows, "{} tops of {C} columns", tops.len());
    let (pairs, lanes) = (rows / (2 * LANE), rows / LANE);
    // SAFETY: the caller's; the lanes lie within the columns.
    unsafe {
        let zero = F::load(&Lane([0.0; LANE]));
        let mut sums = [[zero; 2]; C];
        for p in 0..pairs {
            for h in 0..2 {
                let at = (2 * p + h) * LANE;
                let a = F::load_any(x.as_ptr().add(at));
                for c in 0..C {
                    let y = F::load_any(columns.as_ptr().add(c * rows + at));
                    sums[c][h] = F::add(sums[c][h], F::mul(a, y));
                }
            }
        }
        for c in 0..C {
            let y = &mut columns[c * rows..(c + 1) * rows];
            let from = pairs * 2 * LANE;
            let rest: f64 = x[from..].iter().zip(&y[from..]).map(|(x, y)| x * y).sum();
            let mut halves = Lane::default();
            F::store(F::add(sums[c][0], sums[c][1]), &mut halves);
            for half in [4, 2, 1] {
                for k in 0..half {
                    halves.0[k] += halves.0[k + half];
                }
            }
            let s = (v0 * tops[c] + (halves.0[0] + rest)) * scale;
            tops[c] -= s * v0;
            let minus = F::load(&Lane([-s; LANE]));
            for l in 0..lanes {
                let at = y.as_mut_ptr().add(l * LANE);
                let share = F::mul(minus, F::load_any(x.as_ptr().add(l * LANE)));
                F::store_any(F::add(F::load_any(at), share), at);
            }
            for (y, x) in y.iter_mut().zip(x).skip(lanes * LANE) {
                *y -= s * x;
            }
        }
    }
}

/// y -= a_1 x_1, then y -= a_2 x_2, ...: the columns x are each as long as `y`, and there are at least as many as factors.
///
/// # Panics
/// When there are fewer columns than factors.
pub fn subtract_multiples(a: &[f64], columns: &[f64], y: &mut [f64]) {
    let columns = &columns[..a.len() * y.len()];
    in_form_of!(Machine::detect(), subtract_in(a: &[f64], columns: &[f64], y: &mut [f64]));
}

/// # Safety
/// As for [`Form`].
#[allow(clippy::needless_range_loop, reason = "places in registers, not a walk through an array")]
#[inline(always)]
unsafe fn subtract_in<F: Form>(a: &[f64], columns: &[f64], y: &mut [f64]) {
    let rows = y.len();
    assert!(columns.len() == a.len() * rows, "{} factors of columns of {rows}", a.len());
    let blocks = rows / (HELD * LANE);
    // SAFETY: the caller's; the lanes lie within y and the columns.
    unsafe {
        for block in 0..blocks {
            let at = block * HELD * LANE;
            let mut held: [F::V; HELD] = std::array::from_fn(|l| F::load_any(y.as_ptr().add(at + l * LANE)));
            for (c, a) in a.iter().enumerate() {
                let minus = F::load(&Lane([-a; LANE]));
                let x = columns.as_ptr().add(c * rows + at);
                for l in 0..HELD {
                    held[l] = F::add(held[l], F::mul(minus, F::load_any(x.add(l * LANE))));
                }
            }
            for l in 0..HELD {
                F::store_any(held[l], y.as_mut_ptr().add(at + l * LANE));
            }
        }
    }
    let done = blocks * HELD * LANE;
    for (a, x) in a.iter().zip(columns.chunks_exact(rows.max(1))) {
        for (y, x) in y.iter_mut().zip(x).skip(done) {
            *y -= a * x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dot;

    #[test]
    fn columns_taken_together_are_those_taken_one_by_one_to_the_bit() {
        let value = |i: usize| ((i * 7919 + 3) % 1013) as f64 / 500.0 - 1.0;
        for (rows, count) in [(1, 1), (15, 3), (64, 4), (70, 5), (256, 9), (300, 0)] {
            let x: Vec<f64> = (0..rows).map(value).collect();
            let columns: Vec<f64> = (0..rows * count).map(|i| value(i + 400)).collect();
            let tops: Vec<f64> = (0..count).map(|i| value(i + 800)).collect();
            let (mut reflected, mut above) = (columns.clone(), tops.clone());
            reflect(1.5, -0.7, &x, &mut above, &mut reflected);
            let (mut y, mut left) = (x.clone(), x.clone());
            subtract_multiples(&tops, &columns, &mut left);
            for (c, column) in columns.chunks_exact(rows).enumerate() {
                let s = (1.5 * tops[c] + dot(&x, column)) * -0.7;
                assert_eq!(above[c], tops[c] - s * 1.5, "{rows} x {count}");
                for (i, (v, x)) in column.iter().zip(&x).enumerate() {
                    assert_eq!(reflected[c * rows + i], v - s * x, "{rows} x {count}");
                    y[i] -= tops[c] * v;
                }
            }
            assert_eq!(left, y, "{rows} x {count}");
        }
    }
}
