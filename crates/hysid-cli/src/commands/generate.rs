//! `hysid generate`: a recording of a hysteresis operator under a chosen excitation, with noise, as a CSV file.
//!
//! Everything is a function of the options: the same command writes the same bytes.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;

use clap::ValueEnum;
use hysid_hysteresis::catalogue::{self, Entry, Kind};
use hysid_io::LARGEST_VALUE;
use hysid_signal::tell::digits;
use hysid_signal::{
    Channel, Clock, Excitation, ExcitationError, Recording, autoregressive_noise, modulate, variance_for_snr,
};

use crate::failure::Failure;

/// Write a recording of a hysteresis operator (made-up data for trying things out)
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The operator, as in `bouc-wen`; `--list` shows them all
    operator: Option<String>,
    /// Show the operators, or with OPERATOR its parameters, and write nothing
    #[arg(long)]
    list: bool,
    /// Set a parameter of the operator (may be repeated)
    #[arg(long, value_name = "NAME=VALUE", value_parser = name_and_value)]
    set: Vec<(String, String)>,
    /// The file to write
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// Number of samples
    #[arg(long, default_value_t = 4000)]
    samples: usize,
    /// Sampling period in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.01)]
    period: f64,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    input: Input,
    /// Variance of the noise on the output
    #[arg(long, value_name = "V", conflicts_with = "snr")]
    noise_variance: Option<f64>,
    /// Signal-to-noise ratio of the output in dB (ratio of variances)
    #[arg(long, value_name = "DB", allow_hyphen_values = true)]
    snr: Option<f64>,
    /// Colour the noise by an autoregression: e[n] = A1 e[n-1] + A2 e[n-2] + ... + white
    #[arg(long, value_name = "A1,A2,...", value_delimiter = ',', allow_hyphen_values = true)]
    noise_colour: Vec<f64>,
    /// Name of the input's column; end it in the unit, as in u_V
    #[arg(long, default_value = "u")]
    input_name: String,
    /// Name of the output's column
    #[arg(long, default_value = "y")]
    output_name: String,
    /// Significant digits to write, 1 to 17
    #[arg(long, default_value_t = 17, value_parser = clap::value_parser!(u8).range(1..=17))]
    digits: u8,
}

/// The input signal.
#[derive(Debug, clap::Args)]
struct Input {
    /// Shape of the input
    #[arg(long, value_enum, default_value_t = Shape::Multisine)]
    excitation: Shape,
    /// Largest absolute value of the input, before the offset
    #[arg(long, default_value_t = 1.0, allow_hyphen_values = true)]
    amplitude: f64,
    /// Added to the input
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true)]
    offset: f64,
    /// Sine, triangle, reversals: frequency [default: 10 periods in the recording]
    #[arg(long, value_name = "HZ")]
    frequency: Option<f64>,
    /// Reversals: ratio of one to the one before [default: 0.9]
    #[arg(long)]
    ratio: Option<f64>,
    /// Chirp: first frequency; multisine: lowest [default: 1 period in the recording]
    #[arg(long, value_name = "HZ")]
    from: Option<f64>,
    /// Chirp: last frequency; multisine: highest [default: a tenth of the Nyquist frequency]
    #[arg(long, value_name = "HZ")]
    to: Option<f64>,
    /// Multisine: samples after which it repeats [default: never]
    #[arg(long, value_name = "SAMPLES")]
    repeat: Option<usize>,
    /// Prbs: order of the shift register, 3 to 20 [default: 10]
    #[arg(long)]
    order: Option<u32>,
    /// Prbs, steps: samples for which a value is held [default: 20]
    #[arg(long, value_name = "SAMPLES")]
    hold: Option<usize>,
    /// Modulate the amplitude by this depth, 0 to 1, so that minor loops occur
    #[arg(long, value_name = "DEPTH", default_value_t = 0.0)]
    modulation: f64,
    /// Frequency of the modulation [default: 3 periods in the recording]
    #[arg(long, value_name = "HZ")]
    modulation_frequency: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Shape {
    Sine,
    Triangle,
    /// Decaying reversals: nested minor loops
    Reversals,
    Chirp,
    /// Random-phase multisine
    Multisine,
    /// Pseudo-random binary sequence
    Prbs,
    /// Random levels
    Steps,
}

/// More samples than this are refused: the two columns then take 1.6 GB.
const MOST_SAMPLES: usize = 100_000_000;

