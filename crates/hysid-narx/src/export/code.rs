//! The model as C and as Python that need nothing else: feed what is known, then step.
//!
//! Both keep, for each signal, its last samples with the present one at index 0, so that one text serves both languages:
//! `y[1]*x[0][2]` is y\[n-1\] times the first input two samples ago. Products and sums are taken in the model's own order.

use std::fmt::Write;

use hysid_dictionary::{Factor, Quantity, Signal};

use crate::{Law, NarxModel, Past};

impl NarxModel {
    /// A C99 source: `hysid_known` feeds a recorded sample, `hysid_step` returns the next output. No allocation.
    ///
    /// The noise model takes no part. A model at a reduced rate wants one call for each of its own steps, with the inputs'
    /// means over the step.
    pub fn to_c(&self) -> String {
        let p = Plan::of(self);
        let mut c = String::new();
        for line in p.head(self) {
            _ = writeln!(c, "/* {} */", line.replace("*/", "* /"));
        }
        _ = write!(
            c,
            "#include <math.h>\n\n\
             enum {{ HYSID_INPUTS = {recorded}, HYSID_SIGNALS = {signals}, HYSID_PAST = {past}, HYSID_REACH = {reach} }};\n\n\
             typedef struct {{\n    int started;\n    double y[HYSID_PAST], y_sign[HYSID_PAST];\n    \
             double x[HYSID_SIGNALS + 1][HYSID_PAST], x_sign[HYSID_SIGNALS + 1][HYSID_PAST];\n}} hysid_state; /* start with all zero */\n\n\
             static void hysid_push(double *h) {{\n    for (int i = HYSID_PAST - 1; i > 0; --i) h[i] = h[i - 1];\n}}\n\n\
             static double hysid_sign(double before, double d, double threshold) {{\n    \
             return fabs(d) <= threshold ? before : (d < 0.0 ? -1.0 : 1.0);\n}}\n\n\
             static void hysid_inputs(hysid_state *s, const double *u) {{\n    \
             double (*x)[HYSID_PAST] = s->x;\n    static const double threshold[HYSID_SIGNALS + 1] = {{{thresholds}}};\n    \
             for (int i = 0; i < HYSID_SIGNALS; ++i) {{ hysid_push(x[i]); hysid_push(s->x_sign[i]); }}\n    \
             for (int i = 0; i < HYSID_INPUTS; ++i) x[i][0] = u[i];\n",
            recorded = p.recorded,
            signals = p.signals,
            past = p.past,
            reach = self.reach(),
            thresholds = p.thresholds(),
        );
        for (i, d) in self.parts().derived.iter().enumerate() {
            let (w, x) = (p.recorded + i, d.source);
            let line = match &d.law {
                Law::Play { half_width, past } => format!(
                    "x[{w}][0] = fmax(x[{x}][0] - {r}, fmin(x[{x}][0] + {r}, s->started ? x[{w}][1] : {start}));",
                    r = number(*half_width),
                    start = match past {
                        Past::FirstSample => format!("x[{x}][0]"),
                        Past::RestedAt(h) => number(*h),
                        Past::TurnedAt(h) => format!(
                            "({h} <= x[{x}][0] ? {h} + {r} : {h} - {r})",
                            h = number(*h),
                            r = number(*half_width)
                        ),
                    }
                ),
                Law::Dahl { length } => format!(
                    "{{ double d = s->started ? x[{x}][0] - x[{x}][1] : 0.0, g = d < 0.0 ? -1.0 : 1.0, w = s->started ? x[{w}][1] : 0.0; \
                     x[{w}][0] = d == 0.0 ? w : g + (w - g) * exp(-fabs(d) / {}); }}",
                    number(*length)
                ),
                Law::Filter { a } => format!("x[{w}][0] = s->started ? {} : x[{x}][0];", filter(a, w, x)),
                Law::SoftThreshold { centre, width } => format!(
                    "{{ double z = (x[{x}][0] - {}) / {s}; x[{w}][0] = {s} * (fmax(z, 0.0) + log1p(exp(-fabs(z)))); }}",
                    number(*centre),
                    s = number(*width)
                ),
            };
            _ = writeln!(c, "    {line}");
        }
        _ = write!(
            c,
            "    for (int i = 0; i < HYSID_SIGNALS; ++i) {{\n        if (s->started) {{\n            \
             s->x_sign[i][0] = hysid_sign(s->x_sign[i][1], x[i][0] - x[i][1], threshold[i]);\n        }} else {{\n            \
             for (int k = 0; k < HYSID_PAST; ++k) {{ x[i][k] = x[i][0]; s->x_sign[i][k] = 1.0; }}\n        }}\n    }}\n}}\n\n\
             static void hysid_output(hysid_state *s, double y) {{\n    s->y[0] = y;\n    \
             s->y_sign[0] = s->started ? hysid_sign(s->y_sign[1], y - s->y[1], {threshold}) : 1.0;\n    s->started = 1;\n}}\n\n\
             /* A recorded sample; at least HYSID_REACH of them before the first step. */\n\
             void hysid_known(hysid_state *s, const double *u, double y) {{\n    hysid_inputs(s, u);\n    \
             hysid_push(s->y); hysid_push(s->y_sign);\n    hysid_output(s, y);\n}}\n\n\
             /* The output for the next inputs. */\n\
             double hysid_step(hysid_state *s, const double *u) {{\n    hysid_inputs(s, u);\n    \
             hysid_push(s->y); hysid_push(s->y_sign);\n    \
             const double *y = s->y, *y_sign = s->y_sign;\n    double (*x)[HYSID_PAST] = s->x, (*x_sign)[HYSID_PAST] = s->x_sign;\n    \
             (void)y; (void)y_sign; (void)x; (void)x_sign;\n    double sum = 0.0;\n",
            threshold = number(self.signals().output().threshold),
        );
        for line in p.sums(self) {
            _ = writeln!(c, "    {line};");
        }
        c.push_str("    hysid_output(s, sum);\n    return sum;\n}\n");
        c
    }

