//! Times and errors of each contact law of a ball.

use crate::study::Study;
use tactile_imaging::elasticity::contact::{Bond, Layer, Waveguide};
use tactile_imaging::elasticity::modulus::{
    Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator, SphereOnWaveguide,
};
use tactile_simulate::{self, ContactModel, Elastic, ElasticSphere, PressOptions, PressScene};

/// The two samples of the paper at 0.7 and 1.2 N, with force and contact radius from finite
/// elements without noise, evaluated by every law of a ball. The bench `finite_elements` times
/// contact tables.
pub(crate) fn laws(study: &mut Study) {
    study.error_label = "rms error of the modulus, relative";
    const RADIUS_M: f64 = 3e-3;
    let layers = tactile_simulate::LightGuide::default().layers;
    let layers = layers.iter().map(|l| Layer {
        thickness_m: l.thickness_m,
        youngs_modulus_pa: l.material.youngs_modulus_pa,
        poisson_ratio: l.material.poisson_ratio,
    });
    let guide = Waveguide::new(layers.collect()).expect("a guide");
    let hertz = HertzSphere::new(RADIUS_M, 0.5).expect("a ball");
    let layered = SphereOnWaveguide::new(RADIUS_M, 0.5, &guide, Bond::Bonded).expect("a ball");
    // Name, whether it is the default of a pipeline for a ball on a known guide, and the law.
    let laws: [(&str, bool, Box<dyn ModulusEstimator>); 4] = [
        ("Hertz, rigid guide", false, Box::new(hertz.clone())),
        (
            "Hertz, layers in series",
            false,
            Box::new(hertz.with_waveguide(&guide)),
        ),
        (
            "layered, small strain",
            false,
            Box::new(layered.clone().without_finite_strain()),
        ),
        ("layered, finite strain", true, Box::new(layered)),
    ];
    let samples = [Elastic::CL2000X, Elastic::CL2003X].map(|material| {
        let object = ElasticSphere {
            radius_m: RADIUS_M,
            material,
        };
        let options = PressOptions {
            object,
            law: ContactModel::FiniteElements,
            ..PressOptions::default()
        };
        let scene = PressScene::new(options).expect("a scene");
        let loads = [0, 1].map(|load| {
            let contact = scene.truth(load).contact;
            let radius = Estimate::new(contact.contact_radius_m, 1e-3 * contact.contact_radius_m);
            LoadState::new(Estimate::new(contact.force_n, 1e-3 * contact.force_n))
                .with_radius(radius)
        });
        (material.youngs_modulus_pa, LoadSeries::new(loads))
    });
    for (name, is_default, law) in laws {
        let job = || {
            samples.each_ref().map(|(truth, loads)| {
                // Layers in series leave no compliance for the harder sample: the error is as large
                // as possible.
                law.estimate(loads)
                    .map_or(1.0, |found| found.youngs_modulus_pa / truth - 1.0)
            })
        };
        study.run("law", name, is_default, job, |errors| {
            (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
        });
        study.entries.last_mut().expect("an entry").seconds /= samples.len() as f64;
    }
}
