//! Selection against an orthogonalisation in doubled precision, on well and on ill-conditioned data.

use crate::common::{By, Way, boucwen, narx};
use hysid_dictionary::{Design, Record, Signals, Spec};
use hysid_linalg::{Columns, Matrix};
use hysid_select::{Criterion, Options, PressForm, Search, select};

/// An unevaluated sum of two doubles, about 32 digits.
#[derive(Clone, Copy)]
struct Dd(f64, f64);

impl Dd {
    fn sum(a: f64, b: f64) -> Self {
        let s = a + b;
        let v = s - a;
        Self(s, (a - (s - v)) + (b - v))
    }
    fn add(self, o: Self) -> Self {
        let s = Self::sum(self.0, o.0);
        let t = Self::sum(self.1, o.1);
        let u = Self::sum(s.0, s.1 + t.0);
        Self::sum(u.0, u.1 + t.1)
    }
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
    fn mul(self, o: Self) -> Self {
        let p = self.0 * o.0;
        let e = self.0.mul_add(o.0, -p);
        Self::sum(p, e + self.0 * o.1 + self.1 * o.0)
    }
    fn div(self, o: Self) -> Self {
        let q = self.0 / o.0;
        let r = self.add(o.mul(Self(q, 0.0)).neg());
        let q2 = r.0 / o.0;
        let r = r.add(o.mul(Self(q2, 0.0)).neg());
        Self::sum(q, q2).add(Self(r.0 / o.0, 0.0))
    }
}

fn dot(a: &[Dd], b: &[Dd]) -> Dd {
    a.iter().zip(b).fold(Dd(0.0, 0.0), |s, (x, y)| s.add(x.mul(*y)))
}

fn subtract(from: &mut [Dd], factor: Dd, what: &[Dd]) {
    for (f, w) in from.iter_mut().zip(what) {
        *f = f.add(factor.mul(*w).neg());
    }
}

/// Classical OFR by modified Gram-Schmidt in doubled precision; `guard` as in the options.
fn reference(phi: &Matrix, y: &[f64], terms: usize, guard: f64) -> Vec<usize> {
    let dd = |c: &[f64]| c.iter().map(|v| Dd(*v, 0.0)).collect::<Vec<_>>();
    let mut columns: Vec<Vec<Dd>> = (0..phi.cols()).map(|j| dd(phi.col(j))).collect();
    let norms: Vec<Dd> = columns.iter().map(|c| dot(c, c)).collect();
    let mut left = dd(y);
    let mut chosen = Vec::new();
    while chosen.len() < terms {
        let mut best: Option<(usize, f64)> = None;
        for j in (0..columns.len()).filter(|j| !chosen.contains(j)) {
            let energy = dot(&columns[j], &columns[j]);
            if energy.0 <= guard * norms[j].0 {
                continue;
            }
            let c = dot(&columns[j], &left);
            let score = c.mul(c).div(energy).0;
            if best.is_none_or(|b| score > b.1) {
                best = Some((j, score));
            }
        }
        let Some((j, _)) = best else { break };
        let w = columns[j].clone();
        let energy = dot(&w, &w);
        for k in 0..columns.len() {
            if k != j {
                let factor = dot(&columns[k], &w).div(energy);
                subtract(&mut columns[k], factor, &w);
            }
        }
        let factor = dot(&left, &w).div(energy);
        subtract(&mut left, factor, &w);
        chosen.push(j);
    }
    chosen
}

