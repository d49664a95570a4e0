//! A researcher's own matcher in place of the default one: one line changes, the rest of the pipeline stays.
#![allow(clippy::print_stdout)]
use nalgebra::{Matrix3, Point3, Vector3};
use tactile_imaging::matching::{
    MatchError, MatchReport, Matching, PointMatcher, PointSet, SoftMatches, unmatched_rows,
};
use tactile_imaging::pipeline::{Pipeline, Trial};
use tactile_imaging::simulate::{CalibrationOptions, PressOptions};
use tactile_imaging::tps::Affine;

/// The researcher's idea: bring both clouds to the same middle and size, then pair points that are each other's nearest.
struct ScaledNeighbours;

impl PointMatcher<f64, 3> for ScaledNeighbours {
    fn match_points(
        &self,
        model: &[Point3<f64>],
        target: &[Point3<f64>],
    ) -> Result<Matching<f64, 3>, MatchError> {
        let (from, to) = (
            Cloud::of(model, PointSet::Model)?,
            Cloud::of(target, PointSet::Target)?,
        );
        let scale = to.size / from.size;
        let warp = Affine::new(Matrix3::identity() * scale, to.middle - from.middle * scale);
        let warped: Vec<_> = model
            .iter()
            .map(|p| Point3::from(p.coords * scale + warp.offset))
            .collect();
        let partner = |i: usize| {
            let j = nearest(&warped[i], target);
            (nearest(&target[j], &warped) == i).then_some(j)
        };
        let assignment: Vec<_> = (0..model.len()).map(partner).collect();
        let squares = assignment
            .iter()
            .zip(&warped)
            .filter_map(|(a, p)| a.map(|j| (target[j] - p).norm_squared()));
        let matched = assignment.iter().flatten().count().max(1) as f64;
        let residual = (squares.sum::<f64>() / matched).sqrt();
        let (unmatched_model, unmatched_target) = unmatched_rows(&assignment, target.len());
        Ok(Matching {
            warp: Box::new(warp),
            warped,
            confidence: assignment
                .iter()
                .map(|a| if a.is_some() { 1.0 } else { 0.0 })
                .collect(),
            assignment,
            soft: SoftMatches::new(),
            unmatched_model,
            unmatched_target,
            displacement_covariance: vec![Matrix3::identity() * residual * residual; model.len()],
            energy: Vec::new(),
            report: MatchReport {
                residual,
                ..MatchReport::default()
            },
        })
    }
}

struct Cloud {
    middle: Vector3<f64>,
    size: f64,
}

impl Cloud {
    fn of(points: &[Point3<f64>], set: PointSet) -> Result<Self, MatchError> {
        if points.is_empty() {
            return Err(MatchError::Empty { set });
        }
        let n = points.len() as f64;
        let middle = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / n;
        let size = (points
            .iter()
            .map(|p| (p.coords - middle).norm_squared())
            .sum::<f64>()
            / n)
            .sqrt();
        Ok(Self { middle, size })
    }
}

fn nearest(point: &Point3<f64>, set: &[Point3<f64>]) -> usize {
    let distance = |i: &usize| (set[*i] - point).norm_squared();
    (0..set.len())
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .unwrap_or(0)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let trial = Trial::new(PressOptions::default(), &CalibrationOptions::default())?;
    let default = trial.pipeline()?;
    let swapped = trial.pipeline()?.with_matcher(ScaledNeighbours); // the one line
    report("default matcher", &trial, &default)?;
    report("ScaledNeighbours", &trial, &swapped)
}

fn report(
    name: &str,
    trial: &Trial,
    pipeline: &Pipeline,
) -> Result<(), Box<dyn std::error::Error>> {
    let measurement = trial.press(pipeline)?.measure();
    println!("{name}");
    if let Ok(matching) = &measurement.matching {
        println!("  match    {matching}");
    }
    if let Ok(strain) = &measurement.strain {
        println!("  strain   {strain}");
    }
    println!("  modulus {}", measurement.youngs_modulus_pa?);
    Ok(())
}
