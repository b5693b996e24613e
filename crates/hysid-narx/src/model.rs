//! The identified model: terms with coefficients, immutable, and what it predicts.

use hysid_dictionary::{Record, Signals, Term};

use crate::program::Program;
use crate::run::{Rules, run};
use crate::{Bank, Derived, NarxError};

/// A term of a model with what is known of its coefficient.
#[derive(Debug, Clone, PartialEq)]
pub struct Coefficient {
    /// The term.
    pub term: Term,
    /// Its coefficient, in the unit of the output over that of the term.
    pub theta: f64,
    /// Standard error of the coefficient; `NaN` where it is not known.
    pub standard_error: f64,
    /// Error reduction ratio: the share of the output's sum of squares that the term explains beside those before it.
    /// `NaN` where it is not known.
    pub err: f64,
}

/// A term of the noise model: a term of the signals times a past one-step residual e\[n-lag\].
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseTerm {
    /// What multiplies the residual; the constant 1 for a linear noise model.
    pub term: Term,
    /// How many samples ago the residual was, from 1.
    pub lag: usize,
    /// Coefficient.
    pub theta: f64,
}

/// What a model of one system is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// The output, the recorded inputs and then the derived ones.
    pub signals: Signals,
    /// The derived inputs, in the order in which `signals` names them.
    pub derived: Vec<Derived>,
    /// The terms.
    pub coefficients: Vec<Coefficient>,
    /// The noise model; empty for a NARX model. It takes part in one-step predictions only.
    pub noise: Vec<NoiseTerm>,
    /// A run whose output exceeds this size has diverged; in the output's unit.
    pub limit: f64,
    /// Sampling period of the recordings it was made from, in seconds, where it is known.
    pub period_s: Option<f64>,
    /// The model moves in steps of so many samples of the recording, and its inputs are means over these steps.
    pub decimation: usize,
}

/// A polynomial NARX model. Immutable; every run has its own memory.
#[derive(Debug, Clone, PartialEq)]
pub struct NarxModel {
    parts: Parts,
}

/// A predicted output on the clock of the recording that it was asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// One value for each sample; `NaN` where the model has no past, or after a divergence.
    pub y: Vec<f64>,
    /// The first sample at which the run exceeded the model's limit or was not finite.
    pub diverged_at: Option<usize>,
}

impl NarxModel {
    /// The model of these parts.
    ///
    /// # Errors
    /// No terms, terms of signals that there are not, derived inputs that are not possible, numbers that are not finite.
    pub fn new(parts: Parts) -> Result<Self, NarxError> {
        let bad = |what: &str| NarxError::BadFile(what.into());
        let terms: Vec<Term> = parts.coefficients.iter().map(|c| c.term.clone()).collect();
        let noise = parts.noise.iter().map(|t| t.term.clone());
        hysid_dictionary::Dictionary::from_terms(parts.signals.clone(), terms.into_iter().chain(noise))?;
        let Some(recorded) = parts.signals.inputs().len().checked_sub(parts.derived.len()) else {
            return Err(bad("it has more derived inputs than inputs"));
        };
        for (i, d) in parts.derived.iter().enumerate() {
            d.check(recorded + i)?;
        }
        if parts.coefficients.iter().any(|c| !c.theta.is_finite()) || parts.noise.iter().any(|c| !c.theta.is_finite()) {
            return Err(bad("a coefficient is not a finite number"));
        }
        if parts.noise.iter().any(|t| t.lag == 0) {
            return Err(bad("a residual's lag must be 1 or more"));
        }
        if parts.decimation == 0 {
            return Err(bad("the decimation must be 1 or more"));
        }
        if !(parts.limit > 0.0) {
            return Err(bad("the limit must be above 0"));
        }
        Ok(Self { parts })
    }

    /// What it is made of.
    pub fn parts(&self) -> &Parts {
        &self.parts
    }

    /// The signals, derived inputs last.
    pub fn signals(&self) -> &Signals {
        &self.parts.signals
    }

    /// Number of inputs that a recording must have; the derived ones come from these.
    pub fn recorded_inputs(&self) -> usize {
        self.parts.signals.inputs().len() - self.parts.derived.len()
    }

