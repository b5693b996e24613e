//! The cases of a full diagnosis: the finished binary on recordings in which one or two effects are concealed.

use hysid_concealed::case::Group;

use super::case::{Case, Contender, Goal, Input, Measure, Program, Side};

const TOOL: &str = "hysid diagnose, 2 threads";

/// Memory that a diagnosis may have.
const MOST_MIB: f64 = 500.0;

/// The cases.
pub fn cases() -> Vec<Case> {
    let case = |name, work, group, most| Case {
        name,
        work,
        samples: 4000,
        input: Input::None,
        measure: Measure::Work,
        contenders: vec![Contender {
            tool: TOOL.into(),
            side: Side::Ours,
            threads: 2,
            program: Program::Diagnose(group),
            words: Vec::new(),
            rounds: usize::MAX,
            over: TOOL,
        }],
        goals: vec![Goal::Wall { tool: TOOL, most }, Goal::Memory { tool: TOOL, most_mib: MOST_MIB }],
        remark: "Each round is another case: the first with 4000 samples of the development bank (`cargo xtask prove --development`), \
                 plants of one to three outputs. Reading the files and writing the report are within.",
    };
    vec![
        case("diagnose-single", "Full diagnosis, 4000 samples, one effect concealed", Group::Single, 5.0),
        case("diagnose-pair", "Full diagnosis, 4000 samples, two effects concealed", Group::Pair, 60.0),
    ]
}
