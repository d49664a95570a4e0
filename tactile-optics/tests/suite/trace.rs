//! The ray tracer compared with closed forms, with slow direct code, and with itself.
#![allow(clippy::print_stdout)]
use std::f64::consts::{FRAC_PI_2, PI};

use tactile_optics::surface::{Dimple, Flat, TopSurface, Touched, TouchingObject};
use tactile_optics::trace::{LightBudget, Slab, SlabLayer, TraceOptions, trace};
use tactile_optics::{Geometry, Led};
use tactile_optics::{OpticsError, acceptance_angle, fresnel};

const PAPER: [SlabLayer; 4] = [
    SlabLayer {
        index: 1.38,
        thickness_m: 2e-3,
    },
    SlabLayer {
        index: 1.39,
        thickness_m: 3e-3,
    },
    SlabLayer {
        index: 1.40,
        thickness_m: 5e-3,
    },
    SlabLayer {
        index: 1.4715,
        thickness_m: 2e-3,
    },
];

fn with_rays(rays: u32) -> TraceOptions {
    TraceOptions::default().with_rays(rays).unwrap()
}

fn section(rays: u32) -> TraceOptions {
    with_rays(rays).with_geometry(Geometry::Section)
}

fn flat(layers: &[SlabLayer], length: f64, options: &TraceOptions) -> LightBudget {
    let slab = Slab::new(layers, 1.0, length).unwrap();
    trace(&slab, &Led::default(), &Flat, options, &mut []).unwrap()
}

/// Energy is conserved within rounding: a ray is split into `transmitted` and
/// `power − transmitted`, and the sums are compensated.
fn assert_conserved(budget: &LightBudget) {
    assert!((total(budget) - 1.0).abs() < 1e-13, "{budget:?}");
}

fn total(b: &LightBudget) -> f64 {
    b.entry + b.guided + b.returned + leaked(b) + b.absorbed + b.unresolved
}

/// Light that left through top or bottom.
fn leaked(b: &LightBudget) -> f64 {
    b.above + b.below + b.camera
}

/// Guided fraction of one flat layer in a section by unfolding: a ray at angle θ outside has ⌊…⌋
/// reflections, each with the reflectance R. Midpoints over starting point and angle.
fn guided_by_unfolding(n: f64, thickness: f64, length: f64, steps: usize) -> f64 {
    let (mut guided, mut total) = (0.0, 0.0);
    for i in 0..steps {
        let theta = ((i as f64 + 0.5) / steps as f64 - 0.5) * PI;
        let inside = (theta.sin() / n).asin();
        let entry = fresnel(1.0, n, theta.abs()).unwrap().transmittance;
        let kept = fresnel(n, 1.0, FRAC_PI_2 - inside.abs())
            .unwrap()
            .reflectance;
        for k in 0..64 {
            let start = (f64::from(k) + 0.5) / 64.0 * thickness;
            let unfolded = start + length * inside.abs().tan();
            guided += theta.cos() * entry * kept.powf((unfolded / thickness).floor());
        }
        total += 64.0 * theta.cos();
    }
    guided / total
}

#[test]
fn a_flat_layer_guides_what_unfolding_says_and_the_error_falls_faster_than_with_random_rays() {
    let layer = [SlabLayer {
        index: 1.38,
        thickness_m: 10e-3,
    }];
    let expected = guided_by_unfolding(1.38, 10e-3, 30e-3, 40_000);
    // Root mean square over shifts of the starting points.
    let error = |rays: u32| {
        let of_seed = |seed| flat(&layer, 30e-3, &section(rays).with_seed(seed)).guided - expected;
        ((0..16).map(|s| of_seed(s).powi(2)).sum::<f64>() / 16.0).sqrt()
    };
    let errors = [256, 4096, 65536].map(error);
    // The remaining errors are jumps in the number of reflections.
    assert!(errors[2] < 2e-5, "{errors:?}");
    println!("rms error of the guided share at 256, 4096, 65536 rays: {errors:?}");
    // Random rays would reduce the error by a factor of 16 in total; even points reduce it more in
    // each of the two steps.
    assert!(errors[0] / errors[2] > 64.0, "{errors:?}");
}

