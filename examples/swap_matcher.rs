//! A user-defined matcher in place of the default: one line changes, the rest of the pipeline stays.
#![allow(clippy::print_stdout)]
use nalgebra::Point3;
use std::error::Error;
use tactile_imaging::matching::{
    AnnealedSoftassign, CoherentPointDrift, MatchError, Matching, PointMatcher, unmatched_rows,
};
use tactile_imaging::pipeline::Pipeline;
use tactile_simulate::Trial;
use tactile_simulate::{CalibrationRun, PressOptions};

/// The default matcher, of whose pairs only those count that are surely right.
struct Certain {
    inner: AnnealedSoftassign,
    least_confidence: f64,
}

impl PointMatcher<3> for Certain {
    fn match_points(
        &self,
        model: &[Point3<f64>],
        target: &[Point3<f64>],
    ) -> Result<Matching<3>, MatchError> {
        let mut found = self.inner.match_points(model, target)?;
        for (partner, confidence) in found.assignment.iter_mut().zip(&found.confidence) {
            *partner = partner.filter(|_| *confidence >= self.least_confidence);
        }
        let unmatched = unmatched_rows(&found.assignment, target.len());
        (found.unmatched_model, found.unmatched_target) = unmatched;
        Ok(found)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let trial = Trial::new(PressOptions::default(), &CalibrationRun::default())?;
    let certain = Certain {
        inner: AnnealedSoftassign::default(),
        least_confidence: 0.99,
    };
    report("default matcher", &trial, trial.pipeline()?)?;
    report(
        "certain pairs",
        &trial,
        trial.pipeline()?.with_matcher(certain),
    )?;
    let drift = CoherentPointDrift::default();
    report(
        "coherent point drift",
        &trial,
        trial.pipeline()?.with_matcher(drift),
    )
}

fn report(name: &str, trial: &Trial, pipeline: Pipeline) -> Result<(), Box<dyn Error>> {
    let mut press = trial.press(&pipeline)?;
    let matched = press.matching(1)?.assignment.iter().flatten().count();
    let mean = press.strain(1)?.summary.mean;
    println!("{name}: {matched} pairs, strain e_zz {:.3}", mean[(2, 2)]);
    Ok(())
}
