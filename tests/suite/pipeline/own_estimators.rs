//! User-defined estimators and laws take into account the guide of the pipeline.
use super::trial;
use crate::common;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::elasticity::contact::Body;
use tactile_imaging::elasticity::laws::{ContactLaw, ContactLength, LogForce, Reach};
use tactile_imaging::elasticity::modulus::{
    ContactEstimator, EstimatorKind, HertzSphere, LoadSeries, ModulusEstimate, ModulusEstimator,
    Source, Uncertain, Warning,
};
use tactile_simulate::Camera;

/// Hertz's law of the contact radius, without derivatives.
struct OwnLaw {
    radius_m: f64,
}

impl ContactLaw for OwnLaw {
    fn log_force(&self, length: ContactLength, _share: f64) -> Reach {
        match length {
            ContactLength::Radius(a) => {
                Reach::At(LogForce::new((4.0 / 3.0 * a.powi(3) / self.radius_m).ln()))
            }
            _ => Reach::NotMine,
        }
    }
}

/// The weighted mean of Hertz's E*, minus the compliance of the guide.
struct OwnEstimator;

impl ModulusEstimator for OwnEstimator {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let bodies = series.bodies().expect("the pipeline's bodies");
        let radius_m = bodies.size() * bodies.object().sphere_radius_m().expect("a ball");
        let (mut sum, mut weights) = (Uncertain::exact(0.0), 0.0);
        let mut mean_m = 0.0;
        for load in series.loads() {
            let (f, a) = (load.force_n, load.contact_radius_m.expect("a radius"));
            let log = (f * a.powf(-3.0) * 0.75).map(f64::ln, f64::recip);
            let weight = log.part(Source::Noise).powi(-2);
            sum = sum + log * weight;
            weights += weight;
            mean_m += a.value / series.loads().len() as f64;
        }
        let reduced = (sum * f64::recip(weights)).map(f64::exp, f64::exp) * radius_m;
        let compliance = bodies.guide_compliance(mean_m) * bodies.in_series().compliance_per_pa();
        let nu = bodies.poisson_ratio();
        let lateral = nu.map(|nu| 1.0 - nu * nu, |nu| -2.0 * nu);
        let modulus = lateral / (reduced.powf(-1.0) - compliance);
        Ok(ModulusEstimate::new(self.kind(), modulus))
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::Other("own")
    }

    fn needs_strain(&self) -> bool {
        false
    }

    fn counts_guide(&self) -> bool {
        true
    }
}

/// Forty presses with different forces and noise: a user-defined law and estimator with the physics
/// of a built-in one give the same modulus and error.
#[test]
fn own_physics_gives_what_the_same_built_in_physics_gives() {
    for seed in 0..40 {
        let scale = 0.5 + 0.025 * seed as f64;
        let trial = common::trial(
            Camera::default().coarser(8),
            &[0.4 * scale, 0.7 * scale],
            seed,
        );
        let ball = trial.scene.options().object;
        let (radius_m, nu) = (ball.radius_m, ball.material.poisson_ratio);
        let built_in = trial.pipeline().unwrap();
        let given = HertzSphere::new(radius_m, nu).unwrap();
        let own_law = ContactEstimator::from_law(OwnLaw { radius_m }, nu).unwrap();
        let pipelines = [
            built_in.clone().with_estimator(given),
            built_in.clone().with_estimator(own_law),
            built_in.clone().with_estimator(OwnEstimator),
        ];
        let expected = trial.press(&built_in).unwrap().modulus().unwrap();
        for pipeline in pipelines {
            let found = trial.press(&pipeline).unwrap().modulus().unwrap();
            let ratios = [
                found.youngs_modulus_pa / expected.youngs_modulus_pa,
                found.standard_error_pa / expected.standard_error_pa,
            ];
            for ratio in ratios {
                // The weights of the loads differ because of the error of the law.
                let estimator = found.estimator;
                assert!((ratio - 1.0).abs() < 0.01, "{seed} {estimator}: {ratios:?}");
            }
            assert!(!found.warnings.contains(&Warning::GuideIgnored));
        }
    }
}

/// An estimator that treats the guide as rigid has a caution and a different name.
#[test]
fn an_estimator_that_ignores_the_guide_has_a_caution_and_another_name() {
    let trial = trial(&[0.7, 1.2], 3);
    let ball = trial.scene.options().object;
    let hertz = HertzSphere::new(ball.radius_m, ball.material.poisson_ratio).unwrap();
    let pipeline = trial.pipeline().unwrap();
    let modulus = |estimator: Box<dyn ModulusEstimator + Send + Sync>| {
        let pipeline = pipeline.clone().with_estimator(estimator);
        trial.press(&pipeline).unwrap().modulus().unwrap()
    };
    let counted = modulus(Box::new(hertz.clone()));
    let truth = ball.material.youngs_modulus_pa;
    assert!((counted.youngs_modulus_pa / truth - 1.0).abs() < 0.05);
    assert_eq!(counted.estimator, EstimatorKind::HertzSphere);
    let rigid = modulus(Box::new(hertz.with_other_body(Body::rigid())));
    assert!(rigid.youngs_modulus_pa < 0.5 * truth);
    assert!(rigid.warnings.contains(&Warning::GuideIgnored));
    assert_eq!(rigid.estimator, EstimatorKind::GuideIgnored);
}
