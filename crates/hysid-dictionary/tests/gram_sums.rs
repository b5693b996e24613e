//! The streamed Gram matrix against the definition, and its independence of blocks and threads.

use hysid_dictionary::{Constant, Design, Dictionary, GramSums, Record, Rule, Signal, Signals, Spec};
use hysid_linalg::{Columns, Gram};
use proptest::prelude::*;

/// Numbers without a pattern, in -1..1.
fn noise(n: usize, seed: u64) -> Vec<f64> {
    let mut x = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut next = || {
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
        (x >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    (0..n).map(|_| next()).collect()
}

fn streamed(dictionary: &Dictionary, recordings: &[(Vec<f64>, Vec<Vec<f64>>)], blocks: &[usize]) -> Gram {
    let mut sums = GramSums::new(dictionary).unwrap();
    let mut sizes = blocks.iter().cycle();
    for (y, inputs) in recordings {
        let mut at = 0;
        while at < y.len() {
            let end = (at + sizes.next().unwrap()).min(y.len());
            let inputs = inputs.iter().map(|u| &u[at..end]).collect();
            sums.push(&Record::new(&y[at..end], inputs)).unwrap();
            at = end;
        }
        sums.end_recording();
    }
    sums.finish().unwrap()
}

/// Every inner product from whole columns, each relative to the lengths of the two.
fn check(dictionary: &Dictionary, recordings: &[(Vec<f64>, Vec<Vec<f64>>)], gram: &Gram) {
    let records: Vec<Record<'_>> =
        recordings.iter().map(|(y, u)| Record::new(y, u.iter().map(Vec::as_slice).collect())).collect();
    let design = Design::new(dictionary, &records).unwrap();
    assert_eq!(gram.rows, design.rows());
    let mut columns: Vec<Vec<f64>> = (0..design.cols())
        .map(|j| {
            let mut column = vec![0.0; design.rows()];
            design.fill(j, 0..design.rows(), &mut column);
            column
        })
        .collect();
    columns.push(design.target());
    let m = design.cols();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let lengths: Vec<f64> = columns.iter().map(|c| dot(c, c).sqrt()).collect();
    for i in 0..=m {
        for j in 0..=i {
            let found = match (i == m, j == m) {
                (true, true) => gram.target,
                (true, false) => gram.cross[j],
                _ => gram.matrix.get(i, j),
            };
            let expected = dot(&columns[i], &columns[j]);
            let size = lengths[i] * lengths[j];
            assert!((found - expected).abs() <= 1e-12 * size, "{i} {j}: {found} instead of {expected}");
        }
    }
    assert!((0..m).all(|i| (0..m).all(|j| gram.matrix.get(i, j) == gram.matrix.get(j, i))));
}

fn recording(n: usize, inputs: usize, seed: u64) -> (Vec<f64>, Vec<Vec<f64>>) {
    (noise(n, seed), (0..inputs).map(|i| noise(n, seed + 17 * (i as u64 + 1))).collect())
}

#[test]
fn it_is_the_gram_matrix_of_the_definition() {
    let siso = Signals::siso;
    let two = Signals::from_columns("y", &["a", "b"]).unwrap().with_threshold(Signal::Input(0), 0.3);
    let pulse = |spec: Spec| spec.build().unwrap();
    let cases: [(&str, Dictionary, usize); 7] = [
        ("full", pulse(Spec::narx(siso(), 5, 1..=5, 3)), 1),
        ("present input", pulse(Spec::narx(siso(), 2, 0..=3, 2)), 1),
        ("linear, no constant", pulse(Spec::narx(siso(), 3, 1..=3, 1).constant(Constant::Omitted)), 1),
        ("signs and differences", pulse(Spec::narx(two, 2, 0..=1, 2).hysteresis(Signal::Input(0), 0..=2)), 2),
        ("static", pulse(Spec::narx(siso(), 0, 0..=0, 4)), 1),
        (
            "gaps in the lags",
            pulse(Spec::new(siso()).lags(Signal::Output, [1, 7]).lags(Signal::Input(0), [3, 4]).degree(4)),
            1,
        ),
        ("few", pulse(Spec::narx(siso(), 4, 1..=4, 3).rule(Rule::EqualLags { from_degree: 2 })), 1),
    ];
    for (name, dictionary, inputs) in cases {
        println!("{name}");
        let mut recordings = vec![recording(3000, inputs, 1), recording(700, inputs, 2), recording(4, inputs, 3)];
        check(&dictionary, &recordings, &streamed(&dictionary, &recordings, &[1000]));
        // Missing samples, single and in rows, also at the ends; stretches shorter than the reach.
        let (y, u) = &mut recordings[0];
        for n in [0, 1, 50, 52, 53, 60, 1500, 1501, 1502, 2999] {
            y[n] = f64::NAN;
            u[0][(n * 7) % 3000] = f64::NAN;
        }
        check(&dictionary, &recordings, &streamed(&dictionary, &recordings, &[256]));
    }
}

#[test]
fn long_data_and_threads() {
    let dictionary = Spec::narx(Signals::siso(), 3, 1..=3, 2).build().unwrap();
    let mut data = vec![recording(400_001, 1, 9)];
    data[0].0[170_000] = f64::NAN;
    let with = |threads: usize, blocks: &[usize]| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| streamed(&dictionary, &data, blocks))
    };
    let one = with(1, &[400_001]);
    check(&dictionary, &data, &one);
    assert_eq!(one, with(2, &[1 << 16]));
    assert_eq!(one, with(3, &[99_991, 3, 40_000]));
}

