use super::*;
use crate::mechanism::{Family, Form};
use crate::slot::Place;

#[test]
fn every_specimen_can_be_read() {
    for (name, text) in SPECIMENS {
        if let Err(e) = Simulation::parse(text, name) {
            panic!("{e}");
        }
    }
}

#[test]
fn every_mechanism_stands_somewhere_and_keeps_the_form() {
    let mut stands: Vec<&str> = vec!["solver_artefact"];
    let mut told: Vec<(&str, String)> = Vec::new();
    let mut breaches = Vec::new();
    for simulation in specimens() {
        let structure = Structure::of(&simulation);
        stands.extend(catalogue().iter().filter(|m| !m.slots(&structure).is_empty()).map(|m| m.id));
        breaches.extend(check_simulation(&simulation));
        for m in catalogue() {
            for slot in m.slots(&structure) {
                let signals = example_signals(&simulation, &slot);
                for (purpose, _) in m.forms(&slot) {
                    let written = m.rewrite(&simulation, &slot, &signals, purpose).unwrap();
                    told.extend(written.report.into_iter().map(|r| (m.id, r.name)));
                }
            }
        }
    }
    // What stands in brackets a form has, at one slot at least.
    for m in catalogue() {
        for name in placeholders(m.sentence, true).into_iter().filter(|n| !["place", "parameter"].contains(n)) {
            assert!(told.contains(&(m.id, name.to_owned())), "{}: no form tells {name}", m.id);
        }
    }
    let shown: Vec<String> = breaches.iter().map(|b| format!("{}: {}: {}", b.mechanism, b.at, b.what)).collect();
    assert!(shown.is_empty(), "{} breaches:\n{}", shown.len(), shown.join("\n"));
    let homeless: Vec<&str> = catalogue().iter().map(|m| m.id).filter(|id| !stands.contains(id)).collect();
    assert!(homeless.is_empty(), "no specimen has a slot for {homeless:?}");
}

#[test]
fn neutral_values_are_the_baseline_and_every_amplitude_moves_an_output() {
    let benches = benches();
    assert_eq!(benches.len(), SPECIMENS.len());
    let mut shown = Vec::new();
    for bench in &benches {
        for mechanism in catalogue() {
            for (slot, signals) in bench.slots(mechanism) {
                let found = bench.check_motion(mechanism, &slot, &signals);
                shown.extend(found.into_iter().map(|b| format!("{}: {}: {}", b.mechanism, b.at, b.what)));
            }
        }
    }
    assert!(shown.is_empty(), "{} breaches:\n{}", shown.len(), shown.join("\n"));
}

/// Under inputs that jump, where friction sticks and is set free.
#[test]
fn derivatives_are_those_of_the_simulation() {
    let mut shown = Vec::new();
    for (simulation, (period_s, size)) in specimens().iter().zip(EXCITATION) {
        let bench = Bench::of(simulation, &jumping_recording(simulation, *period_s, *size).unwrap()).unwrap();
        for mechanism in catalogue() {
            for (slot, signals) in bench.slots(mechanism) {
                let found = bench.check_derivatives(mechanism, &slot, &signals);
                shown.extend(found.into_iter().map(|b| format!("{}: {}: {}", b.mechanism, b.at, b.what)));
            }
        }
    }
    assert!(shown.is_empty(), "{} breaches:\n{}", shown.len(), shown.join("\n"));
}

#[test]
fn the_form_holds_on_the_simulations_of_the_recordings() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/simulations");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        assert!(std::env::var("HYSID_REQUIRE_RECORDINGS").as_deref() != Ok("1"), "{} is missing", folder.display());
        println!("skipped: no recordings");
        return;
    };
    let files = entries.filter_map(|e| e.ok().map(|e| e.path()));
    let mut seen = 0;
    for path in files.filter(|p| p.to_string_lossy().ends_with(".sim.toml")) {
        let text = std::fs::read_to_string(&path).unwrap();
        let simulation = Simulation::parse(&text, &path.to_string_lossy()).unwrap();
        let shown: Vec<String> =
            check_simulation(&simulation).iter().map(|b| format!("{}: {}: {}", b.mechanism, b.at, b.what)).collect();
        assert!(shown.is_empty(), "{} breaches:\n{}", shown.len(), shown.join("\n"));
        let structure = Structure::of(&simulation);
        for m in catalogue() {
            let slots: Vec<String> = m.slots(&structure).iter().map(|s| format!("{s} ({})", s.whereabouts)).collect();
            println!("{}: {}: {}", simulation.title, m.id, slots.join(", "));
        }
        seen += 1;
    }
    assert!(seen > 0);
}

