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
    fn the_rows_of_the_hat_matrix_sum_up_to_the_number_of_terms((phi, y) in problem(), terms in 1usize..6) {
        // With H the projection on the columns, H e_t leaves 1 - h_tt of a target that is 1 at sample t and 0 elsewhere.
        let options = Options { search: Search::Greedy, criterion: Criterion::Terms(terms), ..Options::default() };
        let s = select(&phi, &y, &options).unwrap();
        let again = Options { forced: s.terms.clone(), ..options };
        let unit = |t: usize| (0..y.len()).map(|i| f64::from(u8::from(i == t))).collect::<Vec<_>>();
        let leverage: Vec<f64> = (0..y.len()).map(|t| 1.0 - select(&phi, &unit(t), &again).unwrap().sse()).collect();
        prop_assert!((leverage.iter().sum::<f64>() - terms as f64).abs() < 1e-9);
        prop_assert!(leverage.iter().all(|h| (-1e-12..=1.0 + 1e-12).contains(h)));
        // And PRESS is made of exactly these: e_t / (1 - h_tt).
        let left = |t: usize| y[t] - s.terms.iter().zip(&s.theta).map(|(&j, c)| c * phi.get(t, j)).sum::<f64>();
        let press: f64 = (0..y.len()).map(|t| (left(t) / (1.0 - leverage[t])).powi(2)).sum();
        let found = s.steps.last().unwrap().press * s.target_energy;
        prop_assert!((press - found).abs() < 1e-8 * found, "{press} {found}");
    }

    #[test]
    fn the_price_of_the_search_is_that_of_its_candidates((phi, y) in problem()) {
        let options = Options { search: Search::Greedy, ..Options::default() };
        let s = select(&phi, &y, &options).unwrap();
        for (k, p) in s.curve.iter().enumerate() {
            let (n, rows) = ((k + 1) as f64, y.len() as f64);
            let value = p.press + 2.0 * n * ((phi.cols() as f64).ln() - 1.0) * p.sse / (rows - n);
            prop_assert!((p.criterion - value).abs() < 1e-12 * value);
        }
        let least = s.curve.iter().map(|p| p.criterion).fold(f64::INFINITY, f64::min);
        prop_assert_eq!(s.steps.last().unwrap().criterion, least);
    }

    #[test]
    fn press_stops_at_its_smallest((phi, y) in problem()) {
        let criterion = Criterion::Press(PressForm::Exact);
        let options = Options { search: Search::Greedy, criterion, ..Options::default() };
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
