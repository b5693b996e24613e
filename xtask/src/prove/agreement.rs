//! Two simulators that share no code agree: the bank's machine without effects and the engine's run of the simulation file.
//!
//! Without this a "control" could hold a difference that no user made.

use hysid_concealed::body::Kind;
use hysid_concealed::case::simulation;
use hysid_concealed::design::Design;
use hysid_concealed::input::Input;
use hysid_concealed::seed::{Random, Stream};
use hysid_concealed::strength::spread;
use hysid_plant::{Compiled, Drive, Run, Simulation};

#[test]
fn the_baseline_file_describes_the_machine() {
    for (i, &kind) in Kind::ALL.iter().enumerate() {
        for draw in 0..4 {
            let mut random = Random::for_case(Stream::Development, 99, (10 * i + draw) as u64);
            let design = Design::draw(kind, 1000, &mut random);
            let source = design.source(&mut random, design.excitation, 1000);
            let machine = design.machine(Vec::new());
            let (input, clean) = design.run(&machine, &source, &vec![0.0; 1000]).unwrap();
            let text = simulation(&design, &design.theta, None, "0.0");
            let compiled = Compiled::new(&Simulation::parse(&text, "baseline.sim.toml").unwrap()).unwrap();
            let columns = match &input {
                Input::Held { values, .. } => vec![values.clone()],
                Input::Motion { motion, period, samples } => {
                    let (q, v): (Vec<f64>, Vec<f64>) = (0..*samples).map(|k| motion.at(k as f64 * period)).unzip();
                    if kind.inputs().len() > 1 { vec![q, v] } else { vec![q] }
                }
            };
            let drive = Drive::new(0.0, design.period, 1000, columns).unwrap();
            let theta = compiled.theta();
            let outputs = compiled.simulate(&Run::new(&drive, &theta)).outputs;
            for (ours, theirs) in clean.iter().zip(&outputs) {
                let off = ours.iter().zip(theirs).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 1000.0;
                let share = off.sqrt() / spread(ours);
                // The smallest noise is 0.5 % and the smallest effect a tenth of it.
                assert!(share < 1e-4, "{kind:?} draw {draw}: the simulators differ by {share:.1e} of the output");
            }
        }
    }
}
