//! PRESS against brute force, and the selection's bookkeeping.

use hysid_linalg::{Matrix, lstsq};
use hysid_select::{Criterion, Options, PressForm, Search, select};
use proptest::prelude::*;

fn sub(phi: &Matrix, columns: &[usize], skip: Option<usize>) -> Matrix {
    let keep = |c: &[f64]| c.iter().enumerate().filter(|(i, _)| Some(*i) != skip).map(|(_, v)| *v).collect::<Vec<_>>();
    Matrix::from_columns(&columns.iter().map(|&j| keep(phi.col(j))).collect::<Vec<_>>()).unwrap()
}

fn brute_press(phi: &Matrix, y: &[f64], columns: &[usize]) -> f64 {
    (0..y.len())
        .map(|t| {
            let rest: Vec<f64> = y.iter().enumerate().filter(|(i, _)| *i != t).map(|(_, v)| *v).collect();
            let theta = lstsq(&sub(phi, columns, Some(t)), &rest).unwrap().theta;
            let predicted: f64 = columns.iter().zip(&theta).map(|(&j, c)| c * phi.get(t, j)).sum();
            (y[t] - predicted).powi(2)
        })
        .sum()
}

fn problem() -> impl Strategy<Value = (Matrix, Vec<f64>)> {
    (6usize..9, 20usize..40).prop_flat_map(|(m, n)| {
        let column = prop::collection::vec(-1.0..1.0f64, n);
        (prop::collection::vec(column.clone(), m), column)
            .prop_map(|(columns, y)| (Matrix::from_columns(&columns).unwrap(), y))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn press_is_the_sum_of_squared_leave_one_out_errors((phi, y) in problem()) {
        let options = Options { search: Search::Greedy, criterion: Criterion::Terms(5), ..Options::default() };
        let s = select(&phi, &y, &options).unwrap();
        let energy: f64 = y.iter().map(|v| v * v).sum();
        for point in &s.curve {
            let brute = brute_press(&phi, &y, &point.columns) / energy;
            prop_assert!((point.press - brute).abs() < 1e-9 * brute, "{} {brute}", point.press);
        }
    }

    #[test]
    fn the_default_stops_at_the_smallest_press((phi, y) in problem()) {
        let options = Options { search: Search::Greedy, ..Options::default() };
        let s = select(&phi, &y, &options).unwrap();
        let least = s.curve.iter().map(|p| p.press).fold(f64::INFINITY, f64::min);
        prop_assert_eq!(s.steps.last().unwrap().press, least);
        prop_assert_eq!(s.terms.len(), s.theta.len());
    }

    #[test]
    fn scaling_columns_changes_nothing_but_theta((phi, y) in problem(), powers in prop::collection::vec(-30i32..30, 9)) {
        let scaled: Vec<Vec<f64>> = (0..phi.cols())
            .map(|j| phi.col(j).iter().map(|v| v * 2f64.powi(powers[j])).collect())
            .collect();
        let scaled = Matrix::from_columns(&scaled).unwrap();
        let options = Options { criterion: Criterion::Press(PressForm::Squared), ..Options::default() };
        let (a, b) = (select(&phi, &y, &options).unwrap(), select(&scaled, &y, &options).unwrap());
        prop_assert_eq!(&a.terms, &b.terms);
        for (k, &j) in a.terms.iter().enumerate() {
            let back = b.theta[k] * 2f64.powi(powers[j]);
            prop_assert!((a.theta[k] - back).abs() < 1e-9 * a.theta[k].abs());
        }
    }
}

#[test]
fn the_order_of_candidates_does_not_matter() {
    let column = |k: usize| (0..60).map(|i| ((i * (2 * k + 3) + k * k) % 23) as f64 / 11.0 - 1.0).collect::<Vec<_>>();
    let columns: Vec<Vec<f64>> = (0..12).map(column).collect();
    let y: Vec<f64> = (0..60).map(|i| columns[2][i] - 0.5 * columns[7][i] + 0.1 * ((i * i) % 7) as f64).collect();
    let backwards: Vec<Vec<f64>> = columns.iter().rev().cloned().collect();
    let (a, b) = (Matrix::from_columns(&columns).unwrap(), Matrix::from_columns(&backwards).unwrap());
    let (a, b) = (select(&a, &y, &Options::default()).unwrap(), select(&b, &y, &Options::default()).unwrap());
    assert_eq!(a.terms, b.terms.iter().map(|j| 11 - j).collect::<Vec<_>>());
}
