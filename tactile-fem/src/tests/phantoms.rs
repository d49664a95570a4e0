//! Stress above a stiff cylinder in silicone phantoms, compared with measurements by optical
//! palpation.

use super::*;

/// Thickness in mm and strain of the layer between block and plate, then the contrast of the stress
/// above the cylinder to that around it, at the lower face of the layer, with its standard
/// deviation over repeats. From optical coherence tomography of the layer, with the authors'
/// inversion: github.com/RhysJonesResearch/Analysis_of_image_formation_in_optical_palpation.
const MEASURED: [[f64; 4]; 6] = [
    [1.098, 0.1087, 2.6441, 0.0943],
    [1.859, 0.1031, 2.1383, 0.0980],
    [2.350, 0.0844, 2.1962, 0.1289],
    [3.450, 0.0916, 1.9637, 0.1498],
    [4.240, 0.0973, 1.9047, 0.1720],
    [5.800, 0.0930, 1.9085, 0.0906],
];

/// Contrast of the mean stress within 1 mm of the axis to that from 5 to 9 mm, with faces that
/// stick to the glass, for a block of 5.4 mm with a cylinder 3.8 mm wide and 3 mm high at a depth
/// of 1.1 mm.
fn contrast(thickness_mm: f64, strain: f64, stiffness: f64) -> f64 {
    let lines = |from: f64, to: f64, n: usize| -> Vec<f64> {
        let at = |k: usize| 1e-3 * (from + (to - from) * k as f64 / n as f64);
        (0..=n).map(at).collect()
    };
    let (block_mm, radius_mm) = (5.4, 10.0);
    let r_lines = continued(lines(0.0, 1.9, 8), &lines(0.0, radius_mm - 1.9, 24));
    let below = continued(lines(-thickness_mm, 0.0, 10), &lines(0.0, 1.1, 6));
    let cylinder = continued(below, &lines(0.0, 3.0, 12));
    let z_lines = continued(cylinder, &lines(0.0, block_mm - 4.1, 5));
    let mut mesh = Mesh::cylinder(&r_lines, &z_lines);
    for (element, region) in mesh.elements.iter().zip(&mut mesh.regions) {
        let [r, z] = mesh.nodes[element[8]];
        *region = usize::from(r < 1.9e-3 && (1.1e-3..4.1e-3).contains(&z));
    }
    let silicone = |times: f64| Material::new(16.4e3 * times, 0.48).unwrap();
    let mut model = ElementModel::new(Kinematics::Finite);
    let materials = [silicone(1.0), silicone(stiffness)];
    let body = model.add(&mesh, &materials).unwrap();
    model.drive(body, Boundary::Contact, Support::Bonded);
    model.hold(body, Boundary::Base, Support::Bonded);
    let scene = FemScene { model };
    let approach_m = 1e-3 * strain * (thickness_mm + block_mm);
    let solution = scene.solve(&[AppliedLoad::Approach(approach_m)]);
    assert_eq!(solution.report.outcome, Outcome::Solved);
    let mean = |from: f64, to: f64| {
        let radii = (0..100).map(|k| 1e-3 * (from + (to - from) * (k as f64 + 0.5) / 100.0));
        // In the layer, a hundredth of a millimetre from its face.
        let stress = |r: f64| scene.stress(&solution.states[0], [r, -1e-5]).unwrap().zz_pa;
        let sums = radii.fold([0.0; 2], |[s, w], r| [s + r * stress(r), w + r]);
        sums[0] / sums[1]
    };
    mean(0.0, 1.0) / mean(5.0, 9.0)
}

/// The authors measured the cylinder 6 to 9 times as stiff as the block. Friction at the glass is
/// not stated: with sliding faces the contrasts are 0.2 to 0.4 lower.
#[test]
#[allow(clippy::print_stdout)]
fn stiff_cylinders_in_phantoms_have_the_contrast_that_was_measured() {
    for [thickness_mm, strain, measured, deviation] in MEASURED {
        let found = [6.0, 7.5, 9.0].map(|stiffness| contrast(thickness_mm, strain, stiffness));
        let apart = found.map(|found| (found - measured) / deviation);
        println!("{thickness_mm} mm: {found:.3?} for {measured} ± {deviation}, {apart:.1?}");
        // The thinnest layer is nearly as thin as the depth of the cylinder. The authors' own
        // finite elements give 2.43 there, 2.3 standard deviations below.
        let limit = if thickness_mm < 1.5 { 2.0 } else { 1.5 };
        assert!(apart[1].abs() < limit, "{thickness_mm} mm: {apart:?}");
    }
}