#[test]
fn greedy_selection_equals_doubled_precision_or_says_where_it_may_not() {
    let every = |x: Vec<f64>, step: usize| x.into_iter().step_by(step).collect::<Vec<_>>();
    let decimated = |n: usize, step: usize| {
        let (u, y) = boucwen(n * step);
        (every(u, step), every(y, step))
    };
    // (name, data, terms, terms that must agree whatever the report says)
    let cases = [
        ("narx", narx(800, 1, 0.01), 20, 20),
        ("Bouc-Wen by 20", decimated(800, 20), 20, 20),
        ("Bouc-Wen by 5", decimated(800, 5), 30, 20),
        ("Bouc-Wen at 1 ms", boucwen(1000), 36, 20),
    ];
    for (name, (u, y), terms, sure) in cases {
        let dictionary = Spec::narx(Signals::siso(), 3, 1..=3, 3).build().unwrap();
        let design = Design::new(&dictionary, &[Record::siso(&u, &y)]).unwrap();
        let columns: Vec<Vec<f64>> = (0..design.cols())
            .map(|j| {
                let mut c = vec![0.0; design.rows()];
                design.fill(j, 0..design.rows(), &mut c);
                c
            })
            .collect();
        let options = Options { search: Search::Greedy, criterion: Criterion::Terms(terms), ..Options::default() };
        let expected =
            reference(&Matrix::from_columns(&columns).unwrap(), &design.target(), terms, options.pivot_guard);
        for way in [Way::Apart, Way::Whole] {
            let ours = select(&By(way, &design), &design.target(), &options).unwrap();
            let same = ours.terms.iter().zip(&expected).take_while(|(a, b)| a == b).count();
            let promised = ours.precision.doubtful_from.unwrap_or(ours.terms.len());
            println!(
                "{name}, {way:?}: same for {same} of {terms}, promised {promised}, smallest pivot {:.1e}, ERR deviation {:.1e}",
                ours.precision.smallest_pivot, ours.precision.err_deviation
            );
            assert!(same >= promised, "{name}, {way:?}: promised {promised}, same only for {same}");
            assert!(same >= sure, "{name}, {way:?}: same only for {same}");
        }
    }
}

/// One pass for all inner products is another order of additions, and nothing else: the same terms in the same order, and so the same bits
/// of all that comes from the samples.
#[test]
fn one_pass_selects_what_columns_asked_for_one_by_one_select() {
    let exact = Criterion::Press(PressForm::Exact);
    let greedy = |n| Options { search: Search::Greedy, criterion: Criterion::Terms(n), ..Options::default() };
    let cases = [
        greedy(15),
        Options::default(),
        Options { criterion: exact, ..Options::default() },
        Options { search: Search::Beam { width: 4 }, ..greedy(8) },
        Options { search: Search::Iterative { starts: 3 }, ..greedy(8) },
        Options { search: Search::MatchingPursuit, ..greedy(8) },
    ];
    let dictionary = Spec::narx(Signals::siso(), 3, 1..=3, 3).build().unwrap();
    let (u, y) = narx(80_000, 3, 0.02);
    let (mut holed, gap) = (y.clone(), 30_000);
    holed[gap] = f64::NAN;
    let long = Design::new(&dictionary, &[Record::siso(&u, &y)]).unwrap();
    let cut = Design::new(&dictionary, &[Record::siso(&u, &holed), Record::siso(&u[..500], &y[..500])]).unwrap();
    for (name, design) in [("long", long), ("cut", cut)] {
        let target = design.target();
        assert!(design.gram(&target, 40).is_some(), "{name}: one pass is not taken");
        for options in &cases {
            let (whole, apart) =
                [Way::Whole, Way::Apart].map(|way| select(&By(way, &design), &target, options).unwrap()).into();
            let what = format!("{name} {options:?}");
            assert_eq!(whole.terms, apart.terms, "{what}");
            assert_eq!(whole.stop, apart.stop, "{what}");
            for (a, b) in whole.theta.iter().zip(&apart.theta) {
                assert!((a - b).abs() <= 1e-9 * a.abs(), "{what}: {a} {b}");
            }
            for (a, b) in whole.steps.iter().zip(&apart.steps) {
                assert!((a.press - b.press).abs() <= 1e-12 * a.press, "{what}: {} {}", a.press, b.press);
            }
        }
    }
}
