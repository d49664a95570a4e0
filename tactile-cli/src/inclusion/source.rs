//! Profiles to search: a scene's, or simulated ones.
use crate::failure::Failure;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::fem::{
    AppliedLoad, Block, FemScene, Guide, GuideLayer, Interface, Lump, Material,
};
use tactile_imaging::inclusion::InclusionScene;
use tactile_imaging::inclusion::{PressureProfile, Specimen};

/// What a search needs, and what is known besides.
pub struct Source {
    pub specimen: Specimen,
    pub guide: Guide,
    pub radii_m: Vec<f64>,
    pub profiles: Vec<PressureProfile>,
    /// First harmonic of the pressure around the axis over its mean.
    pub asymmetry: f64,
    /// Diameter, depth and modulus, where they are known.
    pub truth: Option<[f64; 3]>,
}

impl Source {
    pub fn of_scene(scene: &InclusionScene) -> Result<Self, Failure> {
        let loaded = scene.load().map_err(Failure::input)?;
        let asymmetry = loaded.rings.iter().map(|rings| rings.asymmetry);
        Ok(Self {
            specimen: scene.specimen,
            guide: scene.guide.clone(),
            radii_m: loaded.rings[0].radii_m.clone(),
            asymmetry: asymmetry.fold(0.0, f64::max),
            profiles: loaded.profiles,
            truth: None,
        })
    }

    /// Frames of a block with a lump, and white noise of the camera: 0.75 % of the largest pressure a
    /// pixel of 86 µm.
    pub fn simulated(seed: u64) -> Result<Self, ElasticityError> {
        let (specimen, guide) = simulated_block()?;
        let truth = [12e-3, 4e-3, 40e3];
        let tissue = |modulus| Material::new(modulus, 0.495);
        let block = Block {
            height_m: specimen.height_m(),
            radius_m: specimen.radius_m(),
            material: tissue(5e3)?,
            lump: Some(Lump {
                diameter_m: truth[0],
                depth_m: truth[1],
                material: tissue(truth[2])?,
            }),
        };
        let approaches = [1e-3, 2e-3, 3e-3];
        let scene = FemScene::block_under_guide(&block, &guide, Interface::Bonded)?;
        let solution = scene.solve(&approaches.map(AppliedLoad::Approach));
        let width = guide.radius_m() / 60.0;
        let radii_m: Vec<f64> = (0..45).map(|k| (f64::from(k) + 0.5) * width).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let profiles = (solution.states.iter().zip(approaches))
            .map(|(state, approach_m)| {
                let clean: Vec<f64> = radii_m
                    .iter()
                    .map(|radius| state.pressure_at(*radius))
                    .collect();
                let largest = clean.iter().copied().fold(0.0, f64::max);
                let errors: Vec<f64> = (radii_m.iter())
                    .map(|radius| {
                        let pixels = std::f64::consts::TAU * radius * width / 86e-6f64.powi(2);
                        7.5e-3 * largest / pixels.sqrt()
                    })
                    .collect();
                let noisy = clean.iter().zip(&errors);
                let noisy = noisy.map(|(p, e)| p + e * rng.sample::<f64, _>(StandardNormal));
                PressureProfile {
                    approach_m,
                    force_n: Some(state.force_n()),
                    pressure_pa: noisy.collect(),
                    standard_error_pa: errors,
                }
            })
            .collect();
        Ok(Self {
            specimen,
            guide,
            radii_m,
            profiles,
            asymmetry: 0.0,
            truth: Some(truth),
        })
    }
}

/// A block of tissue as high as two faces, and a guide of three layers, the stiffest towards the tissue.
pub fn simulated_block() -> Result<(Specimen, Guide), ElasticityError> {
    let layer = |thickness_m, modulus| {
        Ok(GuideLayer {
            thickness_m,
            material: Material::new(modulus, 0.495)?,
        })
    };
    let layers = vec![layer(2e-3, 136e3)?, layer(3e-3, 80e3)?, layer(5e-3, 34e3)?];
    let specimen = Specimen::new(30e-3, 40e-3)?.with_interface(Interface::Bonded);
    Ok((specimen, Guide::new(layers, 16e-3)?))
}
