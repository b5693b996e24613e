//! The path to a model as the user sees it: errors against the number of terms.
//!
//! Beside the free-run errors, which decide, stands what one-step regression would have gone by: the leave-one-out error
//! (PRESS) of the same terms with least-squares coefficients. Where the two disagree, the free run is right.

use hysid_dictionary::{Design, Dictionary, Record};
use hysid_narx::{Trainer, Window};
use hysid_select::{Criterion, Options, Search};
use serde::Serialize;

use super::IdentifyError;
use super::desk::Desk;
use super::family::Family;
use super::growth::Stage;

/// One model on the path. An error is infinite (`null` in a file) where the run diverged.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PathPoint {
    /// Number of terms.
    pub terms: usize,
    /// Free-run error (root mean square) on the samples that the search looked at.
    pub taught: f64,
    /// Free-run error on the held-out blocks.
    pub held: f64,
    /// Leave-one-out error of one step ahead, the root of PRESS over the number of samples, of the same terms with
    /// least-squares coefficients on the samples that the search looked at.
    pub press: f64,
}

/// Samples that PRESS is computed on.
const LOOK: usize = 9000;

/// The stages as points, one for each number of terms: of models with as many terms the one with the lowest held-out error.
pub(crate) fn path(desk: &Desk<'_>, family: &Family, stages: &[Stage]) -> Result<Vec<PathPoint>, IdentifyError> {
    let mut trainer = desk.trainer(&family.derived, family.given())?;
    let windows = desk.split(&trainer, LOOK)?.search;
    let mut stages: Vec<&Stage> = stages.iter().collect();
    stages.sort_by(|a, b| a.fit.terms.len().cmp(&b.fit.terms.len()).then(a.held.rmse.total_cmp(&b.held.rmse)));
    stages.dedup_by_key(|s| s.fit.terms.len());
    if stages.is_empty() {
        return Ok(Vec::new());
    }
    let terms = stages.iter().flat_map(|s| s.fit.terms.iter().cloned());
    let dictionary = Dictionary::from_terms(trainer.signals().clone(), terms)?;
    let mut points = Vec::with_capacity(stages.len());
    for stage in stages {
        trainer.enter(&stage.fit.derived);
        let columns: Vec<usize> =
            stage.fit.terms.iter().filter_map(|t| dictionary.terms().iter().position(|d| d == t)).collect();
        let press = press(&trainer, &windows, &dictionary, columns)?;
        points.push(PathPoint {
            terms: stage.fit.terms.len(),
            taught: stage.taught.rmse,
            held: stage.held.rmse,
            press,
        });
    }
    Ok(points)
}

/// The leave-one-out error (root mean square) of these columns of the dictionary over the windows.
fn press(
    trainer: &Trainer,
    windows: &[Window],
    dictionary: &Dictionary,
    columns: Vec<usize>,
) -> Result<f64, IdentifyError> {
    let records: Vec<Record<'_>> = trainer
        .banks()
        .iter()
        .enumerate()
        .map(|(i, b)| {
            let here = windows.iter().filter(|w| w.record == i).map(|w| w.range.clone());
            Record { stretches: Some(here.collect()), ..b.record() }
        })
        .collect();
    let design = Design::new(dictionary, &records)?;
    let how = Options {
        search: Search::Greedy,
        criterion: Criterion::Terms(columns.len()),
        forced: columns,
        ..Options::default()
    };
    let chosen = hysid_select::select(&design, &design.target(), &how);
    let chosen = chosen.map_err(|e| IdentifyError::Option(e.to_string()))?;
    let last = chosen.steps.last().map_or(1.0, |s| s.press);
    Ok((last * chosen.target_energy / chosen.samples.max(1) as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::super::data::gather;
    use super::super::{Options as Choices, Source};
    use super::*;
    use hysid_linalg::{Matrix, lstsq};
    use hysid_signal::{Channel, Clock, Recording};

    #[test]
    fn press_is_the_error_of_leaving_out_each_sample_of_the_windows() {
        let u: Vec<f64> = (0..60).map(|n| f64::from((n * n * 7) % 31) / 15.0 - 1.0).collect();
        let y: Vec<f64> = (0..60).map(|n| u[n] * u[n] + 0.3 * f64::from(((n * 13) % 17) as u8) / 17.0).collect();
        let channel = |name: &str, x: &[f64]| Channel { name: name.into(), samples: x.to_vec() };
        let recording =
            Recording::new("r", Clock { start_s: 0.0, period_s: 1.0 }, vec![channel("u", &u), channel("y", &y)])
                .unwrap();
        let (recordings, inputs) = ([recording], ["u".to_string()]);
        let source = Source { recordings: &recordings, inputs: &inputs, output: "y" };
        let choices = Choices::default();
        let desk = Desk::new(source, &choices, &gather(source).unwrap(), 1, &|| false).unwrap();
        let trainer = desk.trainer(&[], 2).unwrap();
        let windows = [Window { record: 0, range: 0..20 }, Window { record: 0, range: 30..58 }];
        let texts = ["1", "y[n-1]", "u[n]", "u[n]^2", "u[n-2]*y[n-1]"];
        let terms = texts.map(|t| trainer.signals().parse(t).unwrap());
        let dictionary = Dictionary::from_terms(trainer.signals().clone(), terms).unwrap();
        let rows: Vec<usize> = (2..20).chain(32..58).collect();
        let value = |k: usize, n: usize| [1.0, y[n - 1], u[n], u[n] * u[n], u[n - 2] * y[n - 1]][k];
        let used = [0, 1, 3];
        let mut sum = 0.0;
        for &left_out in &rows {
            let rest: Vec<usize> = rows.iter().copied().filter(|n| *n != left_out).collect();
            let columns: Vec<Vec<f64>> = used.iter().map(|&k| rest.iter().map(|&n| value(k, n)).collect()).collect();
            let target: Vec<f64> = rest.iter().map(|&n| y[n]).collect();
            let theta = lstsq(&Matrix::from_columns(&columns).unwrap(), &target).unwrap().theta;
            let predicted: f64 = used.iter().zip(&theta).map(|(&k, t)| t * value(k, left_out)).sum();
            sum += (y[left_out] - predicted).powi(2);
        }
        let brute = (sum / rows.len() as f64).sqrt();
        // The dictionary may keep its terms in another order.
        let columns = used
            .iter()
            .map(|&k| {
                let term = trainer.signals().parse(texts[k]).unwrap();
                dictionary.terms().iter().position(|t| *t == term).unwrap()
            })
            .collect();
        let found = press(&trainer, &windows, &dictionary, columns).unwrap();
        assert!((found / brute - 1.0).abs() < 1e-9, "{found} {brute}");
    }
}
