//! What a case is: who is timed on what, what its row is put over, and the goals.

/// Whose program it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Ours, or a yardstick that needs no Python: always run.
    Ours,
    /// Another tool: with `--peers` only.
    Peer,
}

/// The program that is run; the words are its arguments.
#[derive(Debug, Clone)]
pub enum Program {
    /// `target/release/hysid`.
    Hysid,
    /// `target/release/timed`.
    Timed,
    /// `crates/hysid-bench/peers/bouc_wen.c`, compiled with `cc -O3`.
    Compiled,
    /// A script of the comparison of term selection.
    Shared,
    /// A script of `crates/hysid-bench/peers`.
    Script,
    /// `hysid diagnose` on a recording in which effects are concealed, another one in each round.
    Diagnose(hysid_concealed::case::Group),
}

/// One of those that are compared.
#[derive(Debug, Clone)]
pub struct Contender {
    /// Its name in the table, unique within the case.
    pub tool: String,
    pub side: Side,
    pub threads: usize,
    pub program: Program,
    /// Arguments. `{in}` and `{out}` stand for the data file and for the file that receives the output.
    pub words: Vec<String>,
    /// Rounds that it takes part in; what takes a minute may take part in fewer.
    pub rounds: usize,
    /// The contender that its time is put over.
    pub over: &'static str,
}

impl Contender {
    /// Takes part in at most this many rounds.
    pub fn at_most(self, rounds: usize) -> Self {
        Self { rounds, ..self }
    }
}

/// What is to be reached. Contenders are named by their `tool`.
#[derive(Debug, Clone)]
pub enum Goal {
    /// The fastest other tool on as many threads takes at least `times` as long as ours.
    Ahead { ours: &'static str, times: f64 },
    /// `slow` takes at least `times` as long as `quick`.
    Faster { quick: &'static str, slow: &'static str, times: f64 },
    /// `tool` takes at most `times` as long as `other`.
    Within { tool: &'static str, other: &'static str, times: f64 },
    /// So many samples in a second of CPU time.
    Rate { tool: &'static str, least: f64 },
    /// Wall seconds.
    Wall { tool: &'static str, most: f64 },
    /// Peak memory.
    Memory { tool: &'static str, most_mib: f64 },
    /// Wall time at one thread over wall time at two.
    Speedup { one: &'static str, two: &'static str, least: f64 },
}

/// What a repetition's time is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// The whole of it.
    Work,
    /// The free run of the model that was found.
    FreeRun,
}

/// The data file of a case.
#[derive(Debug, Clone)]
pub enum Input {
    /// Input and output of the known system with this equation noise.
    Known(&'static str),
    /// An input that `timed input` makes.
    Doubles(&'static str),
    /// None.
    None,
}

/// A case of the comparison.
pub struct Case {
    pub name: &'static str,
    /// What is done, the heading of its table.
    pub work: &'static str,
    /// Samples that the times are for; what is measured on fewer is scaled.
    pub samples: usize,
    pub input: Input,
    pub measure: Measure,
    pub contenders: Vec<Contender>,
    pub goals: Vec<Goal>,
    /// What the reader of the table should know.
    pub remark: &'static str,
}

/// Words from a line.
pub fn words(line: &str) -> Vec<String> {
    line.split_whitespace().map(str::to_string).collect()
}
