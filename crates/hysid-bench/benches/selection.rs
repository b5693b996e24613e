//! Selection: one pass of the kernel, greedy to a number of terms, the default search, the free run.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use hysid_bench::{dictionary, known_model, known_system};
use hysid_dictionary::{Design, Record};
use hysid_linalg::Columns;
use hysid_select::{Criterion as Rule, Options, PressForm, Search, select};

fn selection(c: &mut Criterion) {
    let mut group = c.benchmark_group("selection");
    group.sample_size(10);
    for (name, n, lags, terms) in [("small", 1_000, 3, 11), ("medium", 10_000, 5, 15), ("large", 100_000, 10, 20)] {
        let (u, y) = known_system(n, 1, 0.01);
        let dictionary = dictionary(lags);
        group.bench_function(name, |b| {
            b.iter(|| {
                let design = Design::new(&dictionary, &[Record::siso(&u, &y)]).unwrap();
                let options = Options { search: Search::Greedy, criterion: Rule::Terms(terms), ..Options::default() };
                black_box(select(&design, &design.target(), &options))
            });
        });
    }
    let (u, y) = known_system(10_000, 1, 0.0);
    let small = dictionary(3);
    let design = Design::new(&small, &[Record::siso(&u, &y)]).unwrap();
    let target = design.target();
    group.bench_function("default search", |b| b.iter(|| black_box(select(&design, &target, &Options::default()))));
    let press = Options { search: Search::Greedy, criterion: Rule::Press(PressForm::Exact), ..Options::default() };
    let (u1, y1) = known_system(1_000, 1, 0.01);
    let short = Design::new(&small, &[Record::siso(&u1, &y1)]).unwrap();
    let short_target = short.target();
    group.bench_function("stopped by PRESS", |b| b.iter(|| black_box(select(&short, &short_target, &press))));
    group.bench_function("eight Gram columns", |b| {
        b.iter(|| black_box(design.gram_columns(&[0, 7, 14, 21, 40, 55, 70, 83])))
    });
    group.finish();
}

fn free_run(c: &mut Criterion) {
    let (u, y) = known_system(100_000, 1, 0.0);
    let model = known_model();
    c.bench_function("free run of 11 terms, 100 000 samples", |b| {
        b.iter(|| black_box(model.free_run(&[&u], &y[..3], u.len(), 1e6)));
    });
}

criterion_group!(benches, selection, free_run);
criterion_main!(benches);