/// The cheap part of the recovery; `cargo xtask catalogue recover` runs it for every mechanism at every slot.
#[test]
fn a_mechanism_is_recovered_from_its_own_simulation() {
    let benches = benches();
    let check_at = |title: &str, id: &str, place: usize| {
        let bench = benches.iter().find(|b| b.title().starts_with(title)).unwrap();
        let mechanism = crate::mechanism::mechanism(id).unwrap();
        let (slot, signals) = bench.slots(mechanism).into_iter().nth(place).unwrap();
        let left = bench.recovery(mechanism, &slot, &signals).unwrap();
        assert!(left < 0.02, "{id} at {slot} of {title}: {left} of the effect is left");
    };
    let check = |title: &str, id: &str| check_at(title, id, 0);
    check("Oscillator", "coulomb_friction");
    check("Oscillator", "cubic_stiffness");
    check("Oscillator", "bouc_wen");
    check("Piezo actuator", "prandtl_ishlinskii");
    check("Piezo actuator", "quantisation");
    check("Motor", "delay");
    check("Tank", "abrupt_change");
    check("Circuit", "input_saturation");
    check("Controlled", "coulomb_friction");
    check("Controlled", "dahl_friction");
    check("Hydraulic", "leakage");
    check("Shaker", "back_emf");
    check("Stalling", "stall_lag");
    check("Magnetic bearing", "dead_zone");
    // Between the two filters.
    check_at("Circuit", "input_saturation", 1);
}

