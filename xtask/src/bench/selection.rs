//! The cases of term selection, and the free run of what was selected.

use super::case::{Case, Contender, Goal, Input, Measure, Program, Side, words};

/// The data and the settings that all tools get.
#[derive(Clone, Copy)]
struct Task {
    samples: usize,
    lags: usize,
    terms: usize,
    freerun: usize,
}

impl Task {
    fn words(self, front: &str, reps: usize) -> Vec<String> {
        let Self { samples, lags, terms, freerun } = self;
        words(&format!(
            "{front} --data {{in}} --n {samples} --ny {lags} --nu {lags} --degree 3 --terms {terms} --reps {reps} --freerun {freerun}"
        ))
    }

    /// Ours at one and at two threads.
    fn ours(self, search: &str, reps: usize) -> Vec<Contender> {
        let one = |tool: &str, threads: usize| Contender {
            tool: tool.into(),
            side: Side::Ours,
            threads,
            program: Program::Hysid,
            words: self.words(&format!("bench --search {search} --threads {threads}"), reps),
            rounds: usize::MAX,
            over: ONE,
        };
        vec![one(ONE, 1), one(TWO, 2)]
    }

    /// Another tool's script and its variant.
    fn peer(self, script: &str, variant: &str, threads: usize, reps: usize) -> Contender {
        Contender {
            tool: format!("{script} {variant}{}", if threads == 1 { "" } else { ", 2 threads" }),
            side: Side::Peer,
            threads,
            program: Program::Shared,
            words: self.words(&format!("bench_{script}.py --variant {variant}"), reps),
            rounds: usize::MAX,
            over: if threads == 1 { ONE } else { TWO },
        }
    }
}

const ONE: &str = "hysid";
const TWO: &str = "hysid, 2 threads";

/// The two goals that every comparison with other tools has.
fn ahead(times: f64) -> Vec<Goal> {
    vec![Goal::Ahead { ours: ONE, times }, Goal::Ahead { ours: TWO, times }]
}

/// Two threads cost nothing where the work is small.
const FREE: Goal = Goal::Within { tool: TWO, other: ONE, times: 1.1 };
const SMALL_MEMORY: Goal = Goal::Memory { tool: TWO, most_mib: 100.0 };

/// The cases.
pub fn cases() -> Vec<Case> {
    let known = Input::Known("0.01");
    let measure = Measure::Work;
    let mut cases = Vec::new();

    let task = Task { samples: 1_000, lags: 3, terms: 11, freerun: 0 };
    let mut contenders = task.ours("greedy", 51);
    contenders.extend([task.peer("fastcan", "h", 1, 5), task.peer("sysidentpy", "frols", 1, 5)]);
    cases.push(Case {
        name: "small",
        work: "Select 11 of 84 terms, N = 1000",
        samples: task.samples,
        input: known.clone(),
        measure,
        contenders,
        goals: vec![Goal::Ahead { ours: ONE, times: 15.0 }, FREE],
        remark: "",
    });

    let task = Task { samples: 10_000, lags: 5, terms: 15, freerun: 0 };
    let mut contenders = task.ours("greedy", 11);
    contenders.extend([task.peer("fastcan", "h", 1, 3), task.peer("sysidentpy", "frols", 1, 1)]);
    cases.push(Case {
        name: "medium",
        work: "Select 15 of 286 terms, N = 10 000",
        samples: task.samples,
        input: known.clone(),
        measure,
        contenders,
        goals: vec![Goal::Ahead { ours: ONE, times: 30.0 }, FREE],
        remark: "",
    });

    let task = Task { samples: 100_000, lags: 10, terms: 20, freerun: 0 };
    let mut contenders = task.ours("greedy", 3);
    for threads in [1, 2] {
        contenders.push(task.peer("fastcan", "h", threads, 1));
        contenders.push(task.peer("sysidentpy", "frols", threads, 1).at_most(1));
    }
    cases.push(Case {
        name: "large",
        work: "Select 20 of 1771 terms, N = 100 000",
        samples: task.samples,
        input: known.clone(),
        measure,
        contenders,
        goals: ahead(100.0).into_iter().chain([SMALL_MEMORY]).collect(),
        remark: "SysIdentPy takes a minute and is run once.",
    });

    let task = Task { samples: 1_000_000, lags: 5, terms: 15, freerun: 0 };
    let mut contenders = task.ours("greedy", 3);
    for threads in [1, 2] {
        contenders.push(task.peer("fastcan", "h", threads, 1));
    }
    contenders.push(task.peer("sysidentpy", "frols", 2, 1).at_most(1));
    cases.push(Case {
        name: "huge",
        work: "Select 15 of 286 terms, N = 1 000 000",
        samples: task.samples,
        input: known.clone(),
        measure,
        contenders,
        goals: ahead(100.0).into_iter().chain([SMALL_MEMORY]).collect(),
        remark: "SysIdentPy takes a minute and a half and is run once.",
    });

    // By themselves: other tools take minutes, in which the machine may have become another.
    for (name, work, samples, lags, terms) in [
        ("large-threads", "Two threads beside one: 20 of 1771 terms, N = 100 000", 100_000, 10, 20),
        ("huge-threads", "Two threads beside one: 15 of 286 terms, N = 1 000 000", 1_000_000, 5, 15),
    ] {
        cases.push(Case {
            name,
            work,
            samples,
            input: known.clone(),
            measure,
            contenders: Task { samples, lags, terms, freerun: 0 }.ours("greedy", 5),
            goals: vec![Goal::Speedup { one: ONE, two: TWO, least: 1.8 }],
            remark: "",
        });
    }

    let task = Task { samples: 10_000, lags: 3, terms: 11, freerun: 0 };
    let mut contenders = task.ours("default", 11);
    contenders.push(task.peer("fastcan", "beam10", 1, 1));
    cases.push(Case {
        name: "search",
        work: "All true terms: the default search beside a beam of ten, N = 10 000, no noise",
        samples: task.samples,
        input: Input::Known("0"),
        measure,
        contenders,
        goals: vec![Goal::Ahead { ours: ONE, times: 50.0 }, FREE],
        remark: "",
    });

    let task = Task { samples: 1_000, lags: 3, terms: 30, freerun: 0 };
    cases.push(Case {
        name: "press",
        work: "Stopped by exact PRESS, N = 1000",
        samples: task.samples,
        input: known.clone(),
        measure,
        contenders: task.ours("press", 51),
        goals: vec![Goal::Wall { tool: ONE, most: 1e-3 }, FREE],
        remark: "SysIdentPy's leave-one-out selector gives no answer within a minute.",
    });

    let task = Task { samples: 100_000, lags: 3, terms: 11, freerun: 100_000 };
    let mut contenders = task.ours("greedy", 1);
    contenders.truncate(1);
    contenders.extend([task.peer("fastcan", "h", 1, 1), task.peer("sysidentpy", "frols", 1, 1)]);
    cases.push(Case {
        name: "free-run",
        work: "Free run of a model of 11 terms, 100 000 samples",
        samples: task.freerun,
        input: known,
        measure: Measure::FreeRun,
        contenders,
        goals: vec![Goal::Rate { tool: ONE, least: 5e7 }],
        remark: "Wall seconds, as each tool gives them; each tool runs the model that it selected.",
    });
    cases
}
