//! The kernel of a selection: inner products of rows with columns over one tile of samples.
//!
//! out\[row + l\] += sum over t of a_row\[t\] x_l\[t\], in register blocks of rows and columns. Sums are kept as eight
//! interleaved partial sums, added up by [`total`] at the end.
//!
//! The same source is compiled for AVX-512, for AVX2 with FMA and for the baseline, and chosen at run time. Results differ
//! in the last bits between such machines (fused against separate rounding), never between numbers of threads.

/// Runs a kernel in the form for a machine, inside a function that has the processor features which that form needs.
macro_rules! in_form_of {
    ($machine:expr, $kernel:ident($($argument:ident: $kind:ty),*)) => {{
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,fma")]
        fn wide($($argument: $kind),*) {
            // SAFETY: this function has the features that the form needs.
            unsafe { $kernel::<x86::Wide>($($argument),*) }
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,fma")]
        fn fused($($argument: $kind),*) {
            // SAFETY: as above.
            unsafe { $kernel::<x86::Fused>($($argument),*) }
        }
        match $machine {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `detect` returned this form because the processor has these features.
            Machine::Wide => unsafe { wide($($argument),*) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Machine::Fused => unsafe { fused($($argument),*) },
            // SAFETY: the plain form needs nothing of the processor.
            _ => unsafe { $kernel::<Plain>($($argument),*) },
        }
    }};
}

mod columns;
mod form;

pub use self::columns::{reflect, subtract_multiples};
#[cfg(target_arch = "x86_64")]
use self::form::x86;
use self::form::{Form, Plain};

/// Samples in a [`Lane`].
pub const LANE: usize = 8;

/// Eight neighbouring samples, aligned to a cache line.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(64))]
pub struct Lane(pub [f64; LANE]);

/// The samples of lanes as plain numbers.
pub fn flat(lanes: &[Lane]) -> &[f64] {
    // SAFETY: a lane is eight doubles and nothing else.
    unsafe { std::slice::from_raw_parts(lanes.as_ptr().cast(), lanes.len() * LANE) }
}

/// The samples of lanes as plain numbers: a buffer that begins at a cache line, which stores into it want.
pub fn flat_mut(lanes: &mut [Lane]) -> &mut [f64] {
    // SAFETY: as above.
    unsafe { std::slice::from_raw_parts_mut(lanes.as_mut_ptr().cast(), lanes.len() * LANE) }
}

/// The sum of the eight.
pub fn total(lane: &Lane) -> f64 {
    let s = &lane.0;
    ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]))
}

/// Copies samples into lanes; places beyond the end of `from` are zero.
pub fn pack(from: &[f64], to: &mut [Lane]) {
    let mut chunks = from.chunks_exact(LANE);
    let mut lanes = to.iter_mut();
    for (chunk, lane) in chunks.by_ref().zip(lanes.by_ref()) {
        lane.0.copy_from_slice(chunk);
    }
    let rest = chunks.remainder();
    if let Some(lane) = lanes.next() {
        *lane = Lane::default();
        for (l, r) in lane.0.iter_mut().zip(rest) {
            *l = *r;
        }
    }
    for lane in lanes {
        *lane = Lane::default();
    }
}

/// Which form of the kernel this machine runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Machine {
    /// AVX-512.
    Wide,
    /// AVX2 with FMA.
    Fused,
    /// Whatever the compiler's baseline is.
    Plain,
}

impl Machine {
    /// The best form that this machine can run.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("fma") {
                return Self::Wide;
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                return Self::Fused;
            }
        }
        Self::Plain
    }
}

/// A row of the left factor: where its samples and its sums lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row {
    /// Its first lane in `left`.
    pub from: usize,
    /// The lane of `out` that receives its product with the first column; the next columns follow.
    pub to: usize,
}

