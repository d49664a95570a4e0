//! Traces of an earlier version of this crate. They ensure that a change of the implementation
//! changes no number. The closed forms are compared with numbers of 80 digits (`reference.rs`,
//! `stability_scale.rs`) and with the data of their materials (`paper.rs`).
//!
//! `tests/recorded/answers.txt` contains one line per name. After a change that is meant to change
//! results, rewrite it with `RECORD_ANSWERS=1 cargo test -p tactile-optics --test suite recorded`
//! and inspect the difference before committing.

use test_support as record;

use tactile_optics::surface::{Dimple, Flat, TopSurface, Touched, TouchingObject};
use tactile_optics::trace::{LightBudget, Slab, SlabLayer, TraceOptions, path, trace};
use tactile_optics::{Geometry, Led};

const RECORDED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/recorded/answers.txt");

/// Named numbers, in the order of their computation.
#[derive(Default)]
struct Answers {
    all: record::Answers,
}

impl Answers {
    fn add(&mut self, name: &str, value: f64) {
        self.all.add(name, [value]);
    }

    fn budget(&mut self, name: &str, b: &LightBudget) {
        for share in [
            b.entry,
            b.guided,
            b.returned,
            b.above,
            b.below,
            b.camera,
            b.absorbed,
            b.unresolved,
        ] {
            self.add(name, share);
        }
    }
}

fn traces(answers: &mut Answers) {
    let layers =
        [(1.41, 2e-3), (1.40, 3e-3), (1.39, 5e-3), (1.4715, 2e-3)].map(|(index, thickness)| {
            SlabLayer {
                index,
                thickness_m: thickness,
            }
        });
    let slab = Slab::new(&layers, 1.0, 30e-3).unwrap();
    let dimple = Dimple::new([15e-3, 1e-3], 4e-3, 1.5e-3).unwrap();
    let object = TouchingObject {
        index: 1.45,
        albedo: 0.7,
    };
    let touched = Touched::new(dimple, object, [15e-3, 1e-3], 2e-3).unwrap();
    let surfaces: [(&str, &dyn TopSurface); 3] =
        [("flat", &Flat), ("dimple", &dimple), ("touched", &touched)];
    for (name, surface) in surfaces {
        for (form, geometry) in [("section", Geometry::Section), ("volume", Geometry::Volume)] {
            let options = TraceOptions::default()
                .with_geometry(geometry)
                .with_seed(5)
                .with_rays(300)
                .and_then(|o| o.with_cutoff(1e-4))
                .and_then(|o| o.with_camera_half_angle(0.9))
                .and_then(|o| o.with_emitter_half_width_m(3e-3))
                .unwrap();
            let mut profile = [0.0; 6];
            let led = Led::new(1.5, 1.2).unwrap();
            let budget = trace(&slab, &led, surface, &options, &mut profile).unwrap();
            let name = format!("trace.{name}.{form}.f64");
            answers.budget(&name, &budget);
            profile
                .iter()
                .for_each(|p| answers.add(&format!("{name}.profile"), *p));
        }
        let mut vertices = [[0.0; 3]; 12];
        let count = path(&slab, surface, 0.3, 0.4, &mut vertices).unwrap();
        vertices[..count]
            .iter()
            .flatten()
            .for_each(|v| answers.add(&format!("path.{name}.f64"), *v));
    }
}

#[test]
fn answers_are_those_recorded() {
    let mut answers = Answers::default();
    traces(&mut answers);
    answers.all.check(RECORDED, |name, recorded, _| {
        // A sum in another order changes the last digits.
        let tolerance = 1e-12;
        // Coordinates of a path that are zero up to rounding are compared on the scale of the slab.
        let floor = if name.contains("path") { 1e-17 } else { 0.0 };
        tolerance * recorded.abs() + floor
    });
}
