//! Models other than splines find the maps they stand for.

use crate::common::Uniform;
use nalgebra::{Point3, Rotation3, SVector};
use tactile_tps::{Affine, Warp};

#[test]
fn rigid_motions_are_found_and_never_reflect() {
    let mut random = Uniform(9);
    let sources = random.points::<3>(10);
    let truth = Affine {
        linear: *Rotation3::from_euler_angles(0.4, -1.0, 2.0).matrix(),
        offset: SVector::from([1.0, 2.0, 3.0]),
    };
    let targets: Vec<_> = sources.iter().map(|x| truth.apply(x)).collect();
    let found = Affine::fit_rigid(&sources, &targets, None).expect("a motion");
    assert!(
        (found.linear - truth.linear).norm() < 1e-13
            && (found.offset - truth.offset).norm() < 1e-13
    );
    let mirrored: Vec<_> = sources
        .iter()
        .map(|x| Point3::new(-x.x, x.y, x.z))
        .collect();
    let found = Affine::fit_rigid(&sources, &mirrored, None).expect("a motion");
    assert!((found.linear.determinant() - 1.0).abs() < 1e-13);
}
