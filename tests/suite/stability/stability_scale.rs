//! Units, brightness and position: the results compared with the true values, and changes that must
//! not affect them.
use super::press::{
    Answer, Images, SI, Units, answer, camera, coarse_camera, pipeline, relative, trial,
};
use super::table::{EXACT, STRAIN, Table};
use super::{loads, steps, symmetry};
use tactile_simulate::Trial;

#[test]
fn the_pipeline_keeps_its_numbers() {
    let mut table = Table::new();
    truth(&mut table);
    let trial = trial(camera(), 200.0, &[0.7, 1.2]);
    let expected = answer(&pipeline(&trial, SI), &Images::of(&trial));
    units(&mut table, &trial, &expected);
    symmetry::shifts(&mut table, &trial, &expected);
    symmetry::turns(&mut table, &trial, &expected);
    pedestal(&trial, &expected);
    light(&mut table);
    steps::small(&mut table);
    loads::many(&mut table);
    table.finish();
}

/// Frames of a camera without noise, blur and vignetting. The remaining errors are the pixel size,
/// rounding to integer grey levels, and the noise of the gauge in the calibration (2 mN, 20
/// readings).
fn truth(table: &mut Table) {
    for grey in [60.0, 120.0, 200.0, 235.0] {
        let (fine, coarse) = (camera().ideal(), coarse_camera().ideal());
        for (what, camera) in [("fine", fine), ("coarse", coarse)] {
            let trial = trial(camera, grey, &[0.7, 1.2]);
            let found = answer(&pipeline(&trial, SI), &Images::of(&trial));
            let truth = &trial.simulation.truth;
            let force: Vec<_> = truth.iter().map(|t| t.contact.force_n).collect();
            let radius: Vec<_> = truth.iter().map(|t| t.contact.contact_radius_m).collect();
            let modulus_pa = trial.simulation.youngs_modulus_pa;
            let case = |quantity: &str| format!("truth, {what}: {quantity}");
            let mut enter = |quantity: &str, found: &[f64], truth: &[f64], allowed| {
                table.enter(&case(quantity), relative(found, truth, 1.0), allowed);
            };
            // The mean of the gauge is accurate to 0.1 % of these forces. Of 60 grey levels half of
            // one is lost at the rim of few pixels: 0.2 %. E is proportional to F/a³, and because
            // the layers are compliant too, its error is 1.7 times theirs.
            enter("force", &found.force_n, &force, 0.004);
            enter("radius", &found.radius_m, &radius, 1e-3);
            enter("modulus", &found.modulus_pa[..1], &[modulus_pa], 0.01);
            surface(table, &case("height of the surface"), &trial);
            let map = truth[0].scaling_to(&truth[1]);
            let strain = (what == "fine").then(|| map.green_lagrange_strain());
            for (k, name) in ["xx", "yy", "zz"].into_iter().enumerate() {
                let Some(strain) = strain else { continue };
                let gap = (found.strain[(k, k)] - strain[(k, k)]).abs();
                table.enter(&case(&format!("strain e_{name}")), gap, STRAIN[k]);
            }
        }
    }
}

/// At the rim, where a hemisphere is steepest, a quarter of a pixel may be included or not: with
/// pixels of width h this is √(h/2a) of its height.
fn surface(table: &mut Table, case: &str, trial: &Trial) {
    let pipeline = pipeline(trial, SI);
    let press = trial.press(&pipeline).unwrap();
    for (k, truth) in trial.simulation.truth.iter().enumerate() {
        let found = press.surface(k).unwrap();
        let heights = found.surface.heights.iter().zip(&found.surface.mask);
        let inside = heights
            .filter(|(_, inside)| **inside)
            .map(|(height, _)| *height);
        let top = inside.fold(f64::NAN, f64::max);
        let ring = (0.5 * found.pixel_size_m[0] / truth.contact.contact_radius_m).sqrt();
        let error = (top / truth.contact.apparent_height_m(0.0) - 1.0).abs();
        table.enter(case, error, ring);
    }
}

fn units(table: &mut Table, trial: &Trial, expected: &Answer) {
    let images = Images::of(trial);
    for exponent in [-3, -2, -1, 1, 2, 3] {
        let length = 10f64.powi(exponent);
        let found = answer(&pipeline(trial, Units { length, ..SI }), &images);
        scaled(table, "unit of length", &found, expected, [1.0, length]);
    }
    for exponent in [-9, -6, -3, 3, 6, 9] {
        let force = 10f64.powi(exponent);
        let found = answer(&pipeline(trial, Units { force, ..SI }), &images);
        scaled(table, "unit of force", &found, expected, [force, 1.0]);
    }
}

/// Lengths, forces and moduli follow their units. Strains have no unit.
fn scaled(
    table: &mut Table,
    case: &str,
    found: &Answer,
    expected: &Answer,
    [force, length]: [f64; 2],
) {
    let pressure = force / (length * length);
    let mut exact = |what: &str, error: f64| table.enter(&format!("{case}: {what}"), error, EXACT);
    exact("force", relative(&found.force_n, &expected.force_n, force));
    exact(
        "radius",
        relative(&found.radius_m, &expected.radius_m, length),
    );
    exact(
        "modulus",
        relative(&found.modulus_pa, &expected.modulus_pa, pressure),
    );
    exact("strain", (found.strain - expected.strain).amax());
    exact(
        "strain's error",
        (found.strain_error - expected.strain_error).amax(),
    );
}

/// The same grey value is added to reference and frames: the differences, and therefore all bits,
/// do not change.
fn pedestal(trial: &Trial, expected: &Answer) {
    // A grey level of 255 would count as saturated.
    let room = 254 - trial.simulation.frames.iter().flatten().max().unwrap();
    for grey in [1, room / 2, room] {
        let raised = Images::of(trial).map(|image| image.mapv(|v| v + grey));
        let found = answer(&pipeline(trial, SI), &raised);
        assert!(found == *expected, "{grey} added to all grey values");
    }
}

/// Twice the light and twice the sums of the calibration. The dependence of noise on light is
/// determined in integer grey levels, which do not double if the mean of two exposures contains
/// halves. This changes the weights of bright pixels in the fit of the profile by at most a
/// hundredth. Its results change by small fractions of their own errors, 10⁻⁴ for the radius and 4
/// · 10⁻³ for the modulus; a tenth and a fortieth are allowed. The force is a sum without weights.
fn light(table: &mut Table) {
    let trial = trial(camera(), 100.0, &[0.7, 1.2]);
    let expected = answer(&pipeline(&trial, SI), &Images::of(&trial));
    let bright = Images::of(&trial).map(|image| image * 2);
    let found = answer(&pipeline(&trial, Units { grey: 2.0, ..SI }), &bright);
    let mut enter = |what: &str, found: &[f64], expected: &[f64], allowed| {
        let error = relative(found, expected, 1.0);
        table.enter(&format!("twice the light: {what}"), error, allowed);
    };
    enter("force", &found.force_n, &expected.force_n, EXACT);
    enter("radius", &found.radius_m, &expected.radius_m, 1e-5);
    enter(
        "modulus",
        &found.modulus_pa[..1],
        &expected.modulus_pa[..1],
        1e-4,
    );
    for (k, name) in ["xx", "yy", "zz"].into_iter().enumerate() {
        let gap = (found.strain - expected.strain)[(k, k)].abs();
        table.enter(&format!("twice the light: strain e_{name}"), gap, STRAIN[k]);
    }
}
