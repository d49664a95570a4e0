//! A user-defined matcher in the pipeline.
#![allow(clippy::print_stdout)]
use nalgebra::Point3;
use std::error::Error;
use tactile_imaging::matching::{MatchError, Matching, PointMatcher};

use tactile_simulate::{CalibrationRun, PressOptions, Trial};

/// Mutual nearest neighbours of the two sets at their given positions.
struct MutualNearest;

impl PointMatcher<3> for MutualNearest {
    fn match_points(
        &self,
        model: &[Point3<f64>],
        target: &[Point3<f64>],
    ) -> Result<Matching<3>, MatchError> {
        let mutual = |i: usize| {
            let j = nearest(&model[i], target)?;
            (nearest(&target[j], model)? == i).then_some((i, j, 1.0))
        };
        let pairs: Vec<_> = (0..model.len()).filter_map(mutual).collect();
        Matching::from_pairs(model, target, &pairs)
    }
}

fn nearest(point: &Point3<f64>, set: &[Point3<f64>]) -> Option<usize> {
    let distance = |&i: &usize| (set[i] - point).norm_squared();
    (0..set.len()).min_by(|i, j| distance(i).total_cmp(&distance(j)))
}

fn main() -> Result<(), Box<dyn Error>> {
    let trial = Trial::new(PressOptions::default(), &CalibrationRun::default())?;
    let pipeline = trial.pipeline()?.with_matcher(MutualNearest);
    let press = trial.press(&pipeline)?;
    let matched = press.matching(1)?.pairs().count();
    let mean = press.strain(1)?.summary.mean;
    println!("{matched} pairs, strain e_zz {:.3}", mean[(2, 2)]);
    Ok(())
}
