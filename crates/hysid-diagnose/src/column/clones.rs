//! The clones that are tried for a simulated column, as simulation files: static, first order, integrating, second order, two of these in
//! a row. Gains, frequencies and damping are free; the offset is what the simulator says and is not calibrated again.

use hysid_plant::Unit;

/// What the clones are made for.
pub(super) struct Wanted<'a> {
    /// Input columns.
    pub inputs: &'a [String],
    /// The simulated column.
    pub column: &'a str,
    /// The measured column, whose unit the clone has.
    pub output: &'a str,
    /// Name of the time column.
    pub time: &'a str,
    pub period_s: f64,
    pub samples: usize,
    /// Size of the column over that of the first input.
    pub gain: f64,
    /// Mean of the column, and its rms about it.
    pub mean: f64,
    pub scale: f64,
}

/// Names of parameters: what they are to people.
pub(super) fn meaning(name: &str) -> &'static str {
    match name {
        "w" | "w2" => "frequency",
        "z" | "z2" => "damping ratio",
        "a" => "rate of decay",
        _ => "gain",
    }
}

impl Wanted<'_> {
    /// Clones in order of size.
    pub fn texts(&self) -> Vec<String> {
        let length = self.samples as f64 * self.period_s;
        let slow = std::f64::consts::TAU * 2.0 / length;
        let fast = 1.5 / self.period_s;
        let middle = (slow * fast).sqrt();
        let w = |name: &str, value: f64, fast: f64| self.parameter(name, value, slow, fast, Some("1/s"));
        let z = |name: &str, value: f64| self.parameter(name, value, 1e-4, 5.0, Some("-"));
        let (x, v, p, q) = (self.unit(0), self.unit(1), self.unit(0), self.unit(1));
        let u = self.drive();
        let second = format!(
            "x = {{ derivative = \"v\", initial = \"free\"{x} }}\nv = {{ derivative = \"w^2*({u} - x) - 2*z*w*v\", initial = \"free\"{v} }}\n"
        );
        vec![
            self.file(&self.gains(0, 1.0), "", &u),
            self.file(
                &(self.gains(0, 1.0) + &w("w", middle, fast)),
                &format!("x = {{ derivative = \"w*({u} - x)\", initial = \"free\"{x} }}\n"),
                "x",
            ),
            self.file(
                &(self.gains(2, middle * middle) + &self.parameter("a", middle, 0.0, fast, Some("1/s"))),
                &format!("x = {{ derivative = \"v\", initial = \"free\"{x} }}\nv = {{ derivative = \"{u} - a*v\", initial = \"free\"{v} }}\n"),
                "x",
            ),
            self.file(&(self.gains(0, 1.0) + &w("w", middle, fast) + &z("z", 0.2)), &second, "x"),
            self.file(
                &(self.gains(0, 1.0)
                    + &w("w", middle, fast)
                    + &z("z", 0.2)
                    + &w("w2", 2.0 * middle, 3.0 * fast)
                    + &z("z2", 0.5)),
                &format!(
                    "{second}p = {{ derivative = \"q\", initial = \"free\"{p} }}\nq = {{ derivative = \"w2^2*(x - p) - 2*z2*w2*q\", initial = \"free\"{q} }}\n"
                ),
                "p",
            ),
        ]
    }

    fn file(&self, parameters: &str, states: &str, y: &str) -> String {
        let inputs: String =
            self.inputs.iter().enumerate().map(|(i, c)| format!("u{} = {}\n", i + 1, quoted(c))).collect();
        let states = if states.is_empty() { String::new() } else { format!("[states]\n{states}") };
        // A mean of rounding errors is none.
        let far = 10.0 * (self.mean.abs() + self.scale);
        let offset = self.parameter("o", self.mean, -far, far, self.of_output().as_deref());
        format!(
            "title = {}\n[time]\ncolumn = {}\n[inputs]\n{inputs}[parameters]\n{parameters}{offset}{states}[outputs]\n{} = \"{y} + o\"\n",
            quoted(&format!("Clone of {}", self.column)),
            quoted(self.time),
            quoted(self.column)
        )
    }

    fn parameter(&self, name: &str, value: f64, low: f64, high: f64, unit: Option<&str>) -> String {
        let unit = unit.filter(|_| self.of_output().is_some()).map(|u| format!(", unit = \"{u}\"")).unwrap_or_default();
        format!("{name} = {{ value = {value:e}, min = {low:e}, max = {high:e}{unit} }}\n")
    }

    /// Gains of all inputs, per second to this power.
    fn gains(&self, per_second: i32, factor: f64) -> String {
        let size = factor * self.gain;
        let second = Unit::parse("s").ok();
        (1..=self.inputs.len())
            .map(|i| {
                let unit = self.output_unit().zip(Unit::of_column(&self.inputs[i - 1])).zip(second.as_ref());
                let unit = unit.map(|((y, u), s)| y.per(&u).per(&s.power(per_second)).to_string());
                self.parameter(&format!("g{i}"), size, -1e3 * size, 1e3 * size, unit.as_deref())
            })
            .collect()
    }

    fn drive(&self) -> String {
        (1..=self.inputs.len()).map(|i| format!("g{i}*u{i}")).collect::<Vec<_>>().join(" + ")
    }

    /// The unit of the output, where all columns have one: part of the units would clash or mislead.
    fn output_unit(&self) -> Option<Unit> {
        let unit = Unit::of_column(self.output)?;
        self.inputs.iter().all(|i| Unit::of_column(i).is_some()).then_some(unit)
    }

    fn of_output(&self) -> Option<String> {
        self.output_unit().map(|u| u.to_string())
    }

    /// The unit of a state: the output's, per second to this power.
    fn unit(&self, per_second: i32) -> String {
        let second = Unit::parse("s").ok();
        let unit =
            self.output_unit().zip(second).map(|(y, s)| if per_second == 0 { y } else { y.per(&s.power(per_second)) });
        unit.map(|u| format!(", unit = \"{u}\"")).unwrap_or_default()
    }
}

/// A string of TOML.
pub(super) fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysid_plant::Simulation;

    #[test]
    fn every_clone_is_a_simulation_with_and_without_units() {
        for (inputs, output, time) in [
            (vec!["u_V".to_owned()], "y_mm", "t_s"),
            (vec!["force_N".to_owned(), "valve".to_owned()], "y_sim", "t_s"),
            (vec!["a \"b\" \\c".to_owned()], "out put", "my time"),
        ] {
            let wanted = Wanted {
                inputs: &inputs,
                column: "sim \"1\"",
                output,
                time,
                period_s: 0.01,
                samples: 1000,
                gain: 2.0,
                mean: -3.0,
                scale: 0.5,
            };
            let all = wanted.texts();
            assert_eq!(all.len(), 5);
            for text in all {
                let s = Simulation::parse(&text, "clone").unwrap_or_else(|e| panic!("{e}\n{text}"));
                assert_eq!(s.outputs[0].column, "sim \"1\"");
                assert_eq!(s.parameter("g1").unwrap().unit.is_some(), output == "y_mm");
            }
        }
    }
}
