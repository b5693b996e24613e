use nalgebra::{DMatrix, DVector};

use super::super::layout::Whitener;
use super::super::response::samples::{PERIOD, autoregressive, white};
use super::super::response::{ForcePath, ForcePaths, samples};
use super::*;

/// Two masses in a row: the force acts on the first, the second follows.
const A: [f64; 16] = [0.0, 1.0, 0.0, 0.0, -90.0, -1.0, 60.0, 0.4, 0.0, 0.0, 0.0, 1.0, 60.0, 0.4, -60.0, -0.7];
/// Place of each, and something that the force does not reach.
const C: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
const ENTRY: usize = 1;

/// Outputs one after the other, one run of so many rows each.
fn layout(outputs: usize, rows: usize) -> Layout {
    let series = |output: usize| Series { stretch: 0, output, first: 0, rows: output * rows..(output + 1) * rows };
    Layout { series: (0..outputs).map(series).collect(), outputs }
}

fn steady(rows: usize) -> CommonPath {
    CommonPath::held((&A, &C), ENTRY, PERIOD, |_| vec![rows]).unwrap()
}

/// A moment: matrix, force, what each output shows.
type Moment = (DMatrix<f64>, DVector<f64>, DMatrix<f64>);

/// Those of a way whose answers go up and down, to outputs 0 and 2.
fn swaying(rows: usize) -> (CommonPath, Vec<Moment>) {
    let at = |k: usize| {
        let s = (0.3 * k as f64).sin();
        let a = DMatrix::from_row_slice(2, 2, &[0.9, 0.2 + 0.1 * s, -0.3 - 0.2 * s, 0.85]);
        (
            a,
            DVector::from_vec(vec![0.02, 0.1 + 0.08 * s]),
            DMatrix::from_row_slice(2, 2, &[1.0 + 0.7 * s, 0.1, 0.3, 1.0 - 0.5 * s]),
        )
    };
    let moments: Vec<Moment> = (0..rows).map(at).collect();
    let flat = |(a, b, c): &Moment| {
        a.transpose().iter().chain(b.iter()).chain(c.transpose().iter()).copied().collect::<Vec<_>>()
    };
    let values = moments.iter().flat_map(flat).collect();
    (CommonPath::new(ENTRY, vec![0, 2], 2, vec![(values, rows)]).unwrap(), moments)
}

/// How each row, the outputs of a moment one after the other, answers to a unit force at each moment.
fn answers(moments: &[Moment]) -> DMatrix<f64> {
    let outputs = moments[0].2.nrows();
    let mut all = DMatrix::zeros(outputs * moments.len(), moments.len());
    for at in 0..moments.len() {
        let mut x = DVector::zeros(moments[0].1.len());
        for (k, (a, b, c)) in moments.iter().enumerate() {
            (c * &x).iter().enumerate().for_each(|(o, y)| all[(k * outputs + o, at)] = *y);
            x = a * x + b * if k == at { 1.0 } else { 0.0 };
        }
    }
    all
}

