//! Hysteresis operators: an immutable model and a separate state for each, with the laws they obey as a conformance suite.