#[test]
fn a_large_offset_costs_no_digits() {
    // Sums of 500 000 squares near 1e6 each: plain addition would lose four digits of the constant's products.
    let n = 500_000;
    let y = vec![1.000_000_1; n];
    let u: Vec<f64> = (0..n).map(|i| 1e3 + (i % 2) as f64).collect();
    let dictionary = Spec::narx(Signals::siso(), 1, 1..=1, 1).build().unwrap();
    let gram = streamed(&dictionary, &[(y, vec![u])], &[1 << 15]);
    let rows = (n - 1) as f64;
    // u[n-1] over rows 1.. is u over 0..n-1: half 1000 and half 1001, one less of the latter.
    let expected = 1e6 * (rows + 1.0) / 2.0 + 1_002_001.0 * (rows - 1.0) / 2.0;
    let j = dictionary.find(&Signals::siso().parse("u[n-1]").unwrap()).unwrap();
    assert_eq!(gram.matrix.get(j, j), expected);
}

#[test]
fn bad_samples_are_refused() {
    let dictionary = Spec::narx(Signals::siso(), 2, 1..=2, 1).build().unwrap();
    let mut sums = GramSums::new(&dictionary).unwrap();
    assert!(sums.push(&Record::new(&[1.0, 2.0], vec![])).is_err());
    assert!(sums.push(&Record::siso(&[1.0], &[1.0, 2.0])).is_err());
    sums.push(&Record::siso(&[1.0, 2.0], &[1.0, 2.0])).unwrap();
    let told = sums.finish().unwrap_err().to_string();
    assert!(told.contains("2 samples, the largest lag is 2"), "{told}");
    let large = Spec::narx(Signals::siso(), 10, 1..=10, 4).build().unwrap();
    assert!(GramSums::new(&large).is_err());
}

proptest! {
    #[test]
    fn borders_of_blocks_do_not_matter(
        n in 1..3000_usize,
        seed in 1..1000_u64,
        missing in proptest::collection::vec(0..3000_usize, 0..6),
        blocks in proptest::collection::vec(1..700_usize, 1..8),
    ) {
        let dictionary = Spec::narx(Signals::siso(), 2, 0..=2, 2).hysteresis(Signal::Input(0), [0]).build().unwrap();
        let (mut y, u) = recording(n, 1, seed);
        missing.iter().filter(|i| **i < n).for_each(|&i| y[i] = f64::NAN);
        prop_assume!(Record::siso(&y, &u[0]).gap_free().iter().any(|s| s.len() > dictionary.reach()));
        let data = [(y, u)];
        prop_assert_eq!(streamed(&dictionary, &data, &[n]), streamed(&dictionary, &data, &blocks));
    }
}
