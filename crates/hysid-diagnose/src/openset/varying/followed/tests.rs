//! Parameters that follow inputs and states.

use hysid_plant::{Compiled, Drive, Run};

use super::*;
use crate::budget::Budget;
use crate::model::Values;
use crate::model::base::NoiseKind;
use crate::model::hypothesis::{calibrated, recorded};
use crate::openset::varying::course::Course;
use crate::openset::varying::modulation::modulated;
use crate::openset::varying::written::WrittenVariation;
use crate::openset::varying::{LikelyVariation, varying};
use crate::oscillator::{normal, rms};

/// What is found where both coefficients of a force are multiplied by a function of another input, and whether it answers as the truth does where it is
/// written.
fn follows(factor: impl Fn(f64) -> f64) -> (LikelyVariation, bool) {
    let text = "[time]\nperiod_s = 0.1\n[inputs]\nv = \"v_m_s\"\ni = \"coil_A\"\n[parameters]\nf = { value = 1.0, min = 0.1, max = 9.0 }\nc = { value = 1.0, min = 0.1, max = 9.0 }\n\
                [outputs]\ny_N = \"f*tanh(5*v) + c*v + 0*i\"\n";
    let simulation = Simulation::parse(text, "static.sim.toml").unwrap();
    let mut random = normal(5);
    let v: Vec<f64> = (0..900).map(|_| random()).collect();
    let i: Vec<f64> = (0..900).map(|k| 2.0 + (0.05 * f64::from(k)).sin()).collect();
    let force = |(v, i): (&f64, &f64)| 3.0 * factor(*i) * (5.0 * v).tanh() + 2.0 * v;
    let y = v.iter().zip(&i).map(|at| force(at) + 0.1 * random()).collect();
    let data = recorded(&simulation, 0.1, [("v_m_s", v), ("coil_A", i), ("y_N", y)]);
    let budget = Budget::new(&|_| false);
    let (setting, none) = calibrated(simulation, &data, NoiseKind::Coloured, &budget);
    let base = none.base;
    let found = varying(&base, NoiseKind::Coloured, std::slice::from_ref(&base.whitener)).swap_remove(0);
    let written = WrittenVariation::new(&base.document(), &found).unwrap().forms.swap_remove(0).simulation;
    let fit = setting.fit(&written, &Values::default(), None, 2, 25).unwrap();
    (found, rms(&fit.fit.residual) < 1.05 * 0.1)
}

#[test]
fn a_coefficient_that_follows_another_input_is_found_with_its_slope() {
    let (found, answers) = follows(|i| 1.0 + 0.05 * (i - 2.0));
    let Course::Follows(input) = &found.what.course else { panic!("{}", found.what.words()) };
    assert_eq!((found.what.symbol.as_str(), input.quantity.symbol.as_str()), ("f", "i"), "{}", found.what.words());
    assert!(found.gain > 20.0 && answers, "{}", found.gain);
    let slope: f64 = found.what.amplitudes[0] / 0.5_f64.sqrt();
    assert!((slope - 0.05).abs() < 0.01, "{slope}");
    let words = found.what.words();
    assert!(words.starts_with("the parameter `f` rises with the input `i` along a curve, by "), "{words}");
}

#[test]
fn a_coefficient_may_follow_along_a_curve() {
    // As a viscosity that falls to half its value over the range.
    let (found, answers) = follows(|i| (-0.35 * (i - 2.0)).exp());
    let Course::Follows(input) = &found.what.course else { panic!("{}", found.what.words()) };
    assert_eq!((found.what.symbol.as_str(), input.quantity.symbol.as_str(), input.way), ("f", "i", Way::Curved));
    assert!(answers && found.what.words().contains("along a curve"), "{}", found.what.words());
}

