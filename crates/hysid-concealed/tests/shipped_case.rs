//! `fixtures/oscillator` is what `fixtures/README.md` says it is: the case comes out again, byte for byte.

use std::path::Path;

use hysid_concealed::bank;
use hysid_concealed::seed::Stream;

#[test]
fn the_shipped_case_is_remade() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/oscillator");
    let folder = tempfile::tempdir().unwrap();
    bank::case(Stream::Development, 1, 94).write(folder.path()).unwrap();
    for file in ["baseline.sim.toml", "est.csv", "val.csv"] {
        let shipped = std::fs::read_to_string(fixtures.join(file)).unwrap();
        let remade = std::fs::read_to_string(folder.path().join(file)).unwrap();
        assert!(shipped == remade, "{file} is no longer what the generator makes");
    }
}