#[test]
fn what_a_part_passes_on_is_one_signal_however_many_states_it_is_made_of() {
    let check = |derivative: &str, expected: &[&str]| {
        let text = format!(
            "title = \"Lead and lag\"\n[inputs]\nu = \"u_V\"\n[parameters]\nw = {{ value = 50.0, min = 1.0, max = 500.0, unit = \"rad/s\" }}\n\
             T = {{ value = 0.01, min = 0.0, max = 1.0, unit = \"s\" }}\n[time]\nperiod_s = 0.001\n[states]\n\
             p = {{ derivative = \"r\", initial = 0.0, unit = \"V\" }}\n\
             r = {{ derivative = \"w^2*(u - p) - w*r\", initial = 0.0, unit = \"V/s\" }}\n\
             q = {{ derivative = \"{derivative}\", initial = 0.0, unit = \"V\" }}\n[outputs]\ny_V = \"q\"\n"
        );
        let simulation = Simulation::parse(&text, "lead.sim.toml").unwrap();
        let structure = Structure::of(&simulation);
        let between = structure.slots.iter().filter(|s| s.place == Place::Between);
        let found: Vec<String> = between.map(|s| s.quantity("u").unwrap().expression.to_string()).collect();
        assert_eq!(found, expected, "{derivative}");
        for slot in structure.slots.iter().filter(|s| s.place == Place::Between) {
            let signals = example_signals(&simulation, slot);
            let mechanism = crate::mechanism::mechanism("input_polynomial").unwrap();
            assert_eq!(check_form(mechanism, &simulation, slot, &signals), []);
            let written = mechanism.rewrite(&simulation, slot, &signals, Purpose::Refit).unwrap().simulation;
            let run = |s: &Simulation| {
                let compiled = hysid_plant::Compiled::new(s).unwrap();
                let input: Vec<f64> = (0..200).map(|n| (0.1 * f64::from(n)).sin()).collect();
                let drive = hysid_plant::Drive::new(0.0, 0.001, 200, vec![input]).unwrap();
                compiled.simulate(&hysid_plant::Run::new(&drive, &compiled.theta())).outputs.concat()
            };
            // Without amplitude it is the simulation as it was.
            let apart = run(&simulation).iter().zip(run(&written)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(apart < 1e-12, "{derivative}: {apart}");
        }
    };
    check("w*(p - q)", &["p"]);
    check("w*(p + T*r - q)", &["p + T*r"]);
    check("w*(p - T*r - q)", &["p - T*r"]);
    check("w*(p - q) + w*T*abs(r)", &["p", "r"]);
}

/// A steady curve that has the separation in it gets its lag there, and nothing else changes.
#[test]
fn separation_lags_where_the_simulation_has_it() {
    let simulation = specimens().into_iter().find(|s| s.title.starts_with("Stalling")).unwrap();
    let mechanism = crate::mechanism::mechanism("stall_lag").unwrap();
    let slot = mechanism.slots(&Structure::of(&simulation)).remove(0);
    let signals = example_signals(&simulation, &slot);
    let check = |purpose, expected: &str| {
        let written = mechanism.rewrite(&simulation, &slot, &signals, purpose).unwrap();
        let expected = format!("cna*sin((alpha - a_0)*pi/180)*(1 + sqrt({expected}))^2/4");
        assert_eq!(written.simulation.outputs[0].expression.to_string(), expected);
        assert!(!mechanism.slots(&Structure::of(&written.simulation)).iter().any(|s| !mechanism.is_in(s)));
    };
    let at = |angle: &str| format!("1/(1 + exp(s*({angle} - a_s)))");
    let (steady, ahead) = (at("alpha"), at("alpha - tau_2*d(alpha)"));
    check(Purpose::Refit, &format!("lag({steady}, tau_1)"));
    check(Purpose::Form(Form::Finer), &format!("lag({ahead}, tau_1)"));
    check(Purpose::Screening, &format!("{steady} + w*(lag({ahead}, tau_1) - {steady})"));
    // An attached and a separated part blended, the one divided by what the other holds the step of.
    let blended = |step: &str| format!("cna*alpha*{step} + sin(alpha*pi/180)*(1 - {step})");
    let mut simulation = simulation;
    let divided = blended(&steady).replacen(&format!("*{steady}"), "/(1 + exp(s*(alpha - a_s)))", 1);
    simulation.outputs[0].expression = Expr::parse(&divided).unwrap();
    let slot = mechanism.slots(&Structure::of(&simulation)).remove(0);
    let written = mechanism.rewrite(&simulation, &slot, &signals, Purpose::Refit).unwrap();
    assert_eq!(written.simulation.outputs[0].expression.to_string(), blended(&format!("lag({steady}, tau_1)")));
}

/// Only where the simulation's own damping follows an input do friction and hysteresis follow it.
#[test]
fn only_a_controlled_damping_has_a_control() {
    for simulation in specimens() {
        let controlled = simulation.title.starts_with("Controlled");
        let has = Structure::of(&simulation).slots.iter().any(|s| s.has("control"));
        assert_eq!(has, controlled, "{}", simulation.title);
    }
}

/// A plant that moves has stores and windings too, where the units say so.
#[test]
fn what_is_held_or_wound_beside_a_motion_is_found() {
    let specimen = |name: &str| specimens().swap_remove(SPECIMENS.iter().position(|(n, _)| *n == name).unwrap());
    let stands = |id: &str, name: &str| -> Vec<String> {
        let mechanism = crate::mechanism::mechanism(id).unwrap();
        mechanism.slots(&Structure::of(&specimen(name))).into_iter().map(|slot| slot.label).collect()
    };
    assert_eq!(stands("leakage", "cylinder"), ["state:p"]);
    assert!(stands("leakage", "shaker").is_empty() && stands("leakage", "oscillator").is_empty());
    assert_eq!(stands("back_emf", "shaker"), ["state:i"]);
    // What is wound lacks the induced voltage alone.
    let shaker = specimen("shaker");
    let slot = Structure::of(&shaker).slots.into_iter().find(|s| s.place == Place::Winding).unwrap();
    assert_eq!(slot.quantity("i").unwrap().expression.to_string(), "i");
    let mut induced = shaker;
    induced.state_mut("i").unwrap().derivative = hysid_plant::Expr::parse("(u - R*i - k_F*v)/L").unwrap();
    assert!(!Structure::of(&induced).slots.iter().any(|s| s.place == Place::Winding && s.has("i")));
}

#[test]
fn what_yields_is_told_within_the_travel_only() {
    let mut seen = 0;
    for simulation in specimens() {
        let structure = Structure::of(&simulation);
        for m in catalogue() {
            let yields = matches!(m.family, Family::Presliding | Family::HystereticSpring);
            for slot in m.slots(&structure).into_iter().filter(|slot| slot.place != Place::Loop) {
                let signals = example_signals(&simulation, &slot);
                let written = m.rewrite(&simulation, &slot, &signals, Purpose::Refit).unwrap();
                let travels: Vec<f64> = written.shapes.iter().filter_map(|s| s.travel).collect();
                let expected = if yields { vec![2.0 * signals.reach("x")] } else { Vec::new() };
                assert_eq!(travels, expected, "{} at {}", m.id, slot.label);
                seen += travels.len();
            }
        }
    }
    assert!(seen > 0);
}

/// Where another store is fed through the opening a loss along Torricelli's law is one of its own.
#[test]
fn a_store_may_leak_in_proportion_or_through_an_opening() {
    let leakage = crate::mechanism::mechanism("leakage").unwrap();
    let mut seen = 0;
    for bench in benches() {
        for (slot, signals) in bench.slots(leakage).into_iter().filter(|(slot, _)| !slot.has("k")) {
            let outflow = |purpose| {
                let written = leakage.rewrite(&bench.simulation, &slot, &signals, purpose).unwrap().simulation;
                written.expressions().iter().any(|(_, e)| e.to_string().contains("*sqrt(max("))
            };
            assert!(outflow(Purpose::Form(Form::Other)) && !outflow(Purpose::Refit), "{slot}");
            seen += 1;
        }
    }
    assert!(seen > 0);
}

/// Friction that sticks beside one that creeps is another machine: what a smoothed friction lacks is smoothed alike.
#[test]
fn what_a_friction_lacks_is_written_as_the_simulation_has_it() {
    let servo = specimens().into_iter().find(|s| s.title.starts_with("Servo")).unwrap();
    let sharp = servo.state("v").unwrap().derivative.to_string();
    assert!(sharp.contains("sign(v)"), "{sharp}");
    let written = |own: &str, id: &str| {
        let mut simulation = servo.clone();
        simulation.state_mut("v").unwrap().derivative = Expr::parse(&sharp.replace("sign(v)", own)).unwrap();
        let mechanism = crate::mechanism::mechanism(id).unwrap();
        let slot = mechanism.slots(&Structure::of(&simulation)).into_iter().find(|s| s.label == "state:v").unwrap();
        let signals = example_signals(&simulation, &slot);
        let written = mechanism.rewrite(&simulation, &slot, &signals, Purpose::Refit).unwrap();
        written.simulation.state("v").unwrap().derivative.to_string()
    };
    for own in ["tanh(v/0.01)", "tanh(50*v)", "(v/(abs(v) + 0.01))", "(v/sqrt(v^2 + 0.0001))"] {
        let stribeck = written(own, "stribeck_friction");
        assert!(stribeck.contains(&format!("exp(-(v/v_s)^2)*{own}")) && !stribeck.contains("sign("), "{stribeck}");
        let bare = own.trim_start_matches('(');
        assert!(written(own, "asymmetric_friction").contains(&format!("F_a*abs({bare}")));
    }
    let written = |own: &str| written(own, "stribeck_friction");
    assert!(written("sign(v)").contains("exp(-(v/v_s)^2)*sign(v)"));
    assert!(written("v/(abs(v) + 0.01)").contains("exp(-(v/v_s)^2)*(v/(abs(v) + 0.01))"));
    assert!(written("atan(v/0.01)*2/pi").contains("exp(-(v/v_s)^2)*(atan(v/0.01)/(pi/2))"));
}

/// A smoothed sign can be made sharper or stick in whatever form it is written.
#[test]
fn a_smoothed_friction_has_variants_that_are_sharper_and_stick() {
    use crate::mechanism::numerics::variants;

    let servo = specimens().into_iter().find(|s| s.title.starts_with("Servo")).unwrap();
    let sharp = servo.state("v").unwrap().derivative.to_string();
    let forms = |own: &str| -> Vec<String> {
        let mut simulation = servo.clone();
        simulation.state_mut("v").unwrap().derivative = Expr::parse(&sharp.replace("sign(v)", own)).unwrap();
        let found = variants(&simulation, 0.01).into_iter().filter(|v| v.what.contains("friction"));
        found.map(|v| v.simulation.state("v").unwrap().derivative.to_string()).collect()
    };
    assert!(forms("sign(v)").is_empty());
    for (own, sharper, sticks) in [
        ("tanh(v/0.01)", "tanh(3*(v/0.01))", "sign(v/0.01)"),
        ("v/(abs(v) + 0.01)", "(3*v/(abs(3*v) + 0.01))", "sign(v)"),
        ("atan(v/0.01)*2/pi", "atan(3*v/0.01)", "(sign(v)*(pi/2))*2/pi"),
    ] {
        let found = forms(own);
        assert!(found.len() == 2 && found[0].contains(sticks) && found[1].contains(sharper), "{own}: {found:?}");
    }
}

/// Bristles stand in the place of the simulation's own dry friction, where it has one.
#[test]
fn a_law_can_take_the_place_of_what_it_contains() {
    let dahl = crate::mechanism::mechanism("dahl_friction").unwrap();
    let own = |title: &str| {
        let simulation = specimens().into_iter().find(|s| s.title.starts_with(title)).unwrap();
        let slot = dahl.slots(&Structure::of(&simulation)).remove(0);
        dahl.stands_for(&slot).map(str::to_owned)
    };
    let servo = specimens().into_iter().find(|s| s.title.starts_with("Servo")).unwrap();
    let name = own("Servo").unwrap();
    assert!(servo.parameter(&name).is_some(), "{name}");
    assert_eq!(own("Oscillator"), None);
    // The user may have thought that there is some dry friction at least: of what gives way to bristles nothing need be left.
    let mut bounded = servo;
    bounded.parameter_mut(&name).unwrap().min = Some(0.01);
    let slot = dahl.slots(&Structure::of(&bounded)).remove(0);
    let signals = example_signals(&bounded, &slot);
    for (purpose, least) in [(Purpose::Screening, 0.01), (Purpose::Refit, 0.0)] {
        let written = dahl.rewrite(&bounded, &slot, &signals, purpose).unwrap();
        assert_eq!(written.simulation.parameter(&name).unwrap().min, Some(least));
    }
}

/// Nothing drives or brakes this rotor: the law in each of its forms keeps its energy, which no wrong force beside the mass does.
#[test]
fn an_inertia_that_depends_on_the_angle_keeps_the_energy() {
    let text = "[time]\nperiod_s = 0.002\n[inputs]\nu = \"torque_Nm\"\n[parameters]\nJ = { value = 0.4, min = 0.1, unit = \"kg m^2\" }\n\
                [states]\nq = { derivative = \"w\", initial = 0.3, unit = \"rad\" }\nw = { derivative = \"u/J\", initial = 6.0, unit = \"rad/s\" }\n\
                [outputs]\nangle_rad = \"q\"\nspeed_rad_s = \"w\"\n";
    let rotor = Simulation::parse(text, "rotor.sim.toml").unwrap();
    let inertia = crate::mechanism::mechanism("position_dependent_inertia").unwrap();
    let slot = inertia.slots(&Structure::of(&rotor)).remove(0);
    let signals = example_signals(&rotor, &slot);
    let drive = hysid_plant::Drive::new(0.0, 0.002, 1000, vec![vec![0.0; 1000]]).unwrap();
    // What each form adds to the inertia, by its parameters.
    type Added = fn(f64) -> f64;
    let forms: [(Purpose, &[(&str, f64)], Added); 3] = [
        (Purpose::Refit, &[("m_c", 0.15), ("m_s", -0.1)], |q| 0.15 * (1.0 - (2.0 * q).cos()) - 0.1 * (2.0 * q).sin()),
        (Purpose::Form(Form::Few), &[("m_c", 0.15), ("m_s", -0.1)], |q| 0.15 * (1.0 - q.cos()) - 0.1 * q.sin()),
        (Purpose::Form(Form::Other), &[("m_1", 0.02)], |q| 0.02 * q * q),
    ];
    for (purpose, values, added) in forms {
        let written = inertia.rewrite(&rotor, &slot, &signals, purpose).unwrap();
        let values: Vec<(String, f64)> = values.iter().map(|(name, x)| ((*name).to_owned(), *x)).collect();
        let motion = motion::outputs(&motion::with(&written.simulation, &values), &drive).unwrap();
        let energy = |n: usize| 0.5 * (0.4 + added(motion[0][n])) * motion[1][n].powi(2);
        let most = (0..1000).map(|n| (energy(n) / energy(0) - 1.0).abs()).fold(0.0, f64::max);
        assert!(most < 1e-6, "{purpose:?}: {most}");
        assert!(motion[0][999] > 5.0 && added(motion[0][999]).abs() > 1e-3, "{purpose:?}: {}", motion[0][999]);
    }
}