/// Inner products over a tile of `t` lanes: `out[row.to + l]` grows by row times column l.
pub struct Step<'a> {
    /// Lanes in a tile.
    pub t: usize,
    /// The rows.
    pub rows: &'a [Row],
    /// The samples of the rows.
    pub left: &'a [Lane],
    /// First sample in `right` of each column, of any alignment: columns may overlap (lags of one series).
    pub columns: &'a [u32],
    /// The samples of the columns.
    pub right: &'a [f64],
    /// Partial sums.
    pub out: &'a mut [Lane],
}

impl Step<'_> {
    /// Runs the step on the form of the kernel for `machine`.
    pub fn run(self, machine: Machine) {
        let work = self;
        in_form_of!(machine, step(work: Step<'_>));
    }
}

/// Products of a tile with as many samples of a series, whatever their alignment.
///
/// # Panics
/// When `b` has fewer samples than `a`.
pub fn multiply(a: &[Lane], b: &[f64], out: &mut [Lane], machine: Machine) {
    assert!(b.len() >= a.len() * LANE, "{} samples for {} lanes", b.len(), a.len());
    in_form_of!(machine, multiply_in(a: &[Lane], b: &[f64], out: &mut [Lane]));
}

/// # Safety
/// As for [`Form`].
#[inline(always)]
unsafe fn multiply_in<F: Form>(a: &[Lane], b: &[f64], out: &mut [Lane]) {
    for ((o, a), b) in out.iter_mut().zip(a).zip(b.chunks_exact(LANE)) {
        // SAFETY: the caller's; a chunk has the samples of a lane.
        unsafe { F::store(F::mul(F::load(a), F::load_any(b.as_ptr())), o) };
    }
}

/// # Safety
/// As for [`Form`].
#[inline(always)]
unsafe fn step<F: Form>(step: Step<'_>) {
    let Step { t, mut rows, left, columns, right, out } = step;
    // Rows and columns are cut into blocks as equal as they can be: a rest of one row would keep most of the registers idle.
    let mut blocks = rows.len().div_ceil(F::BLOCK.len());
    while !rows.is_empty() {
        let high = rows.len().div_ceil(blocks);
        blocks -= 1;
        let most = F::BLOCK[high - 1];
        let (mut at, mut parts) = (0, columns.len().div_ceil(most));
        while at < columns.len() {
            let c = &columns[at..];
            let wide = c.len().div_ceil(parts);
            parts -= 1;
            macro_rules! shapes {
                ($($k:literal: $($l:literal)*;)*) => {
                    match (high, wide) {
                        // Shapes that a form does not have are left out when it is compiled. SAFETY: the caller's.
                        $($(($k, $l) if F::BLOCK.len() >= $k && F::BLOCK[$k - 1] >= $l => unsafe {
                            block::<F, $k, $l>(t, rows, at, left, c, right, out)
                        },)*)*
                        _ => unreachable!("{high} x {wide}"),
                    }
                };
            }
            shapes! {
                1: 1 2 3 4 5 6 7 8; 2: 1 2 3 4 5 6 7 8; 3: 1 2 3 4 5 6 7; 4: 1 2 3 4 5 6;
                5: 1 2 3 4 5; 6: 1 2 3 4; 7: 1 2 3; 8: 1 2 3;
            };
            at += wide;
        }
        rows = &rows[high..];
    }
}

/// Steps of a block's loop that are written out.
const UNROLL: usize = 4;

/// One register block: the first `K` rows and the first `L` of `columns`, which are columns `at..` of the step.
///
/// # Safety
/// As for [`Form`].
#[inline(always)]
unsafe fn block<F: Form, const K: usize, const L: usize>(
    t: usize,
    rows: &[Row],
    at: usize,
    left: &[Lane],
    columns: &[u32],
    right: &[f64],
    out: &mut [Lane],
) {
    let a: [&[Lane]; K] = std::array::from_fn(|i| &left[rows[i].from..rows[i].from + t]);
    let x: [&[f64]; L] = std::array::from_fn(|l| &right[columns[l] as usize..columns[l] as usize + t * LANE]);
    // SAFETY: the caller's; all slices have t lanes.
    unsafe {
        let zero = F::load(&Lane([0.0; LANE]));
        let mut sums = [[zero; L]; K];
        let mut s = 0;
        // Not a closure: that would not be compiled for the form's processor.
        macro_rules! add {
            () => {
                let b: [F::V; L] = std::array::from_fn(|l| F::load_any(x[l].as_ptr().add(s * LANE)));
                for i in 0..K {
                    let w = F::load(a[i].get_unchecked(s));
                    for l in 0..L {
                        sums[i][l] = F::mul_add(w, b[l], sums[i][l]);
                    }
                }
                s += 1;
            };
        }
        while s + UNROLL <= t {
            for _ in 0..UNROLL {
                add!();
            }
        }
        while s < t {
            add!();
        }
        for i in 0..K {
            let out = &mut out[rows[i].to + at..rows[i].to + at + L];
            for l in 0..L {
                F::store(F::add(F::load(&out[l]), sums[i][l]), &mut out[l]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_of_the_kernel_agrees_with_the_definition() {
        let t = 5;
        let value = |i: usize| ((i * 7919 + 3) % 1013) as f64 / 500.0 - 1.0;
        let lanes = |n: usize, from: usize| -> Vec<Lane> {
            (0..n).map(|i| Lane(std::array::from_fn(|e| value(from + i * LANE + e)))).collect()
        };
        let tile: Vec<f64> = (0..20 * (t * LANE - 3)).map(|i| value(17 + i)).collect();
        let mut machines = vec![Machine::Plain];
        if Machine::detect() != Machine::Plain {
            machines.push(Machine::Fused);
        }
        if Machine::detect() == Machine::Wide {
            machines.push(Machine::Wide);
        }
        for (k, n) in [
            (1, 1),
            (1, 19),
            (2, 7),
            (3, 13),
            (4, 6),
            (7, 20),
            (8, 17),
            (15, 3),
            (9, 4),
            (12, 5),
            (5, 9),
            (6, 4),
            (7, 7),
            (3, 8),
        ] {
            let left = lanes(k * t, 5000);
            // Columns that overlap, at odd places.
            let columns: Vec<u32> = (0..n).map(|i| (i * (t * LANE - 5)) as u32).collect();
            let rows: Vec<Row> = (0..k).map(|i| Row { from: i * t, to: i * n }).collect();
            for &machine in &machines {
                let mut out = vec![Lane::default(); n * k];
                Step { t, rows: &rows, left: &left, columns: &columns, right: &tile, out: &mut out }.run(machine);
                for l in 0..n {
                    for c in 0..k {
                        let at = |lanes: &[Lane], from: usize, s: usize| lanes[from + s / LANE].0[s % LANE];
                        let expected: f64 =
                            (0..t * LANE).map(|s| at(&left, c * t, s) * tile[columns[l] as usize + s]).sum();
                        let found = total(&out[c * n + l]);
                        assert!((found - expected).abs() < 1e-12, "{machine:?} {k} x {n}: {found} {expected}");
                    }
                }
            }
        }
    }

    #[test]
    fn lanes_are_eight_doubles_and_nothing_else() {
        let mut lanes = [Lane([1.0; LANE]), Lane([2.0; LANE])];
        flat_mut(&mut lanes)[LANE] = 5.0;
        assert_eq!(lanes[1].0[0], 5.0);
        assert_eq!((flat(&lanes).len(), flat(&lanes)[LANE + 1]), (2 * LANE, 2.0));
        assert_eq!(flat(&[]).len(), 0);
    }

    #[test]
    fn packing_fills_up_with_zeros() {
        let mut to = vec![Lane([9.0; LANE]); 3];
        pack(&[1.0; 11], &mut to);
        assert_eq!(to[1].0, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(to[2].0, [0.0; LANE]);
    }
}
