//! The cases of the operators and of simulation, beside loops in C and numba, scipy, and a package with a Preisach model.

use super::case::{Case, Contender, Goal, Input, Measure, Program, Side, words};

const MODEL: &str = "crates/hysid-bench/models/friction.sim.toml";
/// D, A, B and G of the Bouc-Wen operator, and the sampling period.
const BOUC_WEN: &str = "1.6 0.9 0.08 0.02 0.001";

fn contender(tool: &str, program: Program, line: &str, over: &'static str) -> Contender {
    let side = if matches!(program, Program::Script) { Side::Peer } else { Side::Ours };
    Contender { tool: tool.into(), side, threads: 1, program, words: words(line), rounds: usize::MAX, over }
}

/// The cases.
pub fn cases() -> Vec<Case> {
    vec![preisach(), bouc_wen(), simulation()]
}

fn preisach() -> Case {
    const FEW: &str = "staircase, 100 x 100";
    const MANY: &str = "staircase, 1000 x 1000";
    let timed = |tool: &str, line: &str, over| contender(tool, Program::Timed, line, over);
    let ferro = |tool: &str, line: &str, over| {
        contender(tool, Program::Script, &format!("preisach_ferro.py {line} {{in}} {{out}}"), over)
    };
    Case {
        name: "preisach",
        work: "Preisach operator, 1 000 000 random samples",
        samples: 1_000_000,
        input: Input::Doubles("random"),
        measure: Measure::Work,
        contenders: vec![
            timed(FEW, "staircase 100 1000000 5 {in} {out}", FEW),
            timed(MANY, "staircase 1000 1000000 5 {in} {out}", MANY),
            timed("own relay grid, 100 x 100", "grid 100 20000 3 {in} {out}", FEW),
            timed("own relay grid, 1000 x 1000", "grid 1000 500 3 {in} {out}", MANY),
            ferro("Ferro 0.3.0, 100 x 100", "100 200 1", FEW),
            ferro("Ferro 0.3.0, 1000 x 1000", "1000 4 1", MANY),
        ],
        goals: vec![
            Goal::Faster { quick: MANY, slow: "own relay grid, 1000 x 1000", times: 1000.0 },
            Goal::Rate { tool: FEW, least: 1e7 },
            Goal::Rate { tool: MANY, least: 1e7 },
            Goal::Within { tool: MANY, other: FEW, times: 1.5 },
        ],
        remark: "The relay grids are measured on 20 000 and 500 samples, Ferro (a Python loop over its relays) on 200 and 4; their cost \
                 for a sample does not depend on the number of samples.",
    }
}

fn bouc_wen() -> Case {
    const OURS: &str = "hysid";
    let line = |front: &str, n: usize, reps: usize| format!("{front} {n} {reps} {{in}} {{out}} {BOUC_WEN}");
    Case {
        name: "bouc-wen",
        work: "Bouc-Wen operator, Runge-Kutta, 1 000 000 samples",
        samples: 1_000_000,
        input: Input::Doubles("modulated"),
        measure: Measure::Work,
        contenders: vec![
            contender(OURS, Program::Timed, &line("bouc-wen", 1_000_000, 7), OURS),
            contender("C loop, cc -O3", Program::Compiled, &line("", 1_000_000, 7), OURS),
            contender("numba loop", Program::Script, &line("bouc_wen.py numba", 1_000_000, 7), OURS),
            contender("scipy solve_ivp", Program::Script, &line("bouc_wen.py scipy", 1000, 1), OURS),
        ],
        goals: vec![Goal::Within { tool: OURS, other: "C loop, cc -O3", times: 1.5 }],
        remark: "solve_ivp (RK45, 1e-6 relative) is measured on 1000 samples.",
    }
}

fn simulation() -> Case {
    const ONE: &str = "hysid, one run";
    const BATCH: &str = "hysid, each of 32";
    let timed = |tool: &str, form: &str, reps: usize| {
        let line = format!("simulate {form} 3 4000 {reps} {MODEL} {{in}} {{out}}");
        contender(tool, Program::Timed, &line, if form == "batch" { BATCH } else { ONE })
    };
    let script = |tool: &str, form: &str, samples: usize, reps: usize| {
        let line = format!("simulation.py {form} 3 {samples} {reps} {MODEL} {{in}} {{out}}");
        contender(tool, Program::Script, &line, if form == "batch" { BATCH } else { ONE })
    };
    Case {
        name: "simulation",
        work: "Simulation of an oscillator with dry friction, 4000 samples, 3 steps in each",
        samples: 4000,
        input: Input::Doubles("force"),
        measure: Measure::Work,
        contenders: vec![
            timed(ONE, "one", 31),
            timed(BATCH, "batch", 9),
            script("numba loop that sticks", "sticking", 4000, 31),
            script("numba loop, sign(v) as it stands", "plain", 4000, 31),
            script("numba, each of 32", "batch", 4000, 9),
            script("scipy solve_ivp", "scipy", 400, 1),
        ],
        goals: vec![
            Goal::Within { tool: ONE, other: "numba loop that sticks", times: 3.0 },
            Goal::Within { tool: ONE, other: "numba loop, sign(v) as it stands", times: 3.0 },
            Goal::Within { tool: BATCH, other: "numba loop that sticks", times: 1.0 },
            Goal::Within { tool: BATCH, other: "numba, each of 32", times: 1.0 },
        ],
        remark: "The file is `crates/hysid-bench/models/friction.sim.toml`. The loop that sticks cuts a step where the velocity \
                 changes its sign and lets the mass rest, as our engine does; the other chatters. solve_ivp is measured on 400 samples.",
    }
}
