//! What the tests of this crate share.

pub mod equations;

use std::path::PathBuf;

/// The folder of shared recordings and simulations beside the checkout, if it is there.
pub fn shared() -> Option<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(std::env::var_os("HYSID_REQUIRE_RECORDINGS").is_none(), "recordings are required but absent");
    println!("skipped: no recordings");
    None
}

/// An oscillator as in the manual.
pub const OSCILLATOR: &str = r#"title = "Oscillator"

[time]
period_s = 0.01

[inputs]
u = "force_N"

[parameters]
m = { value = 2.0, min = 0.5, max = 8.0, unit = "kg" }
c = { value = 3.0, min = 0.0, max = 30.0, unit = "N s/m" }
k = { value = 200.0, min = 20.0, max = 2000.0, unit = "N/m" }

[states]
x = { derivative = "v", initial = 0.0, unit = "m" }
v = { derivative = "(u - c*v - k*x)/m", initial = 0.0, unit = "m/s" }

[outputs]
x_m = "x"
"#;
