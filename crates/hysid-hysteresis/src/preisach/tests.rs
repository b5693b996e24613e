//! Grid and staircase against each other, against the paper's data and against closed forms.

use super::*;
use crate::Operator;
use proptest::prelude::*;

/// Densities of every kind on a small plane.
fn planes() -> Vec<PreisachPlane> {
    let fields = Fields { coercive: 0.3, coercive_width: 0.2, interaction: -0.1, interaction_width: 0.25 };
    let cells = 12;
    let table = (0..cells * (cells + 1) / 2).map(|k| ((k * 7919) % 13) as f64).collect();
    let mut planes = Vec::new();
    for density in [Density::Uniform, Density::Gaussian(fields), Density::Lorentzian(fields), Density::Table(table)] {
        for (diagonal, levels, start) in [
            (Diagonal::Excluded, Levels::ZeroOne, Start::AllOff),
            (Diagonal::Included, Levels::MinusPlus, Start::AllOn),
            (Diagonal::Included, Levels::ZeroOne, Start::Demagnetised),
        ] {
            let density = density.clone();
            planes.push(PreisachPlane { density, diagonal, levels, start, ..PreisachPlane::uniform(-1.0, 1.0, cells) });
        }
    }
    planes
}

/// The paper's 202 samples: 101 up and 101 down, the peak twice.
fn input_of_the_paper() -> Vec<f64> {
    let up = (0..=100).map(|m| -0.5 + 0.01 * f64::from(m));
    up.chain((0..=100).map(|n| 0.5 - 0.01 * f64::from(n))).collect()
}

#[test]
fn the_papers_data_come_out_exactly() {
    let plane = PreisachPlane::of_the_paper();
    let grid = plane.grid().unwrap();
    assert_eq!(grid.relays(), 4950);
    let u = input_of_the_paper();
    for y in [grid.run(&u), plane.staircase().unwrap().run(&u)] {
        for m in 0..=100u32 {
            let up = f64::from(m) * (f64::from(m) - 1.0) / 39600.0;
            assert_eq!(y[m as usize], up, "going up, M = {m}");
            let down = y[101 + m as usize];
            assert!((down - (0.25 - up)).abs() < 1e-16 * 2.0, "coming down, n = {m}: {down}");
        }
    }
}

/// Inputs that hit thresholds and edges of cells exactly, and others, in and out of the range.
fn inputs() -> impl Strategy<Value = Vec<f64>> {
    let on_the_grid = (-2i32..27).prop_map(|k| -1.0 + f64::from(k) / 12.0);
    prop::collection::vec(prop_oneof![on_the_grid, -1.2f64..1.2], 1..120)
}

proptest! {
    #[test]
    fn the_staircase_is_the_grid(u in inputs()) {
        for plane in planes() {
            let (grid, fast) = (plane.grid().unwrap().run(&u), plane.staircase().unwrap().run(&u));
            for (n, (a, b)) in grid.iter().zip(&fast).enumerate() {
                prop_assert!((a - b).abs() < 1e-13, "{plane:?} at sample {n}: grid {a}, staircase {b}");
            }
        }
    }

    #[test]
    fn corners_are_nested_and_few(u in inputs()) {
        let fast = PreisachPlane::uniform(-1.0, 1.0, 12).staircase().unwrap();
        let mut state = fast.init();
        for &u in &u {
            fast.step(&mut state, u);
            for pair in state.corners().windows(2) {
                prop_assert!(pair[0].maximum > pair[1].maximum && pair[0].minimum < pair[1].minimum);
            }
            prop_assert!(state.corners().len() <= 13);
        }
    }

    #[test]
    fn a_fine_grid_tends_to_the_smooth_operator(u in prop::collection::vec(-1.0f64..1.0, 1..30)) {
        // The smooth operator of a uniform density does not depend on the number of cells at all.
        let coarse = PreisachPlane::uniform(-1.0, 1.0, 3);
        let fine = PreisachPlane::uniform(-1.0, 1.0, 400).staircase().unwrap().run(&u);
        for (a, b) in coarse.smooth().unwrap().run(&u).iter().zip(fine) {
            prop_assert!((a - b).abs() < 0.012, "{a} {b}");
        }
    }

    #[test]
    fn the_smooth_triangle_is_the_integral_of_its_density(a in 0.0f64..12.0, b in 0.0f64..12.0) {
        // Midpoint sum over a fine raster of the piecewise constant density.
        for plane in planes().into_iter().skip(1).step_by(3) {
            let weights = plane.weights().unwrap();
            let table = SmoothTable::new(&weights);
            let raster = 40;
            let mut sum = 0.0;
            for x in 0..12 * raster {
                for y in 0..=x {
                    let (alpha, beta) = ((x as f64 + 0.5) / raster as f64, (y as f64 + 0.5) / raster as f64);
                    if alpha < a && beta >= b {
                        let (i, j) = (x / raster, y / raster);
                        let density = if i == j { 2.0 * weights.at(i, j) } else { weights.at(i, j) };
                        sum += density / (raster * raster) as f64 * if x == y { 0.5 } else { 1.0 };
                    }
                }
            }
            let total = weights.scale.total;
            prop_assert!((table.triangle(a, b) - sum).abs() < 0.02 * total, "{} {sum}", table.triangle(a, b));
        }
    }
}

