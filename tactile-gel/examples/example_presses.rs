//! The presses of `examples/data/colour`: a bonded layer of 3 mm under a ball of 1.2 mm, whose
//! surface is known in closed form.
//!
//! `cargo run --release -p tactile-gel --example example_presses -- FOLDER` writes the reference and
//! six presses as PNG.

use ndarray::{Array2, Array3};
use std::path::Path;
use tactile_gel::simulate::{ColourGel, ElasticFace, HertzPress};

/// Rows and columns.
const SHAPE: [usize; 2] = [90, 120];
/// Radius of the ball in pixels of 50 µm.
const BALL_PX: f64 = 24.0;
/// Column, row and radius of each contact in pixels.
const CONTACTS: [[f64; 3]; 6] = [
    [34.0, 30.0, 16.0],
    [60.0, 45.0, 18.0],
    [86.0, 60.0, 15.0],
    [84.0, 28.0, 17.0],
    [36.0, 62.0, 17.0],
    [58.0, 30.0, 16.0],
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("name a folder")?;
    let gel = ColourGel {
        shape: SHAPE,
        ..ColourGel::default()
    };
    let face = ElasticFace {
        thickness_px: 60.0,
        poisson_ratio: 0.48,
    };
    let save = |name: &str, frame: Array3<u8>| {
        let [height, width] = SHAPE.map(|n| n as u32);
        let levels = frame.into_raw_vec_and_offset().0;
        let image = image::RgbImage::from_raw(width, height, levels).expect("three channels");
        image.save(Path::new(&folder).join(name))
    };
    save("reference.png", gel.frame(&Array2::zeros(SHAPE), 0))?;
    for (k, [x, y, radius]) in CONTACTS.into_iter().enumerate() {
        let press = HertzPress::ball([x, y], BALL_PX, radius);
        let frame = gel.frame(&face.depth_px(SHAPE, &[press]), k as u64 + 1);
        save(&format!("press_{}.png", k + 1), frame)?;
    }
    Ok(())
}
