//! Reading and printing simulation files.

use hysid_plant::{BinaryOp, Expr, Function, Initial, Memory, Parameter, Simulation, Unit};
use proptest::prelude::*;

#[test]
fn the_manuals_example_reads_and_prints() {
    let simulation = Simulation::parse(crate::common::OSCILLATOR, "oscillator.sim.toml").expect("valid");
    assert_eq!(simulation.to_toml(), crate::common::OSCILLATOR);
}

#[test]
fn every_shared_simulation_reads_and_survives_printing() {
    let Some(shared) = crate::common::shared() else { return };
    let mut count = 0;
    for entry in std::fs::read_dir(shared.join("simulations")).expect("folder").flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if !name.ends_with(".sim.toml") {
            continue;
        }
        let text = std::fs::read_to_string(entry.path()).expect("readable");
        let simulation = Simulation::parse(&text, &name).unwrap_or_else(|e| panic!("{e}"));
        let printed = simulation.to_toml();
        assert_eq!(Simulation::parse(&printed, &name).as_ref(), Ok(&simulation), "{printed}");
        count += 1;
    }
    assert_eq!(count, 9);
}

#[test]
fn expressions_print_with_the_fewest_parentheses() {
    for (given, expected) in [
        ("a+b*c", "a + b*c"),
        ("(a+b)*c", "(a + b)*c"),
        ("a-(b-c)", "a - (b - c)"),
        ("(a-b)-c", "a - b - c"),
        ("a/(b*c)", "a/(b*c)"),
        ("a/b*c", "a/b*c"),
        ("a^b^c", "a^b^c"),
        ("(a^b)^c", "(a^b)^c"),
        ("-a^2", "-a^2"),
        ("(-a)^2", "(-a)^2"),
        ("-3^2", "-3^2"),
        ("(-3)^2", "(-3)^2"),
        ("2*-3", "2*(-3)"),
        ("a^-2", "a^(-2)"),
        ("- - a", "-(-a)"),
        ("min(a , play(x,r))", "min(a, play(x, r))"),
        ("1e-9*x + 3E7", "1e-9*x + 3e7"),
        (".5*x", "0.5*x"),
        ("d*v + d(u)", "d*v + d(u)"),
    ] {
        let expr = Expr::parse(given).unwrap_or_else(|e| panic!("{given}: {e}"));
        assert_eq!(expr.to_string(), expected);
        assert_eq!(Expr::parse(expected).as_ref(), Ok(&expr), "{given}");
    }
}

#[test]
fn simplification_removes_what_has_no_effect() {
    for (given, expected) in [
        ("u + 0*sign(v)", "u"),
        ("(u - c*v - 0)/m", "(u - c*v)/m"),
        ("1*x^1 + 0", "x"),
        ("0 - x", "-x"),
        ("a - -b", "a + b"),
        ("2*3*x", "6*x"),
        ("x/3*1", "x/3"),
        ("1/3*x", "1/3*x"),
        ("1/0", "1/0"),
        ("abs(-3)*x", "3*x"),
    ] {
        assert_eq!(Expr::parse(given).expect(given).simplified().to_string(), expected, "{given}");
    }
}

