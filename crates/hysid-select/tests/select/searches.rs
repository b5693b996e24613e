//! The searches against exhaustive search, the criteria against brute force, and the paper's equations as printed.

use hysid_dictionary::{Constant, Design, Factor, Record, Rule, Signal, Signals, Spec, Term};
use hysid_linalg::{Matrix, lstsq};
use hysid_select::{Criterion, Options, Search, StopReason, select};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Columns that share a good part of each other, so that greedy goes wrong, and a target that three of them make.
fn problem(seed: u64, rows: usize, cols: usize) -> (Matrix, Vec<f64>) {
    let mut rng = Pcg64::seed_from_u64(seed);
    let common: Vec<f64> = (0..rows).map(|_| rng.random_range(-1.0..1.0)).collect();
    let columns: Vec<Vec<f64>> =
        (0..cols).map(|_| common.iter().map(|c| c + rng.random_range(-1.0..1.0)).collect()).collect();
    let y = (0..rows)
        .map(|t| columns[0][t] - 2.0 * columns[1][t] + 1.5 * columns[2][t] + 0.3 * rng.random_range(-1.0..1.0))
        .collect();
    (Matrix::from_columns(&columns).unwrap(), y)
}

fn sse(phi: &Matrix, y: &[f64], columns: &[usize]) -> f64 {
    let a = Matrix::from_columns(&columns.iter().map(|&j| phi.col(j).to_vec()).collect::<Vec<_>>()).unwrap();
    lstsq(&a, y).unwrap().sse / y.iter().map(|v| v * v).sum::<f64>()
}

fn subsets(m: usize, k: usize) -> Vec<Vec<usize>> {
    (0u32..1 << m)
        .filter(|s| s.count_ones() as usize == k)
        .map(|s| (0..m).filter(|j| s >> j & 1 == 1).collect())
        .collect()
}

#[test]
fn searches_against_exhaustive_search() {
    let (m, sizes, problems) = (9, 5, 30);
    // (search, how many of all sizes and problems must be the optimum)
    let cases = [
        (Search::Greedy, 120),
        (Search::Iterative { starts: m }, 148),
        (Search::Beam { width: 4 }, 148),
        (Search::Floating, 148),
    ];
    for (search, least) in cases {
        let mut optimal = 0;
        for seed in 0..problems {
            let (phi, y) = problem(seed, 40, m);
            let options = Options { search: search.clone(), criterion: Criterion::Terms(sizes), ..Options::default() };
            let selection = select(&phi, &y, &options).unwrap();
            for k in 1..=sizes {
                let best = subsets(m, k).iter().map(|s| sse(&phi, &y, s)).fold(f64::INFINITY, f64::min);
                let found = selection.curve[k - 1].sse;
                assert!(found >= best * (1.0 - 1e-9), "{search:?} beats the optimum: {found} {best}");
                assert!((found - sse(&phi, &y, &selection.curve[k - 1].columns)).abs() < 1e-10);
                optimal += usize::from(found <= best * (1.0 + 1e-9));
            }
        }
        println!("{search:?}: {optimal} of {}", problems as usize * sizes);
        assert!(optimal >= least, "{search:?}: {optimal} of {} optimal", problems as usize * sizes);
    }
}

#[test]
fn left_out_blocks_against_fits_without_them() {
    let (phi, y) = problem(3, 60, 7);
    let blocks = vec![0..10, 10..35, 40..60];
    let criterion = Criterion::Blocks(blocks.clone());
    let selection = select(&phi, &y, &Options { search: Search::Greedy, criterion, ..Options::default() }).unwrap();
    let energy: f64 = y.iter().map(|v| v * v).sum();
    for point in &selection.curve {
        let mut brute = 0.0;
        for block in &blocks {
            let keep: Vec<usize> = (0..60).filter(|t| !block.contains(t)).collect();
            let columns: Vec<Vec<f64>> =
                point.columns.iter().map(|&j| keep.iter().map(|&t| phi.get(t, j)).collect()).collect();
            let rest: Vec<f64> = keep.iter().map(|&t| y[t]).collect();
            let theta = lstsq(&Matrix::from_columns(&columns).unwrap(), &rest).unwrap().theta;
            for t in block.clone() {
                let predicted: f64 = point.columns.iter().zip(&theta).map(|(&j, c)| c * phi.get(t, j)).sum();
                brute += (y[t] - predicted).powi(2);
            }
        }
        approx::assert_relative_eq!(point.criterion, brute / energy, max_relative = 1e-9);
    }
}