#[test]
fn a_long_slab_keeps_the_trapped_share() {
    // Light that enters within the acceptance angle is trapped. After 40 000 thicknesses, all other
    // rays have left, except those within 1e-4 rad of that angle.
    let layer = [SlabLayer {
        index: 1.35,
        thickness_m: 1e-3,
    }];
    let acceptance = acceptance_angle(1.35, 1.0).unwrap();
    let led = Led::new(1.0, FRAC_PI_2).unwrap();
    for geometry in [Geometry::Section, Geometry::Volume] {
        let options = with_rays(20_000)
            .with_geometry(geometry)
            .with_cutoff(1e-12)
            .unwrap();
        let slab = Slab::new(&layer, 1.0, 1.0).unwrap();
        let found = trace(&slab, &led, &Flat, &options, &mut []).unwrap();
        assert_conserved(&found);
        // The entry losses of the trapped rays differ from the mean. Fractions are therefore
        // compared without losses, for an LED so narrow that all of its light is trapped. The
        // general LED is compared with its bound.
        let share = led.trapped_share(acceptance, geometry);
        assert!(
            found.guided < share && found.guided > share * (1.0 - found.entry * 1.5),
            "{found:?} {share}"
        );
        let narrow = Led::new(1.0, acceptance.radians * 0.99).unwrap();
        assert!((narrow.trapped_share(acceptance, Geometry::Section) - 1.0).abs() < 1e-12);
        let all = trace(&slab, &narrow, &Flat, &options, &mut []).unwrap();
        assert!(
            leaked(&all) == 0.0 && (all.guided / (1.0 - all.entry) - 1.0).abs() < 1e-12,
            "{all:?}"
        );
    }
}

#[test]
fn closed_forms_of_the_trapped_share() {
    let acceptance = acceptance_angle(1.3, 1.0).unwrap();
    let s = (1.3_f64 * 1.3 - 1.0).sqrt();
    let led = Led::default();
    assert!((led.trapped_share(acceptance, Geometry::Section) - s).abs() < 1e-12);
    // The projected solid angle of a strip of the unit disc.
    let disc = 2.0 / PI * (s.asin() + s * (1.0 - s * s).sqrt());
    assert!((led.trapped_share(acceptance, Geometry::Volume) - disc).abs() < 1e-11);
    // A uniform LED in space illuminates a zone of a sphere.
    let even = Led::new(0.0, FRAC_PI_2).unwrap();
    assert!((even.trapped_share(acceptance, Geometry::Volume) - s).abs() < 1e-10);
    let dense = acceptance_angle(1.5, 1.0).unwrap();
    assert!((led.trapped_share(dense, Geometry::Volume) - 1.0).abs() < 1e-12);
    assert_eq!(
        led.trapped_share(acceptance_angle(1.0, 1.2).unwrap(), Geometry::Volume),
        0.0
    );
}

#[test]
fn energy_is_conserved_whatever_the_scene() {
    let object = TouchingObject {
        index: 1.45,
        albedo: 0.7,
    };
    let dimple = Dimple::new([12e-3, 1e-3], 5e-3, 1.9e-3).unwrap();
    let touched = Touched::new(dimple, object, [12e-3, 1e-3], 2e-3).unwrap();
    for geometry in [Geometry::Section, Geometry::Volume] {
        for layers in [&PAPER[..], &PAPER[..1], &PAPER[1..3]] {
            let options = with_rays(3000)
                .with_geometry(geometry)
                .with_cutoff(1e-7)
                .unwrap();
            let slab = Slab::new(layers, 1.0, 30e-3).unwrap();
            let mut profile = [0.0; 30];
            let budget = trace(&slab, &Led::default(), &touched, &options, &mut profile).unwrap();
            assert_conserved(&budget);
            // Light accumulates in the dense layers below and meets the inner interfaces near
            // grazing incidence, where it is often split: thousands of branches of at most 1e-7 per
            // ray.
            assert!(budget.unresolved < 5e-4, "{budget:?}");
            assert!((profile.iter().sum::<f64>() - budget.camera).abs() < 1e-13);
            let again = trace(&slab, &Led::default(), &touched, &options, &mut profile).unwrap();
            assert_eq!(budget, again);
        }
    }
}

