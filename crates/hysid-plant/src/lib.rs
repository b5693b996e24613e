//! Simulation files (`.sim.toml`): parse, compile, simulate, sensitivities, calibrate.
