//! The crate tactile-optics alone: which light stays in the paper's layers, and where the rest goes
//! under a press.
#![allow(clippy::print_stdout)]
use tactile_optics::surface::Dimple;
use tactile_optics::trace::{Slab, SlabLayer, TraceOptions, trace};
use tactile_optics::{Led, OpticsError, acceptance_angle};

fn main() -> Result<(), OpticsError> {
    for index in [1.38_f64, 1.39, 1.40, 1.41] {
        let degrees = acceptance_angle(index, 1.0)?.radians.to_degrees();
        println!("n = {index}: rays within {degrees:.2}° are trapped");
    }
    let layers = [1.40, 1.47].map(|index| SlabLayer {
        index,
        thickness_m: 5e-3,
    });
    let slab = Slab::new(&layers, 1.0, 30e-3)?;
    let led = Led::new(1.0, 70_f64.to_radians())?;
    let options = TraceOptions::default().with_rays(2000)?;
    for depth_m in [0.5e-3, 1.5e-3] {
        let press = Dimple::new([15e-3, 0.0], 5e-3, depth_m)?;
        let light = trace(&slab, &led, &press, &options, &mut [])?;
        let leaving = 100.0 * (light.above + light.below);
        println!("{} mm deep: {leaving:.2} % leaves the slab", 1e3 * depth_m);
    }
    Ok(())
}
