//! Doubts of pairs of nearest neighbours, assignment, drift and labelling: correct results with a
//! doubt and wrong results without one, for unchanged, shifted, bent, noisy and unrelated sets.
//!
//! ```text
//! cargo run --release -p tactile-match --example judgement
//! ```
//!
//! A result is correct if nine of ten pairs are, and wrong if a fifth are not.
#![allow(clippy::print_stdout)]
use nalgebra::{Point, SVector};
use tactile_match::{
    CoherentPointDrift, LinearAssignment, MatchError, NearestNeighbour, PointMatcher,
    RelaxationLabelling,
};
#[allow(dead_code)] // this study bends alone
#[path = "support/points.rs"]
mod points;
#[path = "support/stream.rs"]
mod stream;
use points::{bend, cube};
use stream::Stream;

fn study<const D: usize>() -> Result<(), MatchError> {
    let matchers: [(&str, Box<dyn PointMatcher<D>>); 4] = [
        ("nearest", Box::new(NearestNeighbour::default())),
        ("assignment", Box::new(LinearAssignment::default())),
        ("drift", Box::new(CoherentPointDrift::default())),
        (
            "labelling",
            Box::new(RelaxationLabelling::default().with_candidates(8)?),
        ),
    ];
    for (name, matcher) in &matchers {
        let (mut n_right, mut false_doubt, mut n_wrong, mut silent, mut middle) = (0, 0, 0, 0, 0);
        let mut notes = Vec::new();
        for seed in 0..30_u64 {
            for kind in 0..8 {
                let mut stream = Stream(seed * 100 + kind + D as u64 * 7);
                let n = [60, 105, 200][seed as usize % 3];
                let random = seed % 2 == 0;
                let model = cube::<D>(n, random, &mut stream);
                let spacing = (n as f64).powf(-1.0 / D as f64);
                let image = |p: &Point<f64, D>| match kind {
                    0 => *p,
                    1 => p + SVector::repeat(0.15 * spacing),
                    2 => bend(p),
                    3 => p + (bend(p) - p) * 0.3,
                    4 => p + SVector::repeat(0.6 * spacing),
                    _ => p + (bend(p) - p) * 0.2,
                };
                let noise = [0.0, 0.0, 0.0, 0.02, 0.0, 0.1, 0.25, 0.0][kind as usize] * spacing;
                let unrelated = kind == 7;
                let mut target: Vec<Point<f64, D>> = model
                    .iter()
                    .map(|p| image(p) + SVector::from_fn(|_, _| noise * stream.normal()))
                    .collect();
                if unrelated {
                    target = cube::<D>(n, true, &mut stream);
                }
                let order = stream.permutation(n);
                let shuffled: Vec<_> = order.iter().map(|&i| target[i]).collect();
                let found = matcher.match_points(&model, &shuffled)?;
                let right = found
                    .assignment
                    .iter()
                    .enumerate()
                    .filter(|(i, j)| j.is_some_and(|j| order[j] == *i))
                    .count() as f64;
                let pairs = found.assignment.iter().flatten().count().max(1) as f64;
                let right = if unrelated { 0.0 } else { right / pairs };
                let doubt = found.report.doubt();
                if right >= 0.9 {
                    n_right += 1;
                    if doubt.is_some() {
                        false_doubt += 1;
                        notes.push(format!(
                            "F{kind}{} {right:.2} {doubt:?}",
                            if random { 'r' } else { 'j' }
                        ));
                    }
                } else if right < 0.8 {
                    n_wrong += 1;
                    if doubt.is_none() {
                        silent += 1;
                        notes.push(format!(
                            "S{kind}{} n{n} {right:.2}",
                            if random { 'r' } else { 'j' }
                        ));
                    }
                } else {
                    middle += 1;
                }
            }
        }
        println!(
            "{D} {name}: right {n_right} false doubts {false_doubt}; wrong {n_wrong} silent {silent}; middle {middle}"
        );
        println!("   {}", notes.join(", "));
    }
    Ok(())
}

fn main() -> Result<(), MatchError> {
    study::<2>()?;
    study::<3>()
}
