//! Why an optical tactile sensor sees a press.
//!
//! Shoots the light of an LED through the paper's waveguide, at rest and under a press, prints where the light goes, and
//! plots ray paths, the light towards the camera against slope and against the touching object's index, and how fast
//! the answer settles with the number of rays.
//!
//! ```text
//! cargo run --release --example light_leakage -- --rays 20000 --out target/light_leakage
//! ```
#![allow(clippy::print_stdout, clippy::print_stderr)]
use std::error::Error;
use std::path::PathBuf;

use clap::Parser;
use tactile_imaging::optics::surface::{Dimple, Flat, TopSurface, Touched, TouchingObject};
use tactile_imaging::optics::trace::{LightBudget, Slab, SlabLayer, TraceOptions, path, trace};
use tactile_imaging::optics::{
    AcceptanceAngle, Dispersion, Geometry, LayerStack, Led, OpticsError,
};
use tactile_imaging::plot::{Colour, Page, Panel, Scale};

/// Where the light of an LED goes in the layered waveguide, at rest and under a press.
#[derive(Parser)]
struct Arguments {
    /// Rays for each point of a curve.
    #[arg(long, default_value_t = 8000)]
    rays: u32,
    /// Folder for the plots.
    #[arg(long, default_value = "target/light_leakage")]
    out: PathBuf,
}

/// Length of the slab: the paper's 30 mm side.
const LENGTH_M: f64 = 30e-3;
/// Thickness of the slab: three layers and the glass.
const THICKNESS_M: f64 = 12e-3;
/// Centre of the press.
const CENTRE_M: [f64; 2] = [15e-3, 0.0];
/// Half width of the dimple.
const HALF_WIDTH_M: f64 = 5e-3;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let glass = Dispersion::BOROFLOAT_33.index(530e-9)?;
    let layer = |index, thickness_m| SlabLayer { index, thickness_m };
    let layers = [
        // From the object's side to the glass, §3.3.
        layer(1.38, 2e-3),
        layer(1.39, 3e-3),
        layer(1.40, 5e-3),
        layer(glass, 2e-3),
    ];
    let slab = Slab::new(&layers, 1.0, LENGTH_M)?;
    let led = Led::new(1.0, 70_f64.to_radians())?;
    print_angles()?;
    let scenes = Scenes {
        slab,
        led,
        rays: arguments.rays,
    };
    scenes.print_budgets()?;
    let page = Page::new("Why the sensor sees a press")
        .columns(2)
        .panel(scenes.paths("Rays at rest: all trapped", &Flat)?)
        .panel(scenes.paths("Rays under a press (dimple 1.5 mm)", &dimple(1.5e-3)?)?)
        .panel(scenes.against_slope()?)
        .panel(scenes.against_index()?)
        .panel(scenes.along_the_slab()?)
        .panel(scenes.convergence()?);
    let file = arguments.out.join("light_leakage.svg");
    page.save(&file)?;
    println!("\nplots: {}", file.display());
    Ok(())
}

fn print_angles() -> Result<(), OpticsError> {
    let indices = [1.38, 1.39, 1.40, 1.41];
    let stack = LayerStack::new(&indices, 1.0)?;
    println!("layer index   trapped within (of its plane)   share of a Lambertian LED trapped");
    for (n, answer) in indices.iter().zip(stack.acceptance_angles()) {
        let share = 100.0 * Led::lambertian().trapped_share(answer, Geometry::Volume);
        match answer {
            AcceptanceAngle::Below(angle) => {
                println!("  {n:.2}          {:6.2}°  {share:35.2} %", angle.degrees())
            }
            AcceptanceAngle::AllTrapped => println!("  {n:.2}          every ray {share:33.2} %"),
            AcceptanceAngle::NoneTrapped => println!("  {n:.2}          none {share:38.2} %"),
        }
    }
    let cone = stack.led_cone(140_f64.to_radians())?;
    println!(
        "an LED cone of 140° is trapped by every layer: {}",
        if cone.is_trapped() { "yes" } else { "no" }
    );
    Ok(())
}

fn dimple(depth_m: f64) -> Result<Dimple<f64>, OpticsError> {
    Dimple::new(CENTRE_M, HALF_WIDTH_M, depth_m)
}

