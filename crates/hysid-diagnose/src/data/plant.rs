//! A data set as `hysid-plant` takes it.

use hysid_plant::{Compiled, Data};

use super::DataSet;

/// Data of `hysid-plant` for each stretch.
pub fn plant_data(compiled: &Compiled, data: &DataSet) -> Option<Vec<Data>> {
    let states = compiled.simulation().states.len();
    data.stretches
        .iter()
        .map(|s| {
            let mut d = Data::new(compiled, "", s.drive.clone(), s.outputs.clone()).ok()?;
            d.offset = s.samples.start;
            if s.samples.start > 0 {
                d.free = (0..states).collect();
            }
            Some(d)
        })
        .collect()
}