#[test]
fn goals_and_reasons() {
    let (phi, y) = problem(1, 50, 8);
    let all = |criterion| select(&phi, &y, &Options { criterion, max_terms: 6, ..Options::default() }).unwrap();
    let terms = all(Criterion::Terms(3));
    assert_eq!((terms.terms.len(), terms.stop), (3, StopReason::GoalReached));
    let mut found = terms.terms;
    found.sort();
    assert_eq!(found, [0, 1, 2]);
    let tolerance = all(Criterion::ErrTolerance(0.05));
    assert_eq!(tolerance.stop, StopReason::GoalReached);
    assert!(tolerance.sse() <= 0.05);
    let err: f64 = tolerance.steps.iter().map(|s| s.err).sum();
    approx::assert_relative_eq!(1.0 - err, tolerance.sse(), epsilon = 1e-12);
    for criterion in [Criterion::Aic, Criterion::Bic] {
        let s = all(criterion);
        let least = s.curve.iter().take(6).map(|p| p.criterion).fold(f64::INFINITY, f64::min);
        approx::assert_relative_eq!(s.steps.last().unwrap().criterion, least, max_relative = 1e-12);
    }
}

#[test]
fn repeated_and_zero_columns_are_reported() {
    let (phi, y) = problem(2, 50, 4);
    let columns: Vec<Vec<f64>> =
        vec![phi.col(0).to_vec(), phi.col(0).to_vec(), vec![0.0; 50], phi.col(1).to_vec(), phi.col(2).to_vec()];
    let s = select(&Matrix::from_columns(&columns).unwrap(), &y, &Options::default()).unwrap();
    let mut rejected: Vec<usize> = s.rejected.iter().map(|r| r.column).collect();
    rejected.sort();
    assert_eq!(rejected, [1, 2]);
}

#[test]
fn bad_options_are_refused() {
    let (phi, y) = problem(2, 50, 4);
    let base = Options::default();
    let cases = [
        Options { max_terms: 0, ..base.clone() },
        Options { forced: vec![4], ..base.clone() },
        Options { forced: vec![1, 1], ..base.clone() },
        Options { pivot_guard: f64::NAN, ..base.clone() },
        Options { criterion: Criterion::Terms(0), ..base.clone() },
        Options { criterion: Criterion::ErrTolerance(2.0), ..base.clone() },
        Options { criterion: Criterion::Blocks(vec![0..30, 20..50]), ..base.clone() },
        Options { criterion: Criterion::Blocks(vec![0..30]), ..base.clone() },
        Options { search: Search::Beam { width: 0 }, ..base.clone() },
    ];
    for options in cases {
        assert!(select(&phi, &y, &options).is_err(), "{options:?}");
    }
    assert!(select(&phi, &y[1..], &base).is_err());
    assert!(select(&phi, &[0.0; 50], &base).is_err());
    assert!(select(&phi, &[f64::NAN; 50], &base).is_err());
}

/// The paper's Preisach data: 202 points, the peak twice (a relay grid on a triangle of 100 steps, in closed form).
fn preisach() -> (Vec<f64>, Vec<f64>) {
    let up = (0..=100).map(|m| (-0.5 + 0.01 * f64::from(m), f64::from(m * (m - 1)) / 39600.0));
    let down = (0..=100).map(|n| (0.5 - 0.01 * f64::from(n), 0.25 - f64::from(n * (n - 1)) / 39600.0));
    up.chain(down).unzip()
}

