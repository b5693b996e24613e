//! Candidates that are exact linear combinations of others, found by algebra and not by numbers.
//!
//! A difference is `u[n-j] - u[n-j-1]`, so that a product with differences is a polynomial in plain lags and signs.
//! A candidate is dropped when its polynomial lies in the span of the polynomials of those before it; the plain ones come
//! first. Coefficients are small whole numbers, so that the elimination in `f64` is exact but for divisions.

use std::collections::{BTreeMap, HashMap};

use crate::{Factor, Quantity, Term};

/// What is left, and what was dropped with the kept candidates that make it up.
pub(crate) struct Span {
    pub kept: Vec<Term>,
    pub collinear: Vec<(Term, Vec<Term>)>,
}

type Polynomial = BTreeMap<Term, f64>;

/// The term as a polynomial in plain lags and signs.
fn expand(term: &Term) -> Polynomial {
    let mut products: Vec<(Vec<Factor>, f64)> = vec![(Vec::new(), 1.0)];
    for &f in term.factors() {
        let alternatives = match f.quantity {
            Quantity::Difference(s) => vec![(Factor::value(s, f.lag), 1.0), (Factor::value(s, f.lag + 1), -1.0)],
            _ => vec![(f, 1.0)],
        };
        products = products
            .iter()
            .flat_map(|(factors, c)| {
                alternatives.iter().map(move |(a, d)| {
                    let mut longer = factors.clone();
                    longer.push(*a);
                    (longer, c * d)
                })
            })
            .collect();
    }
    let mut polynomial = Polynomial::new();
    for (factors, c) in products {
        *polynomial.entry(Term::new(factors)).or_insert(0.0) += c;
    }
    polynomial.retain(|_, c| *c != 0.0);
    polynomial
}

/// A row of the echelon form: a polynomial with leading coefficient 1, as a combination of kept candidates.
struct Row {
    polynomial: Polynomial,
    made_of: BTreeMap<usize, f64>,
}

/// Sorts candidates into kept and collinear; the order of those kept is that of `terms`.
pub(crate) fn drop_collinear(terms: Vec<Term>) -> Span {
    let differs = |t: &Term| t.factors().iter().any(|f| matches!(f.quantity, Quantity::Difference(_)));
    let mut order: Vec<usize> = (0..terms.len()).collect();
    order.sort_by_key(|&i| differs(&terms[i]));
    let mut rows: HashMap<Term, Row> = HashMap::new();
    let mut collinear: Vec<(usize, Vec<usize>)> = Vec::new();
    for i in order {
        if !differs(&terms[i]) {
            let polynomial = Polynomial::from([(terms[i].clone(), 1.0)]);
            rows.insert(terms[i].clone(), Row { polynomial, made_of: BTreeMap::from([(i, 1.0)]) });
            continue;
        }
        let mut rest = expand(&terms[i]);
        let mut made_of = BTreeMap::new();
        let mut clean = Polynomial::new();
        // Reduce from the largest monomial down; a row's leading monomial is its largest.
        while let Some((lead, c)) = rest.pop_last() {
            let Some(row) = rows.get(&lead) else {
                clean.insert(lead, c);
                continue;
            };
            for (monomial, d) in row.polynomial.iter().filter(|(m, _)| **m != lead) {
                let entry = rest.entry(monomial.clone()).or_insert(0.0);
                *entry -= c * d;
                if entry.abs() < 1e-9 {
                    rest.remove(monomial);
                }
            }
            for (j, d) in &row.made_of {
                *made_of.entry(*j).or_insert(0.0) += c * d;
            }
        }
        match clean.last_key_value().map(|(m, c)| (m.clone(), *c)) {
            None => {
                let within = made_of.iter().filter(|(_, c)| c.abs() > 1e-9).map(|(j, _)| *j).collect();
                collinear.push((i, within));
            }
            Some((lead, c)) => {
                clean.values_mut().for_each(|v| *v /= c);
                let mut own: BTreeMap<usize, f64> = made_of.into_iter().map(|(j, v)| (j, -v / c)).collect();
                own.insert(i, 1.0 / c);
                rows.insert(lead, Row { polynomial: clean, made_of: own });
            }
        }
    }
    collinear.sort();
    let out: Vec<usize> = collinear.iter().map(|(i, _)| *i).collect();
    Span {
        collinear: collinear
            .into_iter()
            .map(|(i, within)| (terms[i].clone(), within.into_iter().map(|j| terms[j].clone()).collect()))
            .collect(),
        kept: terms.into_iter().enumerate().filter(|(i, _)| out.binary_search(i).is_err()).map(|(_, t)| t).collect(),
    }
}
