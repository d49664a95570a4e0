//! One scene measured with many seeds: errors, and whether their stated sizes are correct.

use super::{calibration, dark};
use tactile_imaging::force::{
    Estimate, ForceMeter, ForceOptions, ForceWorkspace, ReferenceFrame, Source,
};
use tactile_simulate::PressScene;

/// Errors of one quantity over many seeds.
pub(super) struct Errors {
    pub(super) name: &'static str,
    errors: Vec<f64>,
    stated: Vec<f64>,
}

impl Errors {
    fn new(name: &'static str) -> Self {
        Self {
            name,
            errors: Vec::new(),
            stated: Vec::new(),
        }
    }

    fn add(&mut self, found: Estimate, truth: f64, unit: f64) {
        self.errors.push((found.value - truth) / unit);
        self.stated.push(found.standard_error / unit);
    }

    pub(super) fn rms(&self) -> f64 {
        (self.errors.iter().map(|e| e * e).sum::<f64>() / self.errors.len() as f64).sqrt()
    }

    pub(super) fn worst(&self) -> f64 {
        self.errors.iter().fold(0.0, |m, e| m.max(e.abs()))
    }

    pub(super) fn inside_one_sigma(&self) -> f64 {
        let both = self.errors.iter().zip(&self.stated);
        both.filter(|(e, s)| e.abs() < **s).count() as f64 / self.errors.len() as f64
    }

    fn show(&self) {
        let mean = self.errors.iter().sum::<f64>() / self.errors.len() as f64;
        println!(
            "{:22} rms {:.2e}, mean {mean:+.2e}, worst {:.2e}, inside one sigma {:.1} %",
            self.name,
            self.rms(),
            self.worst(),
            100.0 * self.inside_one_sigma()
        );
    }
}

pub(super) struct Study {
    pub(super) force: Errors,
    pub(super) centroid: [Errors; 2],
    pub(super) centre: Errors,
    pub(super) radius: Errors,
}

impl Study {
    pub(super) fn all(&self) -> [&Errors; 5] {
        let [x, y] = &self.centroid;
        [&self.force, x, y, &self.centre, &self.radius]
    }
}

pub(super) fn study(scene: &PressScene, seeds: u64, options: &ForceOptions) -> Study {
    study_with(scene, seeds, options, |r| r)
}

pub(super) fn study_with(
    scene: &PressScene,
    seeds: u64,
    options: &ForceOptions,
    prepare: impl Fn(ReferenceFrame) -> ReferenceFrame,
) -> Study {
    let (truth, light) = (scene.truth(0), scene.expected_frame(0));
    let meter = ForceMeter::new(truth.pixel_size_m, options).unwrap();
    let (calibration, mut workspace) = (calibration(scene), ForceWorkspace::default());
    let mut s = Study {
        force: Errors::new("force / true force"),
        centroid: [Errors::new("centroid x, px"), Errors::new("centroid y, px")],
        centre: Errors::new("fitted centre x, px"),
        radius: Errors::new("radius / true radius"),
    };
    for seed in 0..seeds {
        let frame = scene
            .options()
            .camera
            .expose(light.view(), 1_000_000 + seed, 1);
        let reference = prepare(ReferenceFrame::new(dark(scene, 2_000_000 + seed).view()).unwrap());
        let m = meter
            .measure_with(&mut workspace, frame.view(), &reference, &calibration)
            .unwrap();
        let (contact, fit) = (m.contact.expect("contact"), m.profile.expect("profile"));
        s.force.add(
            m.force_n.total(),
            truth.contact.force_n,
            truth.contact.force_n,
        );
        for k in 0..2 {
            s.centroid[k].add(contact.centroid_px[k], truth.centroid_px[k], 1.0);
        }
        s.centre.add(fit.centre_px[0], truth.centre_px[0], 1.0);
        // These contacts are Hertz's: the error of the radius is only that of the noise.
        let noise = fit.radius_m.part(Source::Noise);
        s.radius.add(
            Estimate::new(fit.radius_m.value, noise),
            truth.contact.contact_radius_m,
            truth.contact.contact_radius_m,
        );
    }
    s.all().iter().for_each(|errors| errors.show());
    s
}
