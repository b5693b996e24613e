//! Exported code gives the model's own free run.

use std::process::Command;

use crate::common::coefficients;
use hysid_dictionary::{Record, SignalName, Signals};
use hysid_narx::{Derived, Law, NarxModel, Parts, Past};

fn model() -> NarxModel {
    let derived = vec![
        Derived { symbol: "w1".into(), source: 0, law: Law::Play { half_width: 0.25, past: Past::TurnedAt(-0.75) } },
        Derived { symbol: "w2".into(), source: 1, law: Law::Filter { a: vec![-0.5, 0.1, -0.05, 0.01] } },
        Derived { symbol: "w3".into(), source: 0, law: Law::Dahl { length: 0.5 } },
        Derived { symbol: "w4".into(), source: 3, law: Law::SoftThreshold { centre: 0.1, width: 0.2 } },
    ];
    let name = |s: &str, t: f64| SignalName { symbol: s.into(), column: s.into(), threshold: t };
    let mut inputs = vec![name("u", 0.05), name("v", 0.0)];
    inputs.extend(derived.iter().map(|d| name(&d.symbol, 0.0)));
    let signals = Signals::new(name("y", 0.01), inputs).unwrap();
    let terms = [
        ("1", 0.01),
        ("y[n-1]", 0.5),
        ("y[n-2]^2*u[n]", -0.1),
        ("dy[n-1]*sgn(dy[n-1])", -0.2),
        ("sgn(du[n])*v[n-1]", 0.3),
        ("w1[n]", 0.2),
        ("w2[n-1]", 1.0 / 3.0),
        ("w3[n]*u[n-2]", -0.4),
        ("w4[n]", 0.7),
        ("du[n-1]^3", 1e-3),
    ];
    let coefficients = coefficients(&signals, &terms, f64::NAN);
    NarxModel::new(Parts { signals, derived, coefficients, noise: vec![], limit: 1e3, period_s: None, decimation: 1 })
        .unwrap()
}

const N: usize = 300;

fn data() -> [Vec<f64>; 3] {
    let at = |f: f64, p: f64| (0..N).map(|n| (f * n as f64 + p).sin() + 0.5 * (1.7 * f * n as f64).cos()).collect();
    [at(0.13, 0.3), at(0.31, 1.0), at(0.21, 2.0)]
}

fn check(language: &str, printed: &[u8], reach: usize) {
    let [u, v, y] = data();
    let ours = model().free_run(&Record::new(&y, vec![&u, &v])).unwrap();
    assert_eq!(ours.diverged_at, None);
    let theirs: Vec<f64> = String::from_utf8_lossy(printed).lines().map(|l| l.trim().parse().unwrap()).collect();
    assert_eq!(theirs.len(), N - reach);
    for (a, b) in ours.y[reach..].iter().zip(&theirs) {
        assert!((a - b).abs() <= 1e-12 * (1.0 + a.abs()), "{language}: {a} {b}");
    }
}

fn list(x: &[f64]) -> String {
    x.iter().map(|v| format!("{v:e}")).collect::<Vec<_>>().join(", ")
}

#[test]
fn c_code_agrees() {
    let model = model();
    let reach = model.reach();
    let [u, v, y] = data();
    let main = format!(
        "{}\n#include <stdio.h>\nstatic double U[] = {{{}}}, V[] = {{{}}}, Y[] = {{{}}};\nint main(void) {{\n    static hysid_state s;\n    \
         for (int n = 0; n < {N}; ++n) {{\n        double u[2] = {{U[n], V[n]}};\n        \
         if (n < {reach}) hysid_known(&s, u, Y[n]); else printf(\"%.17g\\n\", hysid_step(&s, u));\n    }}\n    return 0;\n}}\n",
        model.to_c(),
        list(&u),
        list(&v),
        list(&y)
    );
    let dir = tempfile::tempdir().unwrap();
    let (source, program) = (dir.path().join("model.c"), dir.path().join("model"));
    std::fs::write(&source, main).unwrap();
    let built = Command::new("cc")
        .args(["-std=c99", "-Wall", "-Werror", "-O1", "-o"])
        .arg(&program)
        .arg(&source)
        .arg("-lm")
        .output();
    let Ok(built) = built else {
        println!("skipped: no C compiler");
        return;
    };
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    check("C", &Command::new(&program).output().unwrap().stdout, reach);
}

#[test]
fn python_code_agrees() {
    let model = model();
    let reach = model.reach();
    let [u, v, y] = data();
    let script = format!(
        "{}\n\nU, V, Y = [{}], [{}], [{}]\nm = Model()\nfor n in range({N}):\n    u = [U[n], V[n]]\n    \
         if n < {reach}:\n        m.known(u, Y[n])\n    else:\n        print(repr(m.step(u)))\n",
        model.to_python(),
        list(&u),
        list(&v),
        list(&y)
    );
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("model.py");
    std::fs::write(&file, script).unwrap();
    let Ok(done) = Command::new("python3").arg(&file).output() else {
        println!("skipped: no python3");
        return;
    };
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    check("Python", &done.stdout, reach);
}

#[test]
fn latex_names_every_term() {
    let text = model().latex();
    assert!(text.starts_with("\\begin{align*}\ny[n] &= 0.0100000 \\\\"));
    assert!(text.ends_with("\n\\end{align*}"));
    for part in ["y[n-2]^{2}\\, u[n]", "\\operatorname{sgn}(\\Delta u[n])", "w_{2}[n-1]", "\\Delta u[n-1]^{3}"] {
        assert!(text.contains(part), "{part} in {text}");
    }
}
