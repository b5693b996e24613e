//! The oscillator that tests of the diagnosis record: its simulation with parameters that are somewhat wrong, its input and its response.
//!
//! The integrator is this file's own: nothing of what is tested makes the recordings. The tests of the command line include this file too.

/// A simulation of the oscillator with parameters that are somewhat wrong.
pub const BASELINE: &str = r#"
title = "Oscillator"
[time]
column = "t_s"
[inputs]
u = "u_N"
[parameters]
m = { value = 1.2, min = 0.2, max = 5.0, unit = "kg" }
c = { value = 0.7, min = 0.0, max = 20.0, unit = "N s/m" }
k = { value = 130.0, min = 10.0, max = 1000.0, unit = "N/m" }
[states]
x = { derivative = "v", initial = 0.0, unit = "m" }
v = { derivative = "(u - c*v - k*x)/m", initial = 0.0, unit = "m/s" }
[outputs]
x_m = "x"
"#;

/// Mass, damping and stiffness of the real oscillator.
pub const REAL: (f64, f64, f64) = (1.0, 0.9, 158.0);

/// The period of the recordings in seconds.
pub const PERIOD: f64 = 0.025;

/// A linear congruential stream of roughly normal numbers.
pub fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut s = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        (0..12)
            .map(|_| {
                s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (s >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            })
            .sum()
    }
}

/// Many sines with phases from the stream, loud and quiet by turns, in newtons.
pub fn drive(samples: usize, random: &mut impl FnMut() -> f64) -> Vec<f64> {
    let phases: Vec<f64> = (0..40).map(|_| 3.0 * random()).collect();
    (0..samples)
        .map(|i| {
            let t = i as f64 * PERIOD;
            let level = if ((t / 6.0) as usize).is_multiple_of(2) { 2.0 } else { 1.0 };
            level * phases.iter().enumerate().map(|(j, p)| (0.6 * (j + 1) as f64 * t + p).cos()).sum::<f64>()
        })
        .collect()
}

/// Displacement in metres of an oscillator (mass, damping, stiffness) at rest before, with a further force of displacement and velocity.
pub fn respond(u: &[f64], (m, c, k): (f64, f64, f64), force: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let (mut x, mut v) = (0.0, 0.0);
    (0..u.len())
        .map(|i| {
            let here = x;
            let (a, b) = (u[i], u[(i + 1).min(u.len() - 1)]);
            for s in 0..40 {
                let f = a + (b - a) * f64::from(s) / 40.0;
                v += PERIOD / 40.0 * (f - c * v - k * x - force(x, v)) / m;
                x += PERIOD / 40.0 * v;
            }
            here
        })
        .collect()
}

/// Root mean square.
pub fn rms(y: &[f64]) -> f64 {
    (y.iter().map(|y| y * y).sum::<f64>() / y.len().max(1) as f64).sqrt()
}