#[test]
fn units_multiply_and_compare() {
    let unit = |text: &str| Unit::parse(text).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(unit("N s/m").times(&unit("m/s")).to_string(), "N");
    assert_eq!(unit("N").per(&unit("m^3")).to_string(), "N/m^3");
    assert!(unit("N").same_dimension(&unit("kg m/s^2")));
    assert!(unit("N s/(cm V)").same_dimension(&unit("N s/mm").per(&unit("V"))));
    assert!(unit("rad/s").same_dimension(&unit("1/s")));
    assert!(!unit("N").same_dimension(&unit("N m")));
    assert!(unit("S V").same_dimension(&unit("A")) && unit("mS").same_dimension(&unit("1/ohm")));
    // Of a name that is not known nothing is certain, but for what stands beside it on both sides.
    assert!(unit("N").clashes(&unit("N m")) && unit("psi m").clashes(&unit("psi")));
    assert!(!unit("psi").clashes(&unit("Pa")) && !unit("N").clashes(&unit("kg m/s^2")));
    for (long, brief) in [
        ("Ohm^2/V^2", "1/A^2"),
        ("N m V/(A ohm)", "N m"),
        ("m^2 Pa", "N"),
        ("kg m/s^2", "N"),
        ("A ohm", "V"),
        // What is as short, holds an angle, or is a multiple of another.
        ("V s", "V s"),
        ("N s/m", "N s/m"),
        ("N m/rad", "N m/rad"),
        ("N m s/rad", "N m s/rad"),
        ("V s A/rad", "N m"),
        ("m^2 bar", "m^2 bar"),
        ("mm^2 Pa", "mm^2 Pa"),
    ] {
        assert_eq!(unit(long).briefly().to_string(), brief, "{long}");
    }
    for (column, expected) in [
        ("v_cm_s", Some("cm/s")),
        ("force_N", Some("N")),
        ("inflow_m3_s", Some("m^3/s")),
        ("flow_L_min", Some("L/min")),
        ("a_m_s2", Some("m/s^2")),
        ("t_s", Some("s")),
        ("rest_min", Some("min")),
        ("time_on_s", Some("s")),
        ("supply_NL_s", None),
        ("conc_mol_L", Some("mol/L")),
        ("density_kg_m3", Some("kg/m^3")),
        ("stroke_mm_V", Some("mm/V")),
        ("level_h_m", Some("m")),
        ("H_A_per_m", Some("A/m")),
        ("c_N_s_per_mm", Some("N s/mm")),
        ("loss_W_per_m2_K", Some("W/(m^2 K)")),
        ("parts_per_m", None),
        ("u_per", None),
        ("torque_N_m", None),
        ("H_A_m", None),
        ("x_m2", None),
        ("valve", None),
    ] {
        assert_eq!(Unit::of_column(column).map(|u| u.to_string()).as_deref(), expected, "{column}");
    }
    // A flow through a hole goes with the root of the level.
    for torricelli in ["cm^0.5/s", "cm^2.5/s", "1/m^1.5", "N.m^2.5"] {
        let twice = unit(torricelli).power(2);
        assert!(unit(&unit(torricelli).to_string()) == unit(torricelli), "{torricelli}");
        assert!(twice.per(&unit(torricelli)).same_dimension(&unit(torricelli)), "{torricelli}");
    }
    assert_eq!(unit("cm^2.5/s").to_string(), "cm^2.5/s");
    assert!(unit("cm^0.5/s").power(2).same_dimension(&unit("m/s^2")));
    assert_eq!(unit("m^2").root(), Some(unit("m")));
    assert_eq!(unit("m").root(), None);
    for bad in ["m^0.37", "m^nan", "m^0.", "m^13", "m^0", "N/(m/s", "N^x", "0 m", "/", "m^99"] {
        assert!(Unit::parse(bad).is_err(), "{bad}");
    }
}

fn expression() -> impl Strategy<Value = Expr> {
    let leaf = prop_oneof![
        (-1e9..1e9f64).prop_map(Expr::Number),
        (-20..20i32).prop_map(|n| Expr::Number(f64::from(n))),
        Just(Expr::Number(1.25e-17)),
        "[abd][a-z0-9_]{0,3}q".prop_map(Expr::Symbol),
        Just(Expr::symbol("t")),
        Just(Expr::symbol("d")),
    ];
    leaf.prop_recursive(5, 40, 3, |inner| {
        let op = prop_oneof![
            Just(BinaryOp::Add),
            Just(BinaryOp::Sub),
            Just(BinaryOp::Mul),
            Just(BinaryOp::Div),
            Just(BinaryOp::Pow)
        ];
        prop_oneof![
            inner.clone().prop_map(|a| -a),
            (op, inner.clone(), inner.clone()).prop_map(|(op, a, b)| Expr::Binary(op, Box::new(a), Box::new(b))),
            (0..Function::ALL.len(), inner.clone(), inner.clone()).prop_map(|(i, a, b)| {
                let f = Function::ALL[i].0;
                Expr::Call(f, if f.arity() == 1 { vec![a] } else { vec![a, b] })
            }),
            (0..Memory::ALL.len(), inner.clone(), inner.clone(), inner).prop_map(|(i, a, b, c)| {
                let m = Memory::ALL[i].0;
                let mut arguments = vec![a, b, c];
                arguments.truncate(m.arity());
                Expr::Memory(m, arguments)
            }),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn a_printed_expression_reads_back_the_same(expr in expression()) {
        let text = expr.to_string();
        prop_assert_eq!(Expr::parse(&text), Ok(expr), "{}", text);
    }

    #[test]
    fn a_printed_simulation_reads_back_the_same(
        title in "[ -~\\n\\t]{0,20}",
        value in 0.0..1e12f64,
        min in prop::option::of(-1e3..0.0f64),
        fixed in any::<bool>(),
        factor in -1e6..1e6f64,
        column in "[a-z][ -~]{0,8}",
    ) {
        let mut simulation = Simulation::parse(crate::common::OSCILLATOR, "o").expect("valid");
        simulation.title = title;
        simulation.outputs[0].column = column;
        simulation.outputs[0].expression = Expr::Number(factor) * "x" + Expr::symbol("extra").pow(2.0).play("extra");
        let mut extra = Parameter::new("extra", value).within(min.unwrap_or(-1.0), 2e12);
        extra.fixed = fixed;
        simulation.parameters.push(extra);
        simulation.states[0].initial = Initial::Expr(Expr::symbol("extra") / 2.0);
        simulation.states[1].initial = Initial::Free;
        let printed = simulation.to_toml();
        prop_assert_eq!(Simulation::parse(&printed, "o"), Ok(simulation), "{}", printed);
    }

    #[test]
    fn no_text_makes_the_parser_panic(text in ".{0,60}") {
        let _ = Expr::parse(&text);
        let _ = Simulation::parse(&text, "x");
        let _ = Unit::parse(&text);
    }
}
