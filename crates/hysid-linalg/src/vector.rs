//! Plain loops over vectors, compiled for AVX-512 too and chosen at run time; the arithmetic is the same in both forms.

/// What a vector is stored in, in single precision or in double; sums are in double precision.
pub trait Stored: Copy + Into<f64> {}
impl Stored for f32 {}
impl Stored for f64 {}

/// Writes a function in both forms: the loop, compiled for the baseline and for AVX-512.
macro_rules! both_forms {
    ($(#[$doc:meta])* pub fn $name:ident $(<$of:ident: $bound:ident>)? ($($arg:ident: $type:ty),*) $(-> $out:ty)? $body:block) => {
        $(#[$doc])*
        pub fn $name $(<$of: $bound>)? ($($arg: $type),*) $(-> $out)? {
            #[inline(always)]
            fn plain $(<$of: $bound>)? ($($arg: $type),*) $(-> $out)? $body
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f")]
            fn wide $(<$of: $bound>)? ($($arg: $type),*) $(-> $out)? {
                plain($($arg),*)
            }
            #[cfg(target_arch = "x86_64")]
            if is_x86_feature_detected!("avx512f") {
                // SAFETY: the processor has the feature.
                return unsafe { wide($($arg),*) };
            }
            plain($($arg),*)
        }
    };
}

both_forms! {
    /// The inner product of two vectors, in sixteen interleaved partial sums (so that it vectorises and errors grow slowly).
    pub fn dot<A: Stored>(a: &[A], b: &[f64]) -> f64 {
        let n = a.len().min(b.len());
        let (ca, cb) = (a[..n].chunks_exact(16), b[..n].chunks_exact(16));
        let tail: f64 = ca.remainder().iter().zip(cb.remainder()).map(|(&x, y)| x.into() * y).sum();
        let mut s = [0.0; 16];
        for (x, y) in ca.zip(cb) {
            for k in 0..16 {
                s[k] += x[k].into() * y[k];
            }
        }
        for half in [8, 4, 2, 1] {
            for k in 0..half {
                s[k] += s[k + half];
            }
        }
        s[0] + tail
    }
}

both_forms! {
    /// Whether every entry is finite.
    pub fn all_finite(x: &[f64]) -> bool {
        // Without an early end, so that it vectorises.
        x.iter().fold(true, |all, v| all & (v.abs() < f64::INFINITY))
    }
}

both_forms! {
    /// out = a b, entry by entry.
    pub fn product(a: &[f64], b: &[f64], out: &mut [f64]) {
        for ((o, a), b) in out.iter_mut().zip(a).zip(b) {
            *o = a * b;
        }
    }
}

both_forms! {
    /// out = a b for small matrices by rows, every row filled up to `lanes` times eight entries; `b` has as many rows as `a` has columns.
    ///
    /// An entry is the sum over the rows of `b`, in their order, of products that are rounded: the bits are those of the plain loops. What
    /// fills up the rows of `b` fills up those of `out`.
    pub fn product_of_rows(a: &[f64], b: &[[f64; 8]], lanes: usize, out: &mut [[f64; 8]]) {
        for (a, out) in a.chunks_exact(8 * lanes).zip(out.chunks_exact_mut(lanes)) {
            for (l, out) in out.iter_mut().enumerate() {
                let mut sum = [0.0; 8];
                for (a, b) in a.iter().zip(b.chunks_exact(lanes)) {
                    for k in 0..8 {
                        sum[k] += a * b[l][k];
                    }
                }
                *out = sum;
            }
        }
    }
}

both_forms! {
    /// y += a x.
    pub fn axpy<A: Stored>(a: f64, x: &[A], y: &mut [f64]) {
        for (y, &x) in y.iter_mut().zip(x) {
            *y += a * x.into();
        }
    }
}

both_forms! {
    /// Turns complex numbers, `re + i im`, each by its own angle, and returns the sums of what they were.
    pub fn turn(re: &mut [f64], im: &mut [f64], cos: &[f64], sin: &[f64]) -> (f64, f64) {
        let n = re.len().min(im.len()).min(cos.len()).min(sin.len());
        let ((re, im), (cos, sin)) = ((&mut re[..n], &mut im[..n]), (&cos[..n], &sin[..n]));
        let (mut sums, whole) = ([[0.0; 8]; 2], n - n % 8);
        let by = |x: f64, y: f64, cos: f64, sin: f64| (x * cos - y * sin, x * sin + y * cos);
        for (((re, im), cos), sin) in re[..whole]
            .chunks_exact_mut(8)
            .zip(im[..whole].chunks_exact_mut(8))
            .zip(cos[..whole].chunks_exact(8))
            .zip(sin[..whole].chunks_exact(8))
        {
            for k in 0..8 {
                sums[0][k] += re[k];
                sums[1][k] += im[k];
                (re[k], im[k]) = by(re[k], im[k], cos[k], sin[k]);
            }
        }
        let [mut x, mut y] = sums.map(|s| s.iter().sum::<f64>());
        for k in whole..n {
            x += re[k];
            y += im[k];
            (re[k], im[k]) = by(re[k], im[k], cos[k], sin[k]);
        }
        (x, y)
    }
}

both_forms! {
    /// y *= x, entry by entry.
    pub fn multiply_by(x: &[f64], y: &mut [f64]) {
        for (y, x) in y.iter_mut().zip(x) {
            *y *= x;
        }
    }
}

both_forms! {
    /// Turns a column into a unit direction and takes it out: q *= scale, e -= gain q, free -= q^2.
    pub fn take_out(scale: f64, gain: f64, q: &mut [f64], e: &mut [f64], free: &mut [f64]) {
        for ((q, e), f) in q.iter_mut().zip(e).zip(free) {
            *q *= scale;
            *e -= *q * gain;
            *f -= *q * *q;
        }
    }
}

both_forms! {
    /// The sum of (e / max(free, floor))^2.
    pub fn leave_one_out_sum(e: &[f64], free: &[f64], floor: f64) -> f64 {
        let n = e.len().min(free.len());
        let (ce, cf) = (e[..n].chunks_exact(8), free[..n].chunks_exact(8));
        let square = |e: f64, f: f64| {
            let loo = e / if f > floor { f } else { floor };
            loo * loo
        };
        let tail: f64 = ce.remainder().iter().zip(cf.remainder()).map(|(e, f)| square(*e, *f)).sum();
        let mut s = [0.0; 8];
        for (e, f) in ce.zip(cf) {
            for k in 0..8 {
                s[k] += square(e[k], f[k]);
            }
        }
        ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7])) + tail
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_any_length() {
        for n in [0, 1, 7, 8, 15, 16, 33, 100] {
            let a: Vec<f64> = (0..n).map(|i| i as f64).collect();
            let b = vec![2.0; n];
            let expected: f64 = a.iter().sum::<f64>() * 2.0;
            assert_eq!(dot(&a, &b), expected, "{n}");
            let singly: Vec<f32> = (0..n).map(|i| i as f32).collect();
            assert_eq!(dot(&singly, &b), expected, "{n}");
            let (mut y, mut from_single) = (b.clone(), b.clone());
            axpy(-0.3, &a, &mut y);
            axpy(-0.3, &singly, &mut from_single);
            assert_eq!(y, from_single, "{n}");
            let squares: f64 = a.iter().map(|x| x * x / 4.0).sum();
            approx::assert_relative_eq!(leave_one_out_sum(&a, &b, 1e-9), squares, max_relative = 1e-14);
        }
    }

    #[test]
    fn turning_adds_up_the_powers_of_a_root_of_unity() {
        for n in [1_usize, 7, 8, 19] {
            let angles: Vec<f64> = (0..n).map(|i| 0.3 * i as f64).collect();
            let (sin, cos): (Vec<f64>, Vec<f64>) = angles.iter().map(|a| a.sin_cos()).unzip();
            let (mut re, mut im) = (vec![1.0; n], vec![0.0; n]);
            for k in 0..5 {
                let (x, y) = turn(&mut re, &mut im, &cos, &sin);
                let power = |f: fn(f64) -> f64| angles.iter().map(|a| f(f64::from(k) * a)).sum::<f64>();
                approx::assert_abs_diff_eq!(x, power(f64::cos), epsilon = 1e-12);
                approx::assert_abs_diff_eq!(y, power(f64::sin), epsilon = 1e-12);
            }
        }
    }

    #[test]
    fn what_is_not_finite_is_found_wherever_it_is() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for place in [0, 7, 8, 36] {
                let mut x = vec![f64::MAX; 37];
                assert!(all_finite(&x));
                x[place] = bad;
                assert!(!all_finite(&x), "{bad} at {place}");
            }
        }
        assert!(all_finite(&[]));
    }

    #[test]
    fn products_of_small_matrices_are_those_of_the_plain_loops_to_the_bit() {
        let value = |i: usize| ((i * 7919 + 3) % 1013) as f64 / 500.0 - 1.0;
        for n in [1_usize, 3, 7, 8, 9, 17] {
            let lanes = n.div_ceil(8);
            let matrix = |from: usize| -> Vec<[f64; 8]> {
                let entry = |i: usize| if i % (8 * lanes) < n { value(from + i) } else { 0.0 };
                (0..n * lanes).map(|l| std::array::from_fn(|k| entry(8 * l + k))).collect()
            };
            let (a, b, mut out) = (matrix(0), matrix(500), matrix(900));
            product_of_rows(a.as_flattened(), &b, lanes, &mut out);
            let at = |m: &[[f64; 8]], i: usize, j: usize| m[i * lanes + j / 8][j % 8];
            for i in 0..n {
                for j in 0..8 * lanes {
                    let expected: f64 = (0..n).map(|k| at(&a, i, k) * at(&b, k, j)).sum();
                    assert_eq!(at(&out, i, j), if j < n { expected } else { 0.0 }, "{n}: {i} {j}");
                }
            }
        }
    }
}