    /// The columns of these inputs, in order.
    pub fn input_columns(&self) -> Vec<&str> {
        self.parts.signals.inputs()[..self.recorded_inputs()].iter().map(|n| n.column.as_str()).collect()
    }

    /// The coefficients, in the order of the terms.
    pub fn theta(&self) -> Vec<f64> {
        self.parts.coefficients.iter().map(|c| c.theta).collect()
    }

    /// The terms.
    pub fn terms(&self) -> Vec<Term> {
        self.parts.coefficients.iter().map(|c| c.term.clone()).collect()
    }

    /// The number of samples that the model reaches back, in its own steps; at least 1, so that a free run has a start.
    pub fn reach(&self) -> usize {
        self.parts.coefficients.iter().map(|c| c.term.reach()).max().unwrap_or(0).max(1)
    }

    /// The model as an equation: `y[n] = 0.5*y[n-1] + ...`.
    pub fn equation(&self) -> String {
        let mut text = format!("{}[n] =", self.parts.signals.output().symbol);
        for (i, c) in self.parts.coefficients.iter().enumerate() {
            let sign = if c.theta < 0.0 { "-" } else { "+" };
            let lead = if i == 0 && c.theta >= 0.0 { " ".to_string() } else { format!(" {sign} ") };
            let name = self.parts.signals.format(&c.term);
            let factor = if c.term.degree() == 0 { String::new() } else { format!("*{name}") };
            text.push_str(&format!("{lead}{}{factor}", c.theta.abs()));
        }
        text
    }

    /// The same model, made from recordings of which only the order of the samples is known.
    #[must_use]
    pub fn without_clock(mut self) -> Self {
        self.parts.period_s = None;
        self
    }

    fn program(&self) -> Program {
        Program::new(&self.terms())
    }

    pub(crate) fn rules(&self) -> Rules {
        Rules { given: self.reach(), limit: self.parts.limit, threshold: self.parts.signals.output().threshold }
    }

    /// The prediction of each sample from the recorded ones before it, with the noise model where there is one.
    ///
    /// A model at a reduced rate predicts each sample from those one of its own steps, and more, before it.
    ///
    /// # Errors
    /// A record that does not fit the model's inputs.
    pub fn one_step(&self, record: &Record<'_>) -> Result<Vec<f64>, NarxError> {
        let each = |r: &Record<'_>| Ok(Prediction { y: self.one_step_at_rate(r)?, diverged_at: None });
        Ok(self.by_phase(record, each)?.y)
    }