/// As the time of transport through a pipe does the flow.
#[test]
fn a_delay_may_follow_an_input_beside_a_lag_that_stands_still() {
    let text = "[time]\nperiod_s = 0.1\n[inputs]\nu = \"u_K\"\nq = \"flow_l_s\"\n[parameters]\ng = { value = 1.0, min = 0.1, max = 9.0 }\nT = { value = 1.3, min = 0.5, max = 3.0, unit = \"s\" }\n\
                tau = { value = 0.4, min = 0.05, max = 2.0, unit = \"s\" }\n[outputs]\ny_K = \"g*lag(delay(u, T), tau) + 0*q\"\n";
    let simulation = Simulation::parse(text, "pipe.sim.toml").unwrap();
    let tones = [(1.0, 0.9, 0.3), (0.8, 1.7, 1.1), (0.5, 2.9, 2.0)];
    let u = |t: f64| tones.iter().map(|(a, w, p)| a * (w * t + p).sin()).sum::<f64>();
    let times: Vec<f64> = (0..1200).map(|n| 0.1 * f64::from(n)).collect();
    let q: Vec<f64> = times.iter().map(|t| 2.0 + (0.23 * t).sin()).collect();
    let mut random = normal(8);
    // The lag of 0.3 s, by small steps.
    let mut state = u(0.0);
    let mut y = Vec::new();
    for (t, q) in times.iter().zip(&q) {
        let late = 1.0 * (1.0 - 0.06 * (q - 2.0));
        (0..20).for_each(|k| state += 0.005 / 0.3 * (u((t - 0.1 + 0.005 * f64::from(k) - late).max(0.0)) - state));
        y.push(2.0 * state + 0.02 * random());
    }
    let data =
        recorded(&simulation, 0.1, [("u_K", times.iter().map(|t| u(*t)).collect()), ("flow_l_s", q), ("y_K", y)]);
    let budget = Budget::new(&|_| false);
    let (setting, none) = calibrated(simulation, &data, NoiseKind::Coloured, &budget);
    let base = none.base;
    assert_eq!(modulated(&base), ["g", "T"]);
    let found = varying(&base, NoiseKind::Coloured, std::slice::from_ref(&base.whitener)).swap_remove(0);
    let Course::Follows(input) = &found.what.course else { panic!("{}", found.what.words()) };
    assert_eq!((found.what.symbol.as_str(), input.quantity.symbol.as_str()), ("T", "q"), "{}", found.what.words());
    let written = WrittenVariation::new(&base.document(), &found).unwrap().forms.swap_remove(0).simulation;
    let fit = setting.fit(&written, &Values::default(), None, 2, 25).unwrap();
    let left = [&fit.fit, &base.fit].map(|f| rms(&f.residual));
    assert!(found.gain > 20.0 && left[0] < 0.5 * left[1], "{} {left:?}", found.gain);
}

const REACTOR: &str = "[time]\nperiod_s = 2.0\n[inputs]\nT_j = \"jacket_K\"\n[parameters]\nk = { value = 0.03, min = 0.005, max = 0.2, unit = \"1/s\" }\n\
                       h = { value = 60.0, min = 20.0, max = 200.0, unit = \"K\" }\nU = { value = 0.02, min = 0.005, max = 0.1, unit = \"1/s\" }\n[states]\n\
                       c = { derivative = \"0.02*(1 - c) - k*c\", initial = 0.5 }\n\
                       T = { derivative = \"h*k*c - U*(T - T_j)\", initial = 0.0, unit = \"K\" }\n[outputs]\nshare = \"c\"\nreactor_K = \"T\"\n";

/// What is found around a reactor whose rate depends so on its temperature, and what is left where it is written, over what was left before.
fn reaction(factor: &str) -> (Vec<LikelyVariation>, f64, String) {
    let original = Simulation::parse(REACTOR, "reactor.sim.toml").unwrap();
    let mut truth = original.clone();
    let by = Expr::parse(&format!("k*({factor})")).unwrap();
    truth.states.iter_mut().for_each(|s| s.derivative = s.derivative.substitute("k", &by));
    let mut random = normal(7);
    let steps: Vec<f64> = (0..30).map(|_| 15.0 * random()).collect();
    let jacket: Vec<f64> = (0..1200).map(|n| steps[n / 40]).collect();
    let compiled = Compiled::new(&truth).unwrap();
    let drive = Drive::new(0.0, 2.0, jacket.len(), vec![jacket.clone()]).unwrap();
    let mut outputs = compiled.simulate(&Run::new(&drive, &compiled.theta())).outputs;
    for y in &mut outputs {
        let size = 0.01 * rms(y);
        y.iter_mut().for_each(|y| *y += size * random());
    }
    let [share, reactor] = <[Vec<f64>; 2]>::try_from(outputs).unwrap();
    let data = recorded(&original, 2.0, [("jacket_K", jacket), ("share", share), ("reactor_K", reactor)]);
    let budget = Budget::new(&|_| false);
    let (setting, none) = calibrated(original, &data, NoiseKind::White(1.0), &budget);
    let base = none.base;
    let found = varying(&base, NoiseKind::White(1.0), std::slice::from_ref(&base.whitener));
    let varied = WrittenVariation::new(&base.document(), &found[0]).unwrap();
    let fits = varied.forms.iter().filter_map(|form| {
        let fit = setting.fit(&form.simulation, &Values::default(), None, 2, 25)?;
        let (what, _) = varied.fitted(form, &fit.values())?;
        Some((rms(&fit.fit.residual) / rms(&base.fit.residual), what.words()))
    });
    let (left, words) = fits.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    (found, left, words)
}