/// Runs `hysid generate`.
pub fn run(args: &Args) -> Result<(), Failure> {
    let entry = args.operator.as_deref().map(find).transpose()?;
    if args.list {
        let text = entry.map_or_else(list_of_operators, list_of_parameters);
        // A reader that closes the pipe early (`| head`) is no failure.
        let _ = std::io::stdout().write_all(text.as_bytes());
        return Ok(());
    }
    let Some(entry) = entry else {
        return Err(Failure::BadInput("generate: name an operator; `hysid generate --list` shows them".into()));
    };
    let Some(out) = &args.out else {
        return Err(Failure::BadInput("generate: name the file to write by --out FILE.csv".into()));
    };
    if !(2..=MOST_SAMPLES).contains(&args.samples) {
        let message = format!("generate: --samples {} is not allowed; it must be 2 to {MOST_SAMPLES}", args.samples);
        return Err(Failure::BadInput(message));
    }
    if let Some(repeat) = args.input.repeat.filter(|repeat| !(1..=MOST_SAMPLES).contains(repeat)) {
        let message = format!("generate: --repeat {repeat} is not allowed; it must be 1 to {MOST_SAMPLES}");
        return Err(Failure::BadInput(message));
    }
    if !(args.period > 0.0 && args.period.is_finite()) {
        let message = format!("generate: --period {} is not allowed; it must be a finite number above 0", args.period);
        return Err(Failure::BadInput(message));
    }
    hysid_io::check_writable(out).map_err(Failure::bad_input)?;
    let recording = record(args, entry)?;
    hysid_io::write_recording(out, &recording).map_err(Failure::bad_input)?;
    let range = |channel: &Channel| {
        let (low, high) = channel.samples.iter().fold((f64::MAX, f64::MIN), |(l, h), s| (l.min(*s), h.max(*s)));
        format!("{} from {low:.4} to {high:.4}", channel.name)
    };
    let ranges: Vec<String> = recording.channels().iter().map(range).collect();
    eprintln!("{}: {} samples of {}; {}", out.display(), recording.len(), entry.name, ranges.join(", "));
    Ok(())
}

fn find(name: &str) -> Result<&'static Entry, Failure> {
    catalogue::find(name).ok_or_else(|| {
        let known = catalogue::all().iter().map(|e| e.name).collect::<Vec<_>>().join(", ");
        Failure::BadInput(format!("generate: there is no operator `{name}`; there are {known}"))
    })
}

/// Input and output as a recording.
fn record(args: &Args, entry: &Entry) -> Result<Recording, Failure> {
    let operator = entry.build(&args.set, args.period).map_err(Failure::bad_input)?;
    let u = args.input.signal(args.samples, args.period, args.seed)?;
    let mut y = operator.respond(&u);
    let beyond = |x: &f64| !(x.abs() <= LARGEST_VALUE);
    if let Some(n) = u.iter().zip(&y).position(|(u, y)| beyond(u) || beyond(y)) {
        let message = format!(
            "generate: the recording would hold the input {} and the output {} of {} (sample {n}); the largest magnitude that a recording may hold is {LARGEST_VALUE:e}",
            digits(u[n], 4),
            digits(y[n], 4),
            entry.name
        );
        return Err(Failure::BadInput(message));
    }
    let variance = match (args.noise_variance, args.snr) {
        (Some(variance), _) => variance,
        (None, Some(snr)) => variance_for_snr(&y, snr).map_err(Failure::bad_input)?,
        (None, None) if args.noise_colour.is_empty() => 0.0,
        (None, None) => {
            return Err(Failure::BadInput("generate: --noise-colour needs --noise-variance or --snr".into()));
        }
    };
    // Input and noise draw from streams of their own.
    let noise_seed = args.seed ^ 0x6e6f_6973_6500_0000;
    let noise = autoregressive_noise(&args.noise_colour, y.len(), variance, noise_seed).map_err(Failure::bad_input)?;
    for (y, e) in y.iter_mut().zip(noise) {
        *y += e;
    }
    for name in [&args.input_name, &args.output_name] {
        if name.is_empty() || name == "t_s" {
            return Err(Failure::BadInput(format!("generate: a column cannot be named `{name}`")));
        }
    }
    let round = |samples: Vec<f64>| samples.into_iter().map(|s| significant(s, args.digits)).collect();
    let channels = vec![
        Channel { name: args.input_name.clone(), samples: round(u) },
        Channel { name: args.output_name.clone(), samples: round(y) },
    ];
    Recording::new(entry.name, Clock { start_s: 0.0, period_s: args.period }, channels).map_err(Failure::bad_input)
}

/// A number rounded to this many significant digits.
fn significant(x: f64, digits: u8) -> f64 {
    if digits >= 17 { x } else { format!("{x:.*e}", usize::from(digits) - 1).parse().unwrap_or(x) }
}

