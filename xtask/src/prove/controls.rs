//! `--controls`: the false alarms alone, from the controls of a bank, where nothing is missing.
//!
//! No competitor is fitted, so that many controls can be judged in the time that a whole bank takes for a few.

use std::fmt::Write as _;
use std::time::Instant;

use hysid_concealed::case::{Group, Label, Wanted};
use hysid_concealed::noise::Noise;

use super::trial::{Bench, Trial};
use super::verdict::Verdict;
use super::{Args, Bank, page, score};

/// A control and what was said of it.
struct Control {
    label: Label,
    trial: Trial,
}

impl Control {
    fn alarmed(&self) -> bool {
        self.trial.verdict.as_ref().is_ok_and(Verdict::alarmed)
    }

    fn line(&self) -> String {
        format!(
            "{}: {} on {:?}, {:?}, {} samples, {} noise of {:.1} %",
            self.label.id,
            page::said(&self.trial.verdict),
            self.label.plant,
            self.label.excitation,
            self.label.samples,
            self.label.noise.name().replace('_', " "),
            100.0 * self.label.noise_level
        )
    }
}

/// Diagnoses the controls of the bank; prints the false alarms and writes `controls.txt`, one line for each control.
pub(super) fn run(bench: &Bench, bank: &Bank, args: &Args, start: Instant) -> anyhow::Result<()> {
    let heard = |noise: Noise| args.noise.as_ref().is_none_or(|kind| kind == noise.name());
    let wanted = |plan: &Wanted| plan.group == Group::Control && plan.noise.is_some_and(heard);
    let list = bank.each(&wanted, &|case| Ok(Control { label: case.label.clone(), trial: bench.run(case)? }))?;
    let command = super::command(args, bank.range.len());
    println!("{}", markdown(&list, &command, start.elapsed().as_secs_f64()));
    let out = crate::root().join(&args.out);
    std::fs::create_dir_all(&out)?;
    let lines: String = list.iter().map(|c| c.line() + "\n").collect();
    std::fs::write(out.join("controls.txt"), lines)?;
    println!("each control: {}", out.join("controls.txt").display());
    Ok(())
}

fn markdown(list: &[Control], command: &str, took: f64) -> String {
    let seconds: Vec<f64> = list.iter().map(|c| c.trial.seconds).collect();
    let times = page::times(&seconds);
    let mut text = format!("`{command}`: {} controls in {took:.0} s; a diagnosis takes {times}.\n\n", list.len());
    let heard: Vec<_> = list.iter().map(|c| (c.label.noise, c.alarmed())).collect();
    page::lines(&mut text, &score::false_alarms(&heard));
    let mut told = |what: &str, these: &dyn Fn(&Control) -> bool| {
        let these: Vec<&Control> = list.iter().filter(|c| these(c)).collect();
        let _ = writeln!(text, "{what} ({}):\n", these.len());
        for control in these {
            let _ = writeln!(text, "- {}", control.line());
        }
        text.push('\n');
    };
    told("False alarms", &Control::alarmed);
    told("Without a verdict", &|c| c.trial.verdict.is_err());
    text
}

#[cfg(test)]
mod tests {
    use hysid_concealed::bank;
    use hysid_concealed::seed::Stream;

    use super::*;

    #[test]
    fn an_alarm_is_counted_under_its_noise_and_told() {
        let said = |alarm: bool| {
            let kind = if alarm { "ambiguous" } else { "no_significant_mismatch" };
            Verdict::read(&format!(r#"{{"verdict":"{kind}","mismatch":{{"p_value":0.01}}}}"#))
                .map_err(|e| e.to_string())
        };
        let label = |nth: usize| {
            let plans = (0..100).filter(|i| bank::plan(Stream::Development, 1, *i).group == Group::Control);
            bank::case(Stream::Development, 1, plans.clone().nth(nth).unwrap()).label
        };
        let control = |nth, verdict| Control {
            label: label(nth),
            trial: Trial { seconds: 1.0, verdict, after: None, after_louder: None },
        };
        let list = [control(0, said(true)), control(1, said(false)), control(2, Err("fell over".into()))];
        let text = markdown(&list, "c", 1.0);
        assert!(text.contains("| False alarms on controls (gate) | <= 1.5 % | 33.3 % |"), "{text}");
        let noise = list[0].label.noise.name().replace('_', " ");
        let line = text.lines().find(|l| l.contains(&format!("under {noise} noise"))).unwrap();
        assert!(line.contains("**missed**"), "{line}");
        assert!(text.contains(&format!("False alarms (1):\n\n- {}: ambiguous", list[0].label.id)), "{text}");
        assert!(text.contains(&format!("Without a verdict (1):\n\n- {}: BROKEN fell over", list[2].label.id)));
    }
}