    /// A Python module without imports but `math`: class `Model` with `known(u, y)` and `step(u)`; `u` is a list.
    ///
    /// As [`NarxModel::to_c`] otherwise.
    pub fn to_python(&self) -> String {
        let p = Plan::of(self);
        let mut py = String::new();
        for line in p.head(self) {
            _ = writeln!(py, "# {line}");
        }
        _ = write!(
            py,
            "import math\n\nINPUTS, SIGNALS, PAST, REACH = {recorded}, {signals}, {past}, {reach}\nTHRESHOLD = [{thresholds}]\n\n\n\
             def _sign(before, d, threshold):\n    return before if abs(d) <= threshold else (-1.0 if d < 0.0 else 1.0)\n\n\n\
             class Model:\n    def __init__(self):\n        self.started = False\n        \
             self.y, self.y_sign = [0.0] * PAST, [1.0] * PAST\n        \
             self.x = [[0.0] * PAST for _ in range(SIGNALS)]\n        self.x_sign = [[1.0] * PAST for _ in range(SIGNALS)]\n\n    \
             def _inputs(self, u):\n        x, started = self.x, self.started\n        \
             for h in x + self.x_sign:\n            h.pop()\n            h.insert(0, h[0])\n        \
             for i in range(INPUTS):\n            x[i][0] = float(u[i])\n",
            recorded = p.recorded,
            signals = p.signals,
            past = p.past,
            reach = self.reach(),
            thresholds = p.thresholds(),
        );
        for (i, d) in self.parts().derived.iter().enumerate() {
            let (w, x) = (p.recorded + i, d.source);
            let lines = match &d.law {
                Law::Play { half_width, past } => vec![format!(
                    "x[{w}][0] = max(x[{x}][0] - {r}, min(x[{x}][0] + {r}, x[{w}][1] if started else {start}))",
                    r = number(*half_width),
                    start = match past {
                        Past::FirstSample => format!("x[{x}][0]"),
                        Past::RestedAt(h) => number(*h),
                        Past::TurnedAt(h) => format!(
                            "({h} + {r} if {h} <= x[{x}][0] else {h} - {r})",
                            h = number(*h),
                            r = number(*half_width)
                        ),
                    }
                )],
                Law::Dahl { length } => vec![
                    format!("d, w = (x[{x}][0] - x[{x}][1], x[{w}][1]) if started else (0.0, 0.0)"),
                    "g = -1.0 if d < 0.0 else 1.0".to_string(),
                    format!("x[{w}][0] = w if d == 0.0 else g + (w - g) * math.exp(-abs(d) / {})", number(*length)),
                ],
                Law::Filter { a } => vec![format!("x[{w}][0] = {} if started else x[{x}][0]", filter(a, w, x))],
                Law::SoftThreshold { centre, width } => vec![
                    format!("z = (x[{x}][0] - {}) / {}", number(*centre), number(*width)),
                    format!("x[{w}][0] = {} * (max(z, 0.0) + math.log1p(math.exp(-abs(z))))", number(*width)),
                ],
            };
            for line in lines {
                _ = writeln!(py, "        {line}");
            }
        }
        _ = write!(
            py,
            "        for i in range(SIGNALS):\n            if started:\n                \
             self.x_sign[i][0] = _sign(self.x_sign[i][1], x[i][0] - x[i][1], THRESHOLD[i])\n            else:\n                \
             x[i][:] = [x[i][0]] * PAST\n        for h in (self.y, self.y_sign):\n            h.pop()\n            h.insert(0, h[0])\n\n    \
             def _output(self, y):\n        self.y[0] = y\n        \
             self.y_sign[0] = _sign(self.y_sign[1], y - self.y[1], {threshold}) if self.started else 1.0\n        \
             self.started = True\n        return y\n\n    \
             def known(self, u, y):\n        \"\"\"A recorded sample; at least REACH of them before the first step.\"\"\"\n        \
             self._inputs(u)\n        self._output(float(y))\n\n    \
             def step(self, u):\n        \"\"\"The output for the next inputs.\"\"\"\n        self._inputs(u)\n        \
             y, y_sign, x, x_sign = self.y, self.y_sign, self.x, self.x_sign\n        sum = 0.0\n",
            threshold = number(self.signals().output().threshold),
        );
        for line in p.sums(self) {
            _ = writeln!(py, "        {line}");
        }
        py.push_str("        return self._output(sum)\n");
        py
    }
}

