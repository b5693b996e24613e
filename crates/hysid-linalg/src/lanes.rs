//! The kernel of a selection: sums over samples of products of a prefix, several weights and several last factors.
//!
//! For one tile of samples, out\[l, c\] += sum over t of p\[t\] w_c\[t\] x_l\[t\]: the prefix is multiplied into the weights once, the
//! rest is one fused multiply-add for each weight, factor and sample, in register blocks. Sums are kept as eight
//! interleaved partial sums, added up by [`total`] at the end.
//!
//! The same source is compiled for AVX-512, for AVX2 with FMA and for the baseline, and chosen at run time. Results differ
//! in the last bits between such machines (fused against separate rounding), never between numbers of threads.

/// Samples in a [`Lane`].
pub const LANE: usize = 8;

/// Eight neighbouring samples, aligned to a cache line.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(64))]
pub struct Lane(pub [f64; LANE]);

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

/// One step of the kernel over a tile of `t` lanes.
///
/// `prefix` (t lanes) is the product that all these terms share, `None` for 1; `weights` holds `k` weights of t lanes one after
/// the other; `factors[i]` is the range of lanes in `tile` where the i-th last factor lies; `scratch` has room for
/// k * t lanes; `out[i * k + c]` receives factor i with weight c.
pub struct Step<'a> {
    /// Lanes in a tile.
    pub t: usize,
    /// Number of weights.
    pub k: usize,
    /// The shared product; `None` is 1.
    pub prefix: Option<&'a [Lane]>,
    /// The weights, one after the other.
    pub weights: &'a [Lane],
    /// Where the last factors lie.
    pub tile: &'a [Lane],
    /// First lane in `tile` of each last factor.
    pub factors: &'a [u32],
    /// Room for the weighted prefix.
    pub scratch: &'a mut [Lane],
    /// Partial sums.
    pub out: &'a mut [Lane],
}