#[test]
fn a_rate_that_depends_on_a_state_is_found_in_all_equations_at_once() {
    let (all, left, words) = reaction("exp(0.03*T)");
    let found = &all[0];
    let Course::Follows(state) = &found.what.course else { panic!("{}", found.what.words()) };
    assert_eq!(
        (found.what.symbol.as_str(), state.quantity.symbol.as_str(), state.quantity.state),
        ("k", "T", true),
        "{}",
        found.what.words()
    );
    assert!(found.gain > 100.0 && left < 0.3, "{} {left}", found.gain);
    let told = words.strip_prefix("the parameter `k` rises with the state `T`").expect(&words);
    let slope = told.split_once(" by ").and_then(|(_, t)| t.split_once(" % of its value for each K")).expect(&words);
    // As it was fitted: the tangent, far from there, has less.
    assert!((slope.0.parse::<f64>().unwrap() - 3.0).abs() < 0.1, "{words}; {}", found.what.words());
    // The other ways stand behind it, each once.
    let way = |v: &LikelyVariation| {
        matches!(&v.what.course, Course::Follows(f) if f.quantity.symbol == "T").then(|| v.what.course.clone())
    };
    let ways: Vec<Course> = all.iter().filter(|v| v.what.symbol == "k").filter_map(way).collect();
    let has = |w: &Way| ways.iter().any(|c| matches!(c, Course::Follows(f) if f.way == *w));
    assert!(ways.len() == all.len() && all.len() == Way::ALL.len() && Way::ALL.iter().all(has));
    let found = reaction("1").0.swap_remove(0);
    assert!(found.gain < 5.0, "{} {}", found.gain, found.what.words());
}

#[test]
fn the_square_is_made_of_the_two_courses() {
    let simulation = Simulation::parse(REACTOR, "reactor.sim.toml").unwrap();
    let series = vec![vec![1.0, 4.0, -2.0], vec![3.0, 0.5]];
    let signal = Signal::new(&simulation, "T", series.clone()).unwrap();
    let squared = signal.followed(Way::Squared);
    let flat = |s: &Series| s.concat();
    let raised: Vec<f64> = flat(&series).iter().map(|x| x * x).collect();
    let mean = raised.iter().sum::<f64>() / 5.0;
    let deviation = (raised.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 5.0).sqrt();
    for (x, course) in raised.iter().zip(flat(&squared.courses[0])) {
        assert!(((x - mean) / deviation - course).abs() < 1e-12);
    }
    // Responses are linear in what they answer to.
    let [one, two] = signal.courses.each_ref().map(flat);
    let response = signal.responses(Way::Squared, [&one, &two]);
    assert!(response[0].iter().zip(flat(&squared.courses[0])).all(|(a, b)| (a - b).abs() < 1e-12));
    // Written, it is the same number.
    let held = Expr::parse("min(max(T, -5), 7)").unwrap();
    let text = Expr::parse(&squared.texts()[0]).unwrap().replace(&held, &Expr::Number(4.0)).simplified();
    let quotient: Vec<f64> = text.to_string().split('/').map(|n| n.parse().unwrap()).collect();
    assert!((quotient[0] / quotient[1] - squared.courses[0][0][1]).abs() < 1e-9);
}

#[test]
fn a_force_that_follows_its_motion_is_a_law() {
    let text = "[time]\nperiod_s = 0.01\n[inputs]\nu = \"drive_V\"\n[parameters]\nB = { value = 5.0, min = 0.5, unit = \"N/A\" }\nR = { value = 4.0, min = 0.4, unit = \"ohm\" }\n\
                L = { value = 0.1, min = 0.01, unit = \"H\" }\nk = { value = 80.0, min = 8.0, unit = \"N/m\" }\nc = { value = 2.0, min = 0.2, unit = \"N s/m\" }\n[states]\n\
                i = { derivative = \"(u - R*i - B*v)/L\", initial = 0.0, unit = \"A\" }\nx = { derivative = \"v\", initial = 0.0, unit = \"m\" }\n\
                v = { derivative = \"(B*i - c*v - k*x)/0.5\", initial = 0.0, unit = \"m/s\" }\n[outputs]\nx_m = \"x\"\n";
    let simulation = Simulation::parse(text, "coil.sim.toml").unwrap();
    let mut random = normal(2);
    let u: Vec<f64> = (0..300).map(|_| random()).collect();
    let x = u.iter().map(|u| 0.1 * u + 0.01 * random()).collect();
    let data = recorded(&simulation, 0.01, [("drive_V", u), ("x_m", x)]);
    let budget = Budget::new(&|_| false);
    let base = calibrated(simulation, &data, NoiseKind::White(1.0), &budget).1.base;
    let simulation = base.model.simulation();
    let signals = Signal::all(&base);
    let leads = |signal: &str, symbol: &str| {
        signals.iter().find(|s| s.quantity.symbol == signal).unwrap().leads(simulation, symbol)
    };
    // The force factor stands in the winding too, and a current is no motion.
    let found = [("x", "k"), ("x", "c"), ("v", "c"), ("x", "B"), ("i", "B"), ("i", "c"), ("x", "R")];
    assert_eq!(found.map(|(s, p)| leads(s, p)), [false, false, false, true, true, true, true]);
}