#[test]
fn a_press_lights_up_the_camera_more_the_steeper_it_is_and_most_where_an_object_touches() {
    let slab = Slab::new(&PAPER, 1.0, 30e-3).unwrap();
    let led = Led::new(1.0, 70_f64.to_radians()).unwrap();
    let centre = [15e-3, 0.0];
    let camera = |surface: &dyn TopSurface| {
        let options = section(20_000).with_camera_half_angle(1.0).unwrap();
        trace(&slab, &led, surface, &options, &mut [])
            .unwrap()
            .camera
    };
    let mut before = camera(&Flat);
    for slope in [0.1, 0.2, 0.4] {
        let lit = camera(&Dimple::new(centre, 5e-3, slope * 5e-3 * 2.0 / PI).unwrap());
        assert!(lit > before, "slope {slope}: {lit} after {before}");
        before = lit;
    }
    let flat = camera(&Flat);
    let touch = |index: f64| {
        let object = TouchingObject { index, albedo: 0.8 };
        camera(&Touched::new(Flat, object, centre, 3e-3).unwrap())
    };
    // An object with the index of the ambient frees no trapped ray. With a higher index, more light
    // enters it and is scattered back.
    assert!(touch(1.0) < flat + 0.02);
    assert!(
        touch(1.2) > touch(1.0) && touch(1.45) > touch(1.2),
        "{} {} {}",
        touch(1.0),
        touch(1.2),
        touch(1.45)
    );
    assert!(touch(1.45) > flat + 0.01);
}

#[test]
fn mirror_images_shine_alike() {
    // Mirroring y does not change the budget of a symmetric LED, within the sampling error.
    let slab = Slab::new(&PAPER, 1.0, 30e-3).unwrap();
    let options = with_rays(40_000);
    let leaked_at = |y: f64| {
        let dimple = Dimple::new([10e-3, y], 4e-3, 1.5e-3).unwrap();
        leaked(&trace(&slab, &Led::default(), &dimple, &options, &mut []).unwrap())
    };
    let (left, right) = (leaked_at(-2e-3), leaked_at(2e-3));
    assert!((left - right).abs() < 0.02 * left, "{left} {right}");
}

#[test]
fn light_leaves_where_the_press_is() {
    let slab = Slab::new(&PAPER, 1.0, 30e-3).unwrap();
    let object = TouchingObject {
        index: 1.45,
        albedo: 0.9,
    };
    let touched = Touched::new(Flat, object, [18e-3, 0.0], 2e-3).unwrap();
    let mut profile = [0.0; 30];
    let led = Led::new(1.0, 70_f64.to_radians()).unwrap();
    trace(&slab, &led, &touched, &section(20_000), &mut profile).unwrap();
    let brightest = (0..30)
        .max_by(|&a, &b| profile[a].total_cmp(&profile[b]))
        .unwrap();
    // Light scattered 12 mm above the bottom, within the cone of the camera, leaves within some
    // millimetres of the contact.
    assert!((14..=22).contains(&brightest), "{profile:?}");
}

#[test]
fn options_without_meaning_are_named() {
    let slab = Slab::new(&PAPER, 1.0, 30e-3).unwrap();
    let default = TraceOptions::default();
    let refused = |result: Result<TraceOptions, OpticsError>, name: &str| {
        assert!(
            matches!(result, Err(OpticsError::OutOfRange { quantity, .. }) if quantity == name),
            "{name}"
        );
    };
    refused(default.with_rays(0), "number of rays");
    for bad in [f64::NAN, -1.0, 2.0] {
        refused(default.with_cutoff(bad), "cut-off");
        refused(
            default.with_camera_half_angle(bad),
            "half angle of the camera",
        );
    }
    for bad in [f64::NAN, -1.0, f64::INFINITY] {
        refused(
            default.with_emitter_half_width_m(bad),
            "half width of the emitter",
        );
    }
    let deep = Dimple::new([15e-3, 0.0], 4e-3, 2e-3).unwrap();
    assert!(trace(&slab, &Led::default(), &deep, &section(10), &mut []).is_err());
    assert!(
        Led::new(f64::NAN, 1.0).is_err()
            && Led::new(1.0, 0.0).is_err()
            && Led::new(1.0, 1.6).is_err()
    );
    assert!(
        Dimple::new([0.0, f64::NAN], 1.0, 0.1).is_err()
            && Dimple::new([0.0, 0.0], 1.0, -0.1).is_err()
    );
    assert!(Slab::new(&[], 1.0, 1.0).is_err() && Slab::new(&PAPER, 0.0, 1.0).is_err());
    assert!(
        Slab::new(
            &[SlabLayer {
                index: f64::NAN,
                thickness_m: 1.0
            }],
            1.0,
            1.0
        )
        .is_err()
    );
    let object = TouchingObject {
        index: 1.4,
        albedo: 1.1,
    };
    assert!(Touched::new(Flat, object, [0.0, 0.0], 1.0).is_err());
}