impl Step<'_> {
    /// Runs the step on the form of the kernel for `machine`.
    pub fn run(self, machine: Machine) {
        match machine {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `detect` returned this form because the processor has these features.
            Machine::Wide => unsafe { wide(self) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Machine::Fused => unsafe { fused(self) },
            // SAFETY: the plain form needs nothing of the processor.
            _ => unsafe { step::<Plain>(self) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,fma")]
fn wide(s: Step<'_>) {
    // SAFETY: this function has the features that the form needs.
    unsafe { step::<x86::Wide>(s) }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn fused(s: Step<'_>) {
    // SAFETY: this function has the features that the form needs.
    unsafe { step::<x86::Fused>(s) }
}

/// Products of two tiles, lane by lane.
pub fn multiply(a: &[Lane], b: &[Lane], out: &mut [Lane], machine: Machine) {
    match machine {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `detect` returned this form because the processor has these features.
        Machine::Wide => unsafe { multiply_wide(a, b, out) },
        // A product is the same in every form.
        _ => unsafe { multiply_in::<Plain>(a, b, out) },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,fma")]
fn multiply_wide(a: &[Lane], b: &[Lane], out: &mut [Lane]) {
    // SAFETY: this function has the features that the form needs.
    unsafe { multiply_in::<x86::Wide>(a, b, out) }
}

/// Arithmetic on a lane in registers of one kind of processor.
///
/// # Safety
/// The functions may only run, inlined, inside a function that has the processor features of the form.
trait Form {
    /// A lane in registers.
    type V: Copy;
    /// Last factors in a register block of four weights, and in one of fewer.
    const BLOCK: (usize, usize);
    unsafe fn load(from: &Lane) -> Self::V;
    unsafe fn store(v: Self::V, to: &mut Lane);
    unsafe fn mul(a: Self::V, b: Self::V) -> Self::V;
    unsafe fn add(a: Self::V, b: Self::V) -> Self::V;
    unsafe fn mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V;
}

/// What the compiler makes of it.
struct Plain;

impl Form for Plain {
    type V = Lane;
    const BLOCK: (usize, usize) = (1, 2);
    #[inline(always)]
    unsafe fn load(from: &Lane) -> Lane {
        *from
    }
    #[inline(always)]
    unsafe fn store(v: Lane, to: &mut Lane) {
        *to = v;
    }
    #[inline(always)]
    unsafe fn mul(a: Lane, b: Lane) -> Lane {
        Lane(std::array::from_fn(|e| a.0[e] * b.0[e]))
    }
    #[inline(always)]
    unsafe fn add(a: Lane, b: Lane) -> Lane {
        Lane(std::array::from_fn(|e| a.0[e] + b.0[e]))
    }
    #[inline(always)]
    unsafe fn mul_add(a: Lane, b: Lane, c: Lane) -> Lane {
        Lane(std::array::from_fn(|e| a.0[e] * b.0[e] + c.0[e]))
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    //! The forms for x86-64.

    use std::arch::x86_64::*;

    use super::{Form, Lane};

    pub struct Wide;

    impl Form for Wide {
        type V = __m512d;
        const BLOCK: (usize, usize) = (6, 8);
        #[inline(always)]
        unsafe fn load(from: &Lane) -> __m512d {
            // SAFETY: a lane is 64 bytes, aligned to 64.
            unsafe { _mm512_load_pd(from.0.as_ptr()) }
        }
        #[inline(always)]
        unsafe fn store(v: __m512d, to: &mut Lane) {
            // SAFETY: as for `load`.
            unsafe { _mm512_store_pd(to.0.as_mut_ptr(), v) }
        }
        #[inline(always)]
        unsafe fn mul(a: __m512d, b: __m512d) -> __m512d {
            unsafe { _mm512_mul_pd(a, b) }
        }
        #[inline(always)]
        unsafe fn add(a: __m512d, b: __m512d) -> __m512d {
            unsafe { _mm512_add_pd(a, b) }
        }
        #[inline(always)]
        unsafe fn mul_add(a: __m512d, b: __m512d, c: __m512d) -> __m512d {
            unsafe { _mm512_fmadd_pd(a, b, c) }
        }
    }

    pub struct Fused;

    impl Form for Fused {
        type V = (__m256d, __m256d);
        const BLOCK: (usize, usize) = (1, 2);
        #[inline(always)]
        unsafe fn load(from: &Lane) -> Self::V {
            let p = from.0.as_ptr();
            // SAFETY: a lane is eight doubles, aligned to 64.
            unsafe { (_mm256_load_pd(p), _mm256_load_pd(p.add(4))) }
        }
        #[inline(always)]
        unsafe fn store(v: Self::V, to: &mut Lane) {
            let p = to.0.as_mut_ptr();
            // SAFETY: as for `load`.
            unsafe {
                _mm256_store_pd(p, v.0);
                _mm256_store_pd(p.add(4), v.1);
            }
        }
        #[inline(always)]
        unsafe fn mul(a: Self::V, b: Self::V) -> Self::V {
            unsafe { (_mm256_mul_pd(a.0, b.0), _mm256_mul_pd(a.1, b.1)) }
        }
        #[inline(always)]
        unsafe fn add(a: Self::V, b: Self::V) -> Self::V {
            unsafe { (_mm256_add_pd(a.0, b.0), _mm256_add_pd(a.1, b.1)) }
        }
        #[inline(always)]
        unsafe fn mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V {
            unsafe { (_mm256_fmadd_pd(a.0, b.0, c.0), _mm256_fmadd_pd(a.1, b.1, c.1)) }
        }
    }
}

/// # Safety
/// As for [`Form`].
#[inline(always)]
unsafe fn multiply_in<F: Form>(a: &[Lane], b: &[Lane], out: &mut [Lane]) {
    for ((o, a), b) in out.iter_mut().zip(a).zip(b) {
        unsafe { F::store(F::mul(F::load(a), F::load(b)), o) };
    }
}

/// # Safety
/// As for [`Form`].
#[inline(always)]
unsafe fn step<F: Form>(step: Step<'_>) {
    let Step { t, k, prefix, weights, tile, factors, scratch, out } = step;
    let weighted: &[Lane] = match prefix {
        None => &weights[..k * t],
        Some(p) => {
            for (s, w) in scratch[..k * t].chunks_exact_mut(t).zip(weights.chunks_exact(t)) {
                unsafe { multiply_in::<F>(&p[..t], w, s) };
            }
            &scratch[..k * t]
        }
    };
    let n = factors.len();
    let mut c = 0;
    while c < k {
        let wide = if k - c >= 4 {
            4
        } else if k - c >= 2 {
            2
        } else {
            1
        };
        let most = if wide == 4 { F::BLOCK.0 } else { F::BLOCK.1 };
        let mut at = 0;
        while at < n {
            let (f, o) = (&factors[at..], &mut out[at * k..]);
            let w = &weighted[c * t..];
            let left = (n - at).min(most);
            // SAFETY: the caller's.
            at += unsafe {
                match (wide, left) {
                    (4, 6..) => block::<F, 4, 6>(t, k, c, w, tile, f, o),
                    (4, 4..) => block::<F, 4, 4>(t, k, c, w, tile, f, o),
                    (4, 2..) => block::<F, 4, 2>(t, k, c, w, tile, f, o),
                    (4, _) => block::<F, 4, 1>(t, k, c, w, tile, f, o),
                    (2, 8..) => block::<F, 2, 8>(t, k, c, w, tile, f, o),
                    (2, 4..) => block::<F, 2, 4>(t, k, c, w, tile, f, o),
                    (2, 2..) => block::<F, 2, 2>(t, k, c, w, tile, f, o),
                    (2, _) => block::<F, 2, 1>(t, k, c, w, tile, f, o),
                    (_, 8..) => block::<F, 1, 8>(t, k, c, w, tile, f, o),
                    (_, 4..) => block::<F, 1, 4>(t, k, c, w, tile, f, o),
                    (_, 2..) => block::<F, 1, 2>(t, k, c, w, tile, f, o),
                    (_, _) => block::<F, 1, 1>(t, k, c, w, tile, f, o),
                }
            };
        }
        c += wide;
    }
}

/// One register block: `K` weights from the first lanes of `weighted` on, `L` factors; returns `L`.
///
/// # Safety
/// As for [`Form`].
#[inline(always)]
unsafe fn block<F: Form, const K: usize, const L: usize>(
    t: usize,
    k: usize,
    c: usize,
    weighted: &[Lane],
    tile: &[Lane],
    factors: &[u32],
    out: &mut [Lane],
) -> usize {
    let w: [&[Lane]; K] = std::array::from_fn(|i| &weighted[i * t..(i + 1) * t]);
    let x: [&[Lane]; L] = std::array::from_fn(|l| {
        let from = factors[l] as usize;
        &tile[from..from + t]
    });
    // SAFETY: the caller's; all slices have t lanes.
    unsafe {
        let zero = F::load(&Lane([0.0; LANE]));
        let mut sums = [[zero; L]; K];
        for s in 0..t {
            let a: [F::V; K] = std::array::from_fn(|i| F::load(w[i].get_unchecked(s)));
            for l in 0..L {
                let b = F::load(x[l].get_unchecked(s));
                for i in 0..K {
                    sums[i][l] = F::mul_add(a[i], b, sums[i][l]);
                }
            }
        }
        for l in 0..L {
            for i in 0..K {
                let o = &mut out[l * k + c + i];
                F::store(F::add(F::load(o), sums[i][l]), o);
            }
        }
    }
    L
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
        let tile = lanes(20 * t, 17);
        let p = lanes(t, 900);
        let mut machines = vec![Machine::Plain];
        if Machine::detect() != Machine::Plain {
            machines.push(Machine::Fused);
        }
        if Machine::detect() == Machine::Wide {
            machines.push(Machine::Wide);
        }
        for (k, n) in [(1, 1), (1, 19), (2, 7), (3, 13), (4, 6), (7, 20), (8, 17), (5, 3)] {
            let weights = lanes(k * t, 5000);
            let factors: Vec<u32> = (0..n).map(|i| (i * t) as u32).collect();
            for &machine in &machines {
                for prefix in [None, Some(&p[..])] {
                    let mut out = vec![Lane::default(); n * k];
                    let mut scratch = vec![Lane::default(); k * t];
                    let (weights, tile, factors) = (&weights[..], &tile[..], &factors[..]);
                    Step { t, k, prefix, weights, tile, factors, scratch: &mut scratch, out: &mut out }.run(machine);
                    for l in 0..n {
                        for c in 0..k {
                            let expected: f64 = (0..t * LANE)
                                .map(|s| {
                                    let at = |lanes: &[Lane], from: usize| lanes[from + s / LANE].0[s % LANE];
                                    prefix.map_or(1.0, |p| at(p, 0)) * at(weights, c * t) * at(tile, l * t)
                                })
                                .sum();
                            let found = total(&out[l * k + c]);
                            assert!((found - expected).abs() < 1e-12, "{machine:?} k={k} n={n}: {found} {expected}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn packing_fills_up_with_zeros() {
        let mut to = vec![Lane([9.0; LANE]); 3];
        pack(&[1.0; 11], &mut to);
        assert_eq!(to[1].0, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(to[2].0, [0.0; LANE]);
    }
}
