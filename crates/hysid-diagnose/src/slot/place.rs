//! The kinds of places.

/// What kind of place a slot is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Place {
    /// Before the plant: the input is replaced wherever it is used.
    Input,
    /// A motion that an input prescribes to a force law with states, where it goes no further than a limit or begins late.
    Prescribed,
    /// Inside a cascade: what one part passes on to the next, without anything coming back.
    Between,
    /// What a controller inside the simulation puts out.
    Command,
    /// A winding that an input feeds, whose current is a state: what is induced there.
    Winding,
    /// The force on a moving part, against the ground.
    Force,
    /// The force between two moving parts.
    Connection,
    /// The output of a static relation, as a force law.
    ForceLaw,
    /// The output of a static relation, beside the curve along which it follows an input that is no motion: induction over field.
    Curve,
    /// The rate of a hysteresis loop that the simulation has.
    Loop,
    /// The half-widths of the plays of an input that the simulation has.
    Plays,
    /// A first-order state that holds something.
    Store,
    /// A first-order electrical state, whose own law is to it what a spring is to a displacement: flux in iron, the charge of a varactor.
    Circuit,
    /// The measured output, as a sensor.
    Sensor,
    /// What the sensors of one moving part see together: several of them, or an accelerometer.
    Sensors,
    /// A parameter.
    Parameter,
    /// An external force or flow.
    Disturbance,
}