#[test]
fn the_joint_innovations_are_the_cholesky_factor_of_the_covariance() {
    let n = 30;
    let mean = |output: usize| samples::answers(&ForcePath::held(&A, ENTRY, &C[4 * output..][..4], PERIOD).unwrap(), n);
    let two = [mean(0), mean(2)];
    let held = DMatrix::from_fn(2 * n, n, |row, at| two[row % 2][(row / 2, at)]);
    let (moving, moments) = swaying(n);
    let layout = layout(3, n);
    for (path, answers, variance) in [(steady(n), held, 900.0), (moving, answers(&moments), 50.0)] {
        for (pole, poles) in [(0.0, [0.0, 0.0]), (0.75, [0.0, 0.6]), (0.0, [0.8, -0.4])] {
            let sensors = [Sensor { sigma: 1.7, pole: poles[0] }, Sensor { sigma: 0.4, pole: poles[1] }];
            let filter = Arc::new(path.interleaved(&sensors, pole).filter(variance).unwrap());
            let below = Below::LEVEL;
            let common =
                CommonForce { outputs: vec![0, 2], entry: ENTRY, pole, sensors: sensors.to_vec(), filter, below };
            let runs = common.runs(&layout).unwrap();
            // What each sensor makes, and what the force does, at rows of all moments.
            let lag = |i: usize, j: usize| i.abs_diff(j) as i32;
            let memory = DMatrix::from_fn(n, n, |i, j| pole.powi(lag(i, j)));
            let own = |i: usize, j: usize| {
                let s = sensors[i % 2];
                let alike = f64::from(u8::from(i % 2 == j % 2));
                alike * s.sigma * s.sigma * s.pole.powi(lag(i / 2, j / 2)) / (1.0 - s.pole * s.pole)
            };
            let covariance = DMatrix::from_fn(2 * n, 2 * n, own) + &answers * memory * answers.transpose() * variance;
            let factor = covariance.cholesky().unwrap().l();
            let stack = white(3 * n, 4);
            let place = |row: usize| [0, 2 * n][row % 2] + row / 2;
            let rows = |of: &[f64]| DVector::from_fn(2 * n, |row, _| of[place(row)]);
            let near = |a: DVector<f64>, b: DVector<f64>| (a - &b).amax() < 1e-6 * b.amax();
            let mut out = stack.clone();
            common.whiten(&runs, &stack, &mut out);
            assert!(near(rows(&out), factor.solve_lower_triangular(&rows(&stack)).unwrap()), "{pole} {poles:?}");
            assert_eq!(out[n..2 * n], stack[n..2 * n], "an output that the force does not reach");
            common.colour(&runs, &mut out);
            assert!(near(rows(&out), rows(&stack)), "{pole} {poles:?}");
            let mut back = stack.clone();
            common.transpose(&runs, &mut back);
            assert!(near(rows(&back), factor.tr_solve_lower_triangular(&rows(&stack)).unwrap()), "{pole} {poles:?}");
            let log: f64 = factor.diagonal().iter().map(|d| d.ln()).sum();
            let found = common.log_scale(0, &layout.series[0]) + common.log_scale(0, &layout.series[2]);
            assert!((log - found).abs() < 1e-6, "{log} {found}");
        }
    }
    assert!(CommonPath::held((&A, &C[..8]), ENTRY, PERIOD, |_| vec![n]).is_none(), "one output is reached");
}

#[test]
fn the_sizes_come_back_and_what_is_whitened_is_independent() {
    let n = 4000;
    let path = steady(n);
    let (size, sigmas, pole) = (30.0, [0.02, 0.05], 0.7);
    let forces = white(n, 21);
    let outputs = [0, 2].map(|o| ForcePath::held(&A, ENTRY, &C[4 * o..][..4], PERIOD).unwrap());
    let made = outputs.each_ref().map(|way| {
        let (with, without) = (samples::simulated(way, &forces, size, 3), samples::simulated(way, &forces, 0.0, 3));
        with.iter().zip(&without).map(|(a, b)| a - b).collect::<Vec<f64>>()
    });
    let own = [white(n, 5), autoregressive(n, pole, 6)];
    let of = |o: usize| made[o].iter().zip(&own[o]).map(move |(f, e)| f + sigmas[o] * e);
    let stack: Vec<f64> = of(0).chain(white(n, 9)).chain(of(1)).collect();
    let layout = layout(3, n);
    let each = vec![vec![outputs[0].clone()], Vec::new(), vec![outputs[1].clone()]];
    let apart = layout.fit_noise(&stack, 16, &ForcePaths { each: each.clone(), common: Vec::new() });
    let joint = layout.fit_noise(&stack, 16, &ForcePaths { each, common: vec![Arc::new(path)] });
    assert_eq!((apart.common_from(), joint.common_from()), (None, Some(ENTRY)));
    let common = CommonForce::fit(&steady(n), &layout, &stack, &joint.models, 4.0).unwrap();
    let [first, second] = common.sensors[..] else { panic!("two sensors") };
    assert!((first.sigma / sigmas[0] - 1.0).abs() < 0.05 && first.pole == 0.0, "{first:?}");
    assert!((second.sigma / (sigmas[1] * (1.0 - pole * pole).sqrt()) - 1.0).abs() < 0.05, "{second:?}");
    assert!((second.pole - pole).abs() < 0.05, "{second:?}");
    assert_eq!(common.coefficients(), 2);
    // The largest correlation of the two at lags up to 20, 41 of them: 1 in 1000 is above 4.2 of their standard deviations.
    let largest = |noise: &Whitener| {
        let white = noise.apply(&layout, &stack);
        let (a, b) = (&white[..n], &white[2 * n..]);
        let at = |lag: usize| {
            [(&a[lag..], b), (&b[lag..], a)].map(|(x, y)| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>().abs())
        };
        (0..=20).flat_map(at).fold(0.0, f64::max) / (n as f64).sqrt()
    };
    assert!(largest(&joint) < 4.2 && largest(&apart) > 6.0, "{} {}", largest(&joint), largest(&apart));
}