#[test]
fn matching_pursuit_on_the_papers_dictionary_gives_the_papers_terms() {
    let s = Signals::siso();
    let linear = |t: &Term| t.degree() != 1 || !["y[n-1]", "y[n-2]"].iter().any(|x| s.parse(x).unwrap() == *t);
    let spec = Spec::narx(s.clone(), 3, 0..=3, 3)
        .constant(Constant::Omitted)
        .rule(Rule::EqualLags { from_degree: 3 })
        .rule(Rule::Exclude(vec![s.parse("y[n-1]").unwrap(), s.parse("y[n-2]").unwrap()]));
    let dictionary = spec.build().unwrap();
    assert_eq!(dictionary.len(), 46);
    assert!(dictionary.terms().iter().all(linear));
    let (u, y) = preisach();
    let cases: [(usize, &[&str], [f64; 8]); 3] = [
        (
            11,
            &["y1^2", "u3", "u0", "u0^2", "u0u3", "y3", "u2^3", "u0u1", "u1^3", "u0^3"],
            [0.0114, 0.0107, 0.0106, 0.0114, 0.0117, 0.0126, 0.0131, 0.0149],
        ),
        (
            12,
            &["y1^2", "u0^2", "u3", "u0", "u0u3", "y3", "u0^3", "y1u1^2", "u3^2"],
            [0.0087, 0.0085, 0.0080, 0.0080, 0.0088, 0.0096, 0.0109, 0.0137],
        ),
        (
            13,
            &["y1^2", "u0", "u3", "u0^2", "u0u3", "u3^2", "u0^3", "u1^3", "y3"],
            [0.0062, 0.0063, 0.0060, 0.0059, 0.0062, 0.0064, 0.0081, 0.0110],
        ),
    ];
    for (factor, order, table2) in cases {
        let every = |x: &[f64]| x.iter().skip(factor - 1).step_by(factor).copied().collect::<Vec<_>>();
        let (u, y) = (every(&u), every(&y));
        let design = Design::new(&dictionary, &[Record::siso(&u, &y)]).unwrap();
        let options =
            Options { search: Search::MatchingPursuit, criterion: Criterion::Terms(13), ..Options::default() };
        let target = design.target();
        let selection = select(&design, &target, &options).unwrap();
        let short = |f: &Factor| {
            let name = if f.quantity.signal() == Signal::Output { "y" } else { "u" };
            format!("{name}{}", f.lag)
        };
        let text = |j: usize| {
            let f = dictionary.terms()[j].factors();
            let power = f.iter().rev().take_while(|x| *x == &f[f.len() - 1]).count();
            let mut parts: Vec<String> = f[..f.len() - power].iter().map(short).collect();
            let last = short(&f[f.len() - 1]);
            parts.push(if power > 1 { format!("{last}^{power}") } else { last });
            parts.concat()
        };
        let found: Vec<String> = selection.curve[order.len() - 1].columns.iter().map(|&j| text(j)).collect();
        assert_eq!(found, order, "L = {factor}");
        // Table 2: the residual of the pursuit over (1 - n/N') and the sum of squares of the decimated input.
        let squares: f64 = u[3..].iter().map(|v| v * v).sum();
        for (n, printed) in (6..=13).zip(table2) {
            let left = selection.curve[n - 1].search_sse * selection.target_energy;
            let value = left / ((1.0 - n as f64 / u.len() as f64) * squares);
            assert!((value - printed).abs() <= 0.5001e-4, "L = {factor}, n = {n}: {value:.6} printed {printed}");
        }
    }
}

/// A greedy path asks nothing of the data for its last term that it does not need; a longer path must begin with it.
#[test]
fn a_greedy_path_is_the_beginning_of_the_next_longer_one() {
    let (phi, y) = problem(5, 60, 14);
    let path = |terms: usize| {
        let options = Options { search: Search::Greedy, criterion: Criterion::Terms(terms), ..Options::default() };
        select(&phi, &y, &options).unwrap()
    };
    for terms in 1..12 {
        let (shorter, longer) = (path(terms), path(terms + 1));
        assert_eq!(shorter.terms, longer.terms[..terms], "{terms}");
        for (a, b) in shorter.steps.iter().zip(&longer.steps) {
            assert!((a.err - b.err).abs() < 1e-12 && (a.press / b.press - 1.0).abs() < 1e-9, "{terms}: {a:?} {b:?}");
        }
        assert!(shorter.precision.err_deviation < 1e-9, "{terms}: {:?}", shorter.precision);
    }
}
