//! Planning a press of tissue: the accuracy of size, depth and stiffness of a lump.
#![allow(clippy::print_stdout)]
use std::error::Error;
use tactile_imaging::fem::{Guide, GuideLayer, Interface, Material};
use tactile_imaging::inclusion::{AssumedInclusion, InclusionSearch, TissueBlock};

fn main() -> Result<(), Box<dyn Error>> {
    let layer = |thickness_m, youngs_modulus_pa| {
        Material::new(youngs_modulus_pa, 0.495).map(|material| GuideLayer {
            thickness_m,
            material,
        })
    };
    let guide = Guide::new(vec![layer(4e-3, 120e3)?, layer(6e-3, 40e3)?], 16e-3)?;
    let block = TissueBlock::new(30e-3, 40e-3)?.with_interface(Interface::Bonded);
    let search = InclusionSearch::new(block, guide)?;
    let lump = AssumedInclusion {
        diameter_m: 10e-3,
        depth_m: 4e-3,
        youngs_modulus_pa: 40e3,
        block_modulus_pa: 5e3,
    };
    // Rings of a pressure image with 30 Pa of white noise per pixel and pixels of a tenth of a
    // millimetre.
    let radii_m: Vec<f64> = (0..20).map(|k| (f64::from(k) + 0.5) * 0.6e-3).collect();
    let pixels = |radius_m: f64| core::f64::consts::TAU * radius_m * 0.6e-3 / 1e-8;
    let noise_pa: Vec<f64> = radii_m.iter().map(|&r| 30.0 / pixels(r).sqrt()).collect();
    for approaches_m in [vec![1e-3], vec![3e-3], vec![1.5e-3, 3e-3]] {
        let errors = search.expected_errors(&lump, &approaches_m, &radii_m, &noise_pa)?;
        println!(
            "pressed by {approaches_m:?} m: diameter within {:.1} %, depth {:.1} %, modulus {:.0} \
             %",
            100.0 * errors.diameter,
            100.0 * errors.depth,
            100.0 * errors.youngs_modulus
        );
    }
    Ok(())
}