impl Input {
    fn signal(&self, samples: usize, period_s: f64, seed: u64) -> Result<Vec<f64>, Failure> {
        self.refuse_options_of_other_shapes()?;
        let once = 1.0 / (samples as f64 * period_s);
        let frequency_hz = self.frequency.unwrap_or(10.0 * once);
        let (from, to) = (self.from.unwrap_or(once), self.to.unwrap_or(0.05 / period_s));
        let hold = self.hold.unwrap_or(20);
        let shape = match self.excitation {
            Shape::Sine => Excitation::Sine { frequency_hz },
            Shape::Triangle => Excitation::Triangle { frequency_hz },
            Shape::Reversals => Excitation::DecayingReversals { frequency_hz, ratio: self.ratio.unwrap_or(0.9) },
            Shape::Chirp => Excitation::Chirp { from_hz: from, to_hz: to },
            Shape::Multisine => {
                Excitation::Multisine { lowest_hz: from, highest_hz: to, period: self.repeat.unwrap_or(samples) }
            }
            Shape::Prbs => Excitation::Prbs { order: self.order.unwrap_or(10), hold },
            Shape::Steps => Excitation::Steps { hold },
        };
        if !self.offset.is_finite() {
            return Err(Failure::BadInput(format!("generate: --offset {} is not a finite number", self.offset)));
        }
        let mut u = shape.signal(samples, period_s, self.amplitude, seed).map_err(|e| refused(&e, "--frequency"))?;
        if self.modulation != 0.0 {
            let frequency_hz = self.modulation_frequency.unwrap_or(3.0 * once);
            modulate(&mut u, period_s, self.modulation, frequency_hz)
                .map_err(|e| refused(&e, "--modulation-frequency"))?;
        }
        for u in &mut u {
            *u += self.offset;
        }
        Ok(u)
    }

    /// An option that the shape does not have is a mistake, not something to pass over.
    fn refuse_options_of_other_shapes(&self) -> Result<(), Failure> {
        use Shape::{Chirp, Multisine, Prbs, Reversals, Sine, Steps, Triangle};
        let options: [(&str, bool, &[Shape]); 7] = [
            ("--frequency", self.frequency.is_some(), &[Sine, Triangle, Reversals]),
            ("--ratio", self.ratio.is_some(), &[Reversals]),
            ("--from", self.from.is_some(), &[Chirp, Multisine]),
            ("--to", self.to.is_some(), &[Chirp, Multisine]),
            ("--repeat", self.repeat.is_some(), &[Multisine]),
            ("--order", self.order.is_some(), &[Prbs]),
            ("--hold", self.hold.is_some(), &[Prbs, Steps]),
        ];
        for (option, given, shapes) in options {
            if given && !shapes.contains(&self.excitation) {
                let names: Vec<String> =
                    shapes.iter().filter_map(|s| Some(s.to_possible_value()?.get_name().to_owned())).collect();
                let message = format!("generate: {option} belongs to the excitation {}", names.join(", "));
                return Err(Failure::BadInput(message));
            }
        }
        if self.modulation_frequency.is_some() && self.modulation == 0.0 {
            return Err(Failure::BadInput("generate: --modulation-frequency needs --modulation".into()));
        }
        Ok(())
    }
}

/// The message of an excitation under the option that gives its parameter; `frequency` is the one for `frequency_hz`.
fn refused(error: &ExcitationError, frequency: &'static str) -> Failure {
    let option = match error.parameter {
        "frequency_hz" => frequency,
        "lowest_hz" | "from_hz" => "--from",
        "highest_hz" | "to_hz" => "--to",
        "band_hz" => "the band (--from to --to)",
        "period_s" => "--period",
        "amplitude" => "--amplitude",
        "ratio" => "--ratio",
        "order" => "--order",
        "hold" => "--hold",
        "depth" => "--modulation",
        // A parameter that is new here is told by its own name.
        other => other,
    };
    Failure::BadInput(format!("generate: {option} {} is not allowed; it must be {}", error.given, error.allowed))
}

fn name_and_value(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or_else(|| "write it as NAME=VALUE".to_owned())?;
    Ok((name.trim().to_owned(), value.trim().to_owned()))
}

fn list_of_operators() -> String {
    let mut text = String::from("Operators (`hysid generate OPERATOR --list` shows the parameters):\n\n");
    for entry in catalogue::all() {
        let _ = writeln!(text, "  {:20}{}", entry.name, entry.summary);
    }
    text
}

fn list_of_parameters(entry: &Entry) -> String {
    let mut text = format!("{}: {}\n\nParameters, set by --set NAME=VALUE:\n\n", entry.name, entry.summary);
    for parameter in entry.parameters {
        let choices = match parameter.kind {
            Kind::Choice(choices) => format!(" ({})", choices.join(", ")),
            _ => String::new(),
        };
        let default = parameter.default_text();
        let _ = writeln!(text, "  {:20}{default:12}{}{choices}", parameter.name, parameter.meaning);
    }
    text
}