/// A dimple touched by a white object over its inner 3 mm.
fn pressed(depth_m: f64, index: f64) -> Result<Touched<Dimple<f64>, f64>, OpticsError> {
    Touched::new(
        dimple(depth_m)?,
        TouchingObject { index, albedo: 0.8 },
        CENTRE_M,
        3e-3,
    )
}

struct Scenes<'a> {
    slab: Slab<'a, f64>,
    led: Led<f64>,
    rays: u32,
}

impl Scenes<'_> {
    fn budget(
        &self,
        surface: &dyn TopSurface<f64>,
        geometry: Geometry,
    ) -> Result<LightBudget<f64>, OpticsError> {
        let options = Self::options(geometry, self.rays, 1)?;
        trace(&self.slab, &self.led, surface, &options, &mut [])
    }

    fn options(geometry: Geometry, rays: u32, seed: u64) -> Result<TraceOptions<f64>, OpticsError> {
        TraceOptions::default()
            .with_geometry(geometry)
            .with_seed(seed)
            .with_rays(rays)?
            .with_emitter_half_width_m(5e-3)
    }

    fn print_budgets(&self) -> Result<(), OpticsError> {
        println!(
            "\nwhere the light of a 140° LED goes (% of its light, {} rays in space)",
            self.rays
        );
        println!(
            "{:34} {:>8} {:>8} {:>8} {:>8} {:>8}",
            "", "guided", "top", "bottom", "camera", "object"
        );
        let row = |name: &str, surface: &dyn TopSurface<f64>| -> Result<(), OpticsError> {
            let b = self.budget(surface, Geometry::Volume)?;
            let shares = [b.guided, b.above, b.below, b.camera, b.absorbed];
            let cells: Vec<String> = shares
                .iter()
                .map(|s| format!("{:8.3}", 100.0 * s))
                .collect();
            println!("{name:34} {}", cells.join(" "));
            Ok(())
        };
        row("at rest", &Flat)?;
        row("dimple 0.5 mm, nothing touching", &dimple(0.5e-3)?)?;
        row("dimple 1.5 mm, nothing touching", &dimple(1.5e-3)?)?;
        row("dimple 1.5 mm, object of 1.35", &pressed(1.5e-3, 1.35)?)?;
        row("dimple 1.5 mm, object of 1.45", &pressed(1.5e-3, 1.45)?)
    }

    fn paths(&self, title: &str, surface: &dyn TopSurface<f64>) -> Result<Panel, OpticsError> {
        let mm = |v: f64| 1e3 * v;
        let mut panel = Panel::new(title)
            .x_label("along the slab (mm)")
            .y_label("height (mm)");
        let mut vertices = [[0.0; 3]; 200];
        let colours = [
            Colour::BLUE,
            Colour::ORANGE,
            Colour::GREEN,
            Colour::PURPLE,
            Colour::SKY,
        ];
        let (mut stays, mut leaves) = (Vec::new(), Vec::new());
        for (k, colour) in colours.into_iter().enumerate() {
            // Aimed at the flank that faces the LED, from five angles within its cone.
            let angle = 0.3 + 0.2 * k as f64;
            let inside = (angle.sin() / 1.40).asin();
            let depth_share = (12.5e-3 * inside.tan() / THICKNESS_M).min(1.0);
            let written = path(&self.slab, surface, depth_share, angle, &mut vertices)?;
            let line: Vec<[f64; 2]> = vertices[..written]
                .iter()
                .map(|v| [mm(v[0]), mm(v[2])])
                .collect();
            let end = line[written - 1];
            if end[0] < mm(LENGTH_M) - 1e-6 {
                leaves.push(end)
            } else {
                stays.push(end)
            }
            panel = panel.line(line, colour, "");
        }
        panel = panel.points(stays, Colour::BLACK, "still trapped").points(
            leaves,
            Colour::RED,
            "leaves here",
        );
        let top = (0..=300)
            .map(|i| 1e-4 * f64::from(i))
            .map(|x| [mm(x), mm(surface.height(x, 0.0))]);
        panel = panel.line(top, Colour::BLACK, "");
        for z in [-2.0, -5.0, -10.0, -12.0] {
            panel = panel.dashed([[0.0, z], [mm(LENGTH_M), z]], Colour::GREY, "");
        }
        Ok(panel.y_range([-13.0, 1.0]))
    }

    fn against_slope(&self) -> Result<Panel, OpticsError> {
        eprintln!("tracing against slope …");
        let mut panel = Panel::new("Light to the camera against the dimple's steepest slope")
            .x_label("steepest slope")
            .y_label("light to the camera (%)");
        for (geometry, name, colour) in [
            (Geometry::Section, "section", Colour::BLUE),
            (Geometry::Volume, "space", Colour::ORANGE),
        ] {
            let mut curve = Vec::new();
            for step in 0..=24 {
                let slope = 0.025 * f64::from(step);
                let surface = Dimple::of_slope(CENTRE_M, HALF_WIDTH_M, slope)?;
                curve.push([slope, 100.0 * self.budget(&surface, geometry)?.camera]);
            }
            panel = panel.line(curve, colour, name);
        }
        Ok(panel)
    }

    fn against_index(&self) -> Result<Panel, OpticsError> {
        eprintln!("tracing against the object's index …");
        let mut panel =
            Panel::new("Light to the camera against the object's index (flat contact, 3 mm)")
                .x_label("refractive index of the touching object")
                .y_label("light to the camera (%)");
        for (albedo, colour) in [(0.8, Colour::ORANGE), (0.4, Colour::BLUE)] {
            let mut curve = Vec::new();
            for step in 0..=24 {
                let index = 1.0 + 0.025 * f64::from(step);
                let touched = Touched::new(Flat, TouchingObject { index, albedo }, CENTRE_M, 3e-3)?;
                curve.push([
                    index,
                    100.0 * self.budget(&touched, Geometry::Volume)?.camera,
                ]);
            }
            panel = panel.line(curve, colour, &format!("albedo {albedo}"));
        }
        Ok(panel)
    }

    fn along_the_slab(&self) -> Result<Panel, OpticsError> {
        eprintln!("tracing along the slab …");
        let mut panel = Panel::new("Where the camera's light leaves the slab")
            .x_label("along the slab (mm)")
            .y_label("light to the camera (% per mm)");
        let object = pressed(1.5e-3, 1.45)?;
        let empty = dimple(1.5e-3)?;
        let scenes: [(&str, &dyn TopSurface<f64>, Colour); 3] = [
            ("at rest", &Flat, Colour::GREY),
            ("dimple 1.5 mm", &empty, Colour::BLUE),
            ("dimple with object of 1.45", &object, Colour::ORANGE),
        ];
        for (name, surface, colour) in scenes {
            let mut profile = [0.0; 30];
            let options = Self::options(Geometry::Volume, 4 * self.rays, 1)?;
            trace(&self.slab, &self.led, surface, &options, &mut profile)?;
            panel = panel.line(
                profile
                    .iter()
                    .enumerate()
                    .map(|(k, v)| [k as f64 + 0.5, 100.0 * v]),
                colour,
                name,
            );
        }
        Ok(panel)
    }

    fn convergence(&self) -> Result<Panel, OpticsError> {
        eprintln!("tracing for convergence …");
        let surface = dimple(1.5e-3)?;
        let camera = |rays: u32, seed: u64| -> Result<f64, OpticsError> {
            let options = Self::options(Geometry::Section, rays, seed)?;
            Ok(trace(&self.slab, &self.led, &surface, &options, &mut [])?.camera)
        };
        let best = camera(1 << 19, 99)?;
        let mut curve = Vec::new();
        for power in 5..=14 {
            let rays = 1_u32 << power;
            let mut square = 0.0;
            for seed in 0..16 {
                square += (camera(rays, seed)? / best - 1.0).powi(2);
            }
            curve.push([f64::from(rays), 100.0 * (square / 16.0).sqrt()]);
        }
        println!("\nerror of the camera's share (rms over 16 shifts, section, dimple of 1.5 mm):");
        for [rays, error] in &curve {
            println!("  {rays:7.0} rays  {error:8.4} %");
        }
        let first = curve[0];
        let random = curve
            .iter()
            .map(|p| [p[0], first[1] * (first[0] / p[0]).sqrt()])
            .collect::<Vec<_>>();
        Ok(Panel::new("Convergence with the number of rays")
            .x_label("rays")
            .y_label("rms error (%)")
            .scales(Scale::Log10, Scale::Log10)
            .dashed(random, Colour::GREY, "random rays, 1/√N")
            .line(curve, Colour::BLUE, "evenly spread rays"))
    }
}