    /// Runs `predict` on each of the interleaved recordings that the model's rate leaves, and puts the results together.
    ///
    /// A model that moves in steps of L samples predicts all samples that way, without interpolation. Its inputs are means over
    /// these steps.
    fn by_phase(
        &self,
        record: &Record<'_>,
        predict: impl Fn(&Record<'_>) -> Result<Prediction, NarxError>,
    ) -> Result<Prediction, NarxError> {
        let l = self.parts.decimation;
        if l == 1 {
            return predict(record);
        }
        let means: Vec<Vec<f64>> = record.inputs.iter().map(|u| crate::mean_over_step(u, l)).collect();
        let mut whole = Prediction { y: vec![f64::NAN; record.y.len()], diverged_at: None };
        for phase in 0..l.min(record.y.len()) {
            let take = |x: &[f64]| x.iter().copied().skip(phase).step_by(l).collect::<Vec<f64>>();
            let (y, inputs) = (take(record.y), means.iter().map(|u| take(u)).collect::<Vec<_>>());
            let part = predict(&Record::new(&y, inputs.iter().map(Vec::as_slice).collect()))?;
            for (n, v) in part.y.into_iter().enumerate() {
                whole.y[phase + n * l] = v;
            }
            if let Some(n) = part.diverged_at.map(|n| phase + n * l) {
                whole.diverged_at = Some(whole.diverged_at.map_or(n, |d| d.min(n)));
            }
        }
        Ok(whole)
    }

    fn one_step_at_rate(&self, record: &Record<'_>) -> Result<Vec<f64>, NarxError> {
        let bank = Bank::new(record, &self.parts.derived, &self.parts.signals)?;
        let (program, theta, reach) = (self.program(), self.theta(), self.reach());
        let noise = Program::new(&self.parts.noise.iter().map(|t| t.term.clone()).collect::<Vec<_>>());
        let (inputs, noise_inputs) = (program.inputs(&bank)?, noise.inputs(&bank)?);
        let (mut v, mut w) = (vec![0.0; program.factors.len()], vec![0.0; noise.factors.len()]);
        let start = reach.max(noise.reach);
        let mut y = vec![f64::NAN; bank.len()];
        let mut e = vec![0.0; bank.len()];
        for stretch in &bank.stretches {
            for n in stretch.start + start..stretch.end {
                program.factor_values(n, n, &bank.y, &bank.y_sign, &inputs, &mut v);
                let mut sum = program.sum(&theta, &v);
                noise.factor_values(n, n, &bank.y, &bank.y_sign, &noise_inputs, &mut w);
                for (k, t) in self.parts.noise.iter().enumerate() {
                    if n >= stretch.start + start + t.lag {
                        sum += t.theta * noise.term(k, &w) * e[n - t.lag];
                    }
                }
                y[n] = sum;
                e[n] = bank.y[n] - sum;
            }
        }
        Ok(y)
    }

    /// The output that the model makes of the inputs alone, after the first recorded samples of each gap-free stretch.
    ///
    /// A stretch is one without a gap in the inputs; gaps of the output are run through. A run starts from the first
    /// [`NarxModel::reach`] recorded samples of the output in a row.
    ///
    /// # Errors
    /// A record that does not fit the model's inputs.
    pub fn free_run(&self, record: &Record<'_>) -> Result<Prediction, NarxError> {
        self.by_phase(record, |r| self.simulate(r, None))
    }

    /// Each sample predicted from what was recorded up to `k` samples before it (a whole number of the model's own steps).
    ///
    /// # Errors
    /// A record that does not fit the model's inputs; `k` of 0.
    pub fn k_step(&self, record: &Record<'_>, k: usize) -> Result<Prediction, NarxError> {
        let bad = |problem: &str| NarxError::BadRecord { record: 0, problem: problem.into() };
        match k.div_ceil(self.parts.decimation) {
            0 => Err(bad("a prediction looks at least 1 sample ahead")),
            1 => Ok(Prediction { y: self.one_step(record)?, diverged_at: None }),
            steps => self.by_phase(record, |r| self.simulate(r, Some(steps))),
        }
    }

    fn simulate(&self, record: &Record<'_>, horizon: Option<usize>) -> Result<Prediction, NarxError> {
        // Stretches are those of the inputs: the output is only needed where a run starts.
        let zeros = vec![0.0; record.y.len()];
        let driven = Record { y: &zeros, inputs: record.inputs.clone(), stretches: record.stretches.clone() };
        let mut bank = Bank::new(&driven, &self.parts.derived, &self.parts.signals)?;
        let known = record.gap_free();
        bank.set_output(record.y, &known, self.parts.signals.output().threshold);
        let (program, theta, rules) = (self.program(), self.theta(), self.rules());
        let reach = rules.given;
        let mut y = vec![f64::NAN; bank.len()];
        let mut diverged_at: Option<usize> = None;
        for stretch in bank.stretches.clone() {
            let inside = known.iter().filter(|s| s.start >= stretch.start && s.end <= stretch.end);
            match horizon {
                None => {
                    let Some(start) = inside.clone().find(|s| s.len() >= reach).map(|s| s.start) else { continue };
                    let trace = run(&program, &theta, &bank, &(start..stretch.end), rules)?;
                    let end = trace.diverged.unwrap_or(stretch.end);
                    y[start + reach..end].copy_from_slice(&trace.y[reach..end - start]);
                    diverged_at = diverged_at.or(trace.diverged);
                }
                Some(k) => {
                    for s in inside {
                        for origin in s.start + reach..=s.end {
                            let window = origin - reach..origin + k;
                            if window.end > stretch.end {
                                break;
                            }
                            let trace = run(&program, &theta, &bank, &window, rules)?;
                            match trace.diverged {
                                None => y[origin + k - 1] = trace.y[reach + k - 1],
                                Some(n) => diverged_at = Some(diverged_at.map_or(n, |d| d.min(n))),
                            }
                        }
                    }
                }
            }
        }
        Ok(Prediction { y, diverged_at })
    }
}
