//! Number of rays of the tracer: guided fraction of a flat slab compared with 64 times the largest
//! number.

use crate::study::Study;
use tactile_imaging::optics::surface::Flat;
use tactile_imaging::optics::trace::{Slab, SlabLayer, TraceOptions, trace};
use tactile_imaging::optics::{Geometry, Led};

/// Rays in the plane of one section: the exact problem of a guide that is long in the transverse
/// direction.
pub(crate) fn section(study: &mut Study) {
    rays(study, Geometry::Section);
}

/// Rays in all directions of space, the default.
pub(crate) fn volume(study: &mut Study) {
    rays(study, Geometry::Volume);
}

fn rays(study: &mut Study, geometry: Geometry) {
    study.error_label = "rms error of the guided share, relative";
    const SEEDS: u64 = 4;
    let layers = [SlabLayer {
        index: 1.38_f64,
        thickness_m: 10e-3,
    }];
    let slab = Slab::new(&layers, 1.0, 30e-3).expect("valid");
    let guided = |options: &TraceOptions| {
        trace(&slab, &Led::default(), &Flat, options, &mut [])
            .expect("valid")
            .guided
    };
    let default = TraceOptions::default().with_geometry(geometry);
    let finest = default
        .with_seed(99)
        .with_rays(study.choose(1 << 18, 1 << 21))
        .and_then(|o| o.with_cutoff(1e-12))
        .expect("valid");
    let expected = guided(&finest);
    let mut run = |knob, (rays, cutoff), is_default| {
        let options = default
            .with_rays(rays)
            .and_then(|o| o.with_cutoff(cutoff))
            .expect("valid");
        let job = || {
            (0..SEEDS)
                .map(|seed| guided(&options.with_seed(seed)))
                .collect::<Vec<f64>>()
        };
        let setting = format!("{rays} rays, cutoff {cutoff:e}");
        study.run(knob, setting, is_default, job, |found| {
            (found
                .iter()
                .map(|g| (g / expected - 1.0).powi(2))
                .sum::<f64>()
                / SEEDS as f64)
                .sqrt()
        });
        study.entries.last_mut().expect("an entry").seconds /= SEEDS as f64;
    };
    for rays in [64, 256, 1024, 4096, 16_384] {
        run("rays", (rays, 1e-6), rays == 4096);
    }
    for cutoff in [1e-2, 1e-4] {
        run("cutoff", (4096, cutoff), false);
    }
}