#[test]
fn a_smooth_uniform_plane_has_parabolic_branches() {
    // From negative saturation: weight up = x^2/2 of 1/2 with x from 0 to 1.
    let op = PreisachPlane::uniform(-1.0, 1.0, 7).smooth().unwrap();
    let u: Vec<f64> = (0..=50).map(|n| -1.0 + 0.04 * f64::from(n)).collect();
    for (y, u) in op.run(&u).iter().zip(&u) {
        let x: f64 = (u + 1.0) / 2.0;
        approx::assert_abs_diff_eq!(*y, 2.0 * x * x - 1.0, epsilon = 1e-14);
    }
}

#[test]
fn demagnetised_means_no_output_where_the_plane_is_symmetric() {
    let plane = PreisachPlane { start: Start::Demagnetised, ..PreisachPlane::uniform(-1.0, 1.0, 10) };
    let op = plane.smooth().unwrap();
    approx::assert_abs_diff_eq!(op.run(&[0.0])[0], 0.0, epsilon = 1e-14);
    // And it is where slowly decaying reversals lead.
    let from_saturation = PreisachPlane { start: Start::AllOff, ..plane }.smooth().unwrap();
    let decay: Vec<f64> =
        (0..2000).map(|k| (1.0 - f64::from(k) / 2000.0) * if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
    approx::assert_abs_diff_eq!(from_saturation.run(&decay)[1999], 0.0, epsilon = 2e-3);
}

#[test]
fn bad_planes_are_refused() {
    let good = PreisachPlane::uniform(-1.0, 1.0, 3);
    let fields = Fields { coercive: 0.0, coercive_width: 0.0, interaction: 0.0, interaction_width: 1.0 };
    let cases = [
        (PreisachPlane { upper: -1.0, ..good.clone() }, "upper must be above lower = -1"),
        (PreisachPlane { cells: 0, ..good.clone() }, "cells must be 1 to 4096"),
        (PreisachPlane { cells: 5000, ..good.clone() }, "cells must be 1 to 4096"),
        (PreisachPlane { density: Density::Table(vec![1.0; 5]), ..good.clone() }, "6 for 3 cells along a side"),
        (PreisachPlane { density: Density::Table(vec![-1.0; 6]), ..good.clone() }, "a relay's weight must be"),
        (PreisachPlane { density: Density::Table(vec![0.0; 6]), ..good.clone() }, "the sum of the weights must be"),
        (PreisachPlane { density: Density::Gaussian(fields), ..good.clone() }, "coercive_width must be"),
        (PreisachPlane { saturation: Some(f64::NAN), ..good.clone() }, "saturation must be"),
        (PreisachPlane { cells: 1, diagonal: Diagonal::Excluded, ..good }, "the sum of the weights must be"),
    ];
    for (plane, expected) in cases {
        let e = plane.grid().unwrap_err().to_string();
        assert!(e.contains(expected), "{e}");
    }
}
