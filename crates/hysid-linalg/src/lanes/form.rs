//! The arithmetic of a kernel on one kind of processor: a lane in its registers.

use super::{LANE, Lane};

/// Arithmetic on a lane in registers of one kind of processor.
///
/// # Safety
/// The functions may only run, inlined, inside a function that has the processor features of the form.
pub(super) trait Form {
    /// A lane in registers.
    type V: Copy;
    /// The most columns in a register block of one row, of two, ...; it has no block of more rows than are listed.
    const BLOCK: &[usize];
    unsafe fn load(from: &Lane) -> Self::V;
    /// Eight doubles from anywhere; they must be readable.
    unsafe fn load_any(from: *const f64) -> Self::V;
    unsafe fn store(v: Self::V, to: &mut Lane);
    /// Eight doubles to anywhere; they must be writable.
    unsafe fn store_any(v: Self::V, to: *mut f64);
    unsafe fn mul(a: Self::V, b: Self::V) -> Self::V;
    unsafe fn add(a: Self::V, b: Self::V) -> Self::V;
    unsafe fn mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V;
}

/// What the compiler makes of it.
pub(super) struct Plain;

impl Form for Plain {
    type V = Lane;
    const BLOCK: &[usize] = &[2, 2, 1, 1];
    #[inline(always)]
    unsafe fn load(from: &Lane) -> Lane {
        *from
    }
    #[inline(always)]
    unsafe fn load_any(from: *const f64) -> Lane {
        // SAFETY: the caller's; an array of doubles needs no more alignment than a double.
        Lane(unsafe { *from.cast::<[f64; LANE]>() })
    }
    #[inline(always)]
    unsafe fn store(v: Lane, to: &mut Lane) {
        *to = v;
    }
    #[inline(always)]
    unsafe fn store_any(v: Lane, to: *mut f64) {
        // SAFETY: the caller's; an array of doubles needs no more alignment than a double.
        unsafe { *to.cast::<[f64; LANE]>() = v.0 };
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
pub(super) mod x86 {
    //! The forms for x86-64.

    use std::arch::x86_64::*;

    use super::{Form, Lane};

    pub struct Wide;

    impl Form for Wide {
        type V = __m512d;
        const BLOCK: &[usize] = &[8, 8, 7, 6, 5, 4, 3, 3];
        #[inline(always)]
        unsafe fn load(from: &Lane) -> __m512d {
            // SAFETY: a lane is 64 bytes, aligned to 64.
            unsafe { _mm512_load_pd(from.0.as_ptr()) }
        }
        #[inline(always)]
        unsafe fn load_any(from: *const f64) -> __m512d {
            // SAFETY: the caller's.
            unsafe { _mm512_loadu_pd(from) }
        }
        #[inline(always)]
        unsafe fn store(v: __m512d, to: &mut Lane) {
            // SAFETY: as for `load`.
            unsafe { _mm512_store_pd(to.0.as_mut_ptr(), v) }
        }
        #[inline(always)]
        unsafe fn store_any(v: __m512d, to: *mut f64) {
            // SAFETY: the caller's.
            unsafe { _mm512_storeu_pd(to, v) }
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
        const BLOCK: &[usize] = &[4, 2, 1, 1];
        #[inline(always)]
        unsafe fn load(from: &Lane) -> Self::V {
            let p = from.0.as_ptr();
            // SAFETY: a lane is eight doubles, aligned to 64.
            unsafe { (_mm256_load_pd(p), _mm256_load_pd(p.add(4))) }
        }
        #[inline(always)]
        unsafe fn load_any(from: *const f64) -> Self::V {
            // SAFETY: the caller's.
            unsafe { (_mm256_loadu_pd(from), _mm256_loadu_pd(from.add(4))) }
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
        unsafe fn store_any(v: Self::V, to: *mut f64) {
            // SAFETY: the caller's.
            unsafe {
                _mm256_storeu_pd(to, v.0);
                _mm256_storeu_pd(to.add(4), v.1);
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