/// Sizes of the generated code.
struct Plan {
    recorded: usize,
    signals: usize,
    past: usize,
    thresholds: Vec<f64>,
}

impl Plan {
    fn of(model: &NarxModel) -> Self {
        let longest = model.parts().derived.iter().map(|d| d.law.parameters().len()).max().unwrap_or(0);
        let thresholds = model.signals().inputs().iter().map(|n| n.threshold).collect::<Vec<_>>();
        let past = model.reach().max(longest) + 2;
        Self { recorded: model.recorded_inputs(), signals: thresholds.len(), past, thresholds }
    }

    fn thresholds(&self) -> String {
        let all: Vec<String> = self.thresholds.iter().map(|t| number(*t)).chain(["0.0".to_string()]).collect();
        all.join(", ")
    }

    /// What the reader needs to know, a line each.
    fn head(&self, model: &NarxModel) -> Vec<String> {
        let mut head = vec!["Made by hysid. The model:".to_string(), format!("  {}", model.equation())];
        for (i, n) in model.signals().inputs().iter().enumerate() {
            let what = match i.checked_sub(self.recorded) {
                None => format!("column {}", n.column),
                Some(d) => {
                    let d = &model.parts().derived[d];
                    d.law.describe(&model.signals().inputs()[d.source].symbol)
                }
            };
            head.push(format!("  x[{i}] is {}: {what}", n.symbol));
        }
        if model.parts().decimation > 1 {
            head.push(format!("One step is {} samples; inputs are means over a step.", model.parts().decimation));
        }
        head
    }

    /// One statement for each term.
    fn sums(&self, model: &NarxModel) -> Vec<String> {
        let coefficient = |c: &crate::Coefficient| {
            let product: Vec<String> = c.term.factors().iter().map(|f| factor(*f)).collect();
            match product.is_empty() {
                true => format!("sum += {}", number(c.theta)),
                false => format!("sum += {} * ({})", number(c.theta), product.join(" * ")),
            }
        };
        model.parts().coefficients.iter().map(coefficient).collect()
    }
}

fn factor(f: Factor) -> String {
    let history = |kind: &str| match f.quantity.signal() {
        Signal::Output => format!("y{kind}"),
        Signal::Input(i) => format!("x{kind}[{i}]"),
    };
    match f.quantity {
        Quantity::Value(_) => format!("{}[{}]", history(""), f.lag),
        Quantity::Difference(_) => format!("({h}[{}] - {h}[{}])", f.lag, f.lag + 1, h = history("")),
        Quantity::Sign(_) => format!("{}[{}]", history("_sign"), f.lag),
    }
}

fn filter(a: &[f64], w: usize, x: usize) -> String {
    let gain = 1.0 + a.iter().sum::<f64>();
    let mut text = format!("{} * x[{x}][0]", number(gain));
    for (i, a) in a.iter().enumerate() {
        _ = write!(text, " - {} * x[{w}][{}]", number(*a), i + 1);
    }
    text
}

/// A number that both languages read back to the same bits.
fn number(x: f64) -> String {
    if x < 0.0 { format!("({x:e})") } else { format!("{x:e}") }
}
