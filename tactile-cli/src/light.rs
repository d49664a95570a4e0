//! `tactile light`: why an optical tactile sensor sees a press.
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::outputs::Outputs;
use crate::plot::{Colour, Page, Panel, Scale};
use crate::progress::Progress;
use clap::Args;
use serde_json::{Map, Value, json};
use std::f64::consts::FRAC_2_PI;
use std::path::PathBuf;
use tactile_imaging::optics::surface::{Dimple, Flat, TopSurface, Touched, TouchingObject};
use tactile_imaging::optics::trace::{LightBudget, Slab, SlabLayer, TraceOptions, path, trace};
use tactile_imaging::optics::{Dispersion, Geometry, Led, OpticsError, acceptance_angle, led_cone};

/// Trace the light of an LED through the layered waveguide, at rest and under a press
///
/// Prints the acceptance angles of the paper's layers and where the light goes. --out gets light.svg: ray paths, the light
/// towards the camera against slope and against the touching object's index, and how fast the answer settles with the
/// number of rays.
#[derive(Args)]
#[command(after_help = "Example:\n  tactile light --rays 2000 --out target/light")]
pub struct Arguments {
    /// Rays for each point of a curve.
    #[arg(long, default_value_t = 8000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    rays: u32,
    /// Folder for light.svg.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Length of the slab: the paper's 30 mm side.
const LENGTH_M: f64 = 30e-3;
/// Thickness of the slab: three layers and the glass.
const THICKNESS_M: f64 = 12e-3;
/// Centre of the press.
const CENTRE_M: [f64; 2] = [15e-3, 0.0];
/// Half width of the dimple.
const HALF_WIDTH_M: f64 = 5e-3;

const FILE: &str = "light.svg";

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let mut outputs = Outputs::plan(arguments.out.as_deref(), &[FILE], &[])?;
    let wanted = outputs.wanted();
    let page = traced(arguments, context, wanted).map_err(Failure::no_answer)?;
    if let Some(page) = page {
        outputs.page(FILE, || page)?;
    }
    if let Some(summary) = outputs.summary() {
        context.console.line(summary);
    }
    Ok(Exit::Complete)
}

/// Prints the numbers and draws the page, if that is wanted.
fn traced(
    arguments: &Arguments,
    context: &mut Context,
    wanted: bool,
) -> Result<Option<Page>, OpticsError> {
    let glass = Dispersion::BOROFLOAT_33.index(530e-9)?;
    let layer = |index, thickness_m| SlabLayer { index, thickness_m };
    let layers = [
        // From the object's side to the glass, §3.3.
        layer(1.38, 2e-3),
        layer(1.39, 3e-3),
        layer(1.40, 5e-3),
        layer(glass, 2e-3),
    ];
    let scenes = Scenes {
        slab: Slab::new(&layers, 1.0, LENGTH_M)?,
        led: Led::new(1.0, 70_f64.to_radians())?,
        rays: arguments.rays,
    };
    let angles = angles(context)?;
    let budgets = scenes.budgets(context)?;
    context.console.value(&json!({
        "rays": arguments.rays, "acceptance": angles, "shares_of_the_light": budgets,
    }));
    if !wanted {
        return Ok(None);
    }
    let mut bar = Progress::of(6, "tracing");
    let mut page = Page::new("Why the sensor sees a press").columns(2);
    let panels: [&dyn Fn() -> Result<Panel, OpticsError>; 6] = [
        &|| scenes.paths("Rays at rest: all trapped", &Flat),
        &|| scenes.paths("Rays under a press (dimple 1.5 mm)", &dimple(1.5e-3)?),
        &|| scenes.against_slope(),
        &|| scenes.against_index(),
        &|| scenes.along_the_slab(),
        &|| scenes.convergence(),
    ];
    for (k, panel) in panels.into_iter().enumerate() {
        page = page.panel(panel()?);
        bar.done(k + 1);
    }
    Ok(Some(page))
}

/// Prints how each layer traps light.
fn angles(context: &mut Context) -> Result<Vec<Value>, OpticsError> {
    let indices: [f64; 4] = [1.38, 1.39, 1.40, 1.41];
    let console = &mut context.console;
    console.line("layer index   trapped within (of its plane)   share of a Lambertian LED trapped");
    let mut values = Vec::new();
    for n in indices {
        let acceptance = acceptance_angle(n, 1.0)?;
        let share = 100.0 * Led::default().trapped_share(acceptance, Geometry::Volume);
        let degrees = acceptance.radians.to_degrees();
        let (angle, text) = if acceptance.radians == 0.0 {
            (None, "none".to_owned())
        } else if acceptance.complement == 0.0 {
            (Some(90.0), "every ray".to_owned())
        } else {
            (Some(degrees), format!("{degrees:.2}°"))
        };
        console.line(format!("  {n:.2}        {text:>10} {share:33.2} %"));
        values.push(json!({ "index": n, "angle_degrees": angle, "trapped_percent": share }));
    }
    let cone = led_cone(&indices, 1.0, 140_f64.to_radians())?;
    console.line(format!(
        "an LED cone of 140° is trapped by every layer: {}",
        if cone.trapped { "yes" } else { "no" }
    ));
    Ok(values)
}

fn dimple(depth_m: f64) -> Result<Dimple, OpticsError> {
    Dimple::new(CENTRE_M, HALF_WIDTH_M, depth_m)
}

/// A dimple touched by a white object over its inner 3 mm.
fn pressed(depth_m: f64, index: f64) -> Result<Touched<Dimple>, OpticsError> {
    Touched::new(
        dimple(depth_m)?,
        TouchingObject { index, albedo: 0.8 },
        CENTRE_M,
        3e-3,
    )
}

struct Scenes<'a> {
    slab: Slab<'a>,
    led: Led,
    rays: u32,
}

impl Scenes<'_> {
    fn budget(
        &self,
        surface: &dyn TopSurface,
        geometry: Geometry,
    ) -> Result<LightBudget, OpticsError> {
        let options = Self::options(geometry, self.rays, 1)?;
        trace(&self.slab, &self.led, surface, &options, &mut [])
    }

    fn options(geometry: Geometry, rays: u32, seed: u64) -> Result<TraceOptions, OpticsError> {
        TraceOptions::default()
            .with_geometry(geometry)
            .with_seed(seed)
            .with_rays(rays)?
            .with_emitter_half_width_m(5e-3)
    }

    /// Prints where the light goes, at rest and in four presses.
    fn budgets(&self, context: &mut Context) -> Result<Value, OpticsError> {
        let console = &mut context.console;
        console.line(format!(
            "\nwhere the light of a 140° LED goes (% of its light, {} rays in space)",
            self.rays
        ));
        let names = ["guided", "top", "bottom", "camera", "object"];
        let heading: Vec<String> = names.iter().map(|n| format!("{n:>8}")).collect();
        console.line(format!("{:34} {}", "", heading.join(" ")));
        let (shallow, deep) = (dimple(0.5e-3)?, dimple(1.5e-3)?);
        let (faint, bright) = (pressed(1.5e-3, 1.35)?, pressed(1.5e-3, 1.45)?);
        let scenes: [(&str, &dyn TopSurface); 5] = [
            ("at rest", &Flat),
            ("dimple 0.5 mm, nothing touching", &shallow),
            ("dimple 1.5 mm, nothing touching", &deep),
            ("dimple 1.5 mm, object of 1.35", &faint),
            ("dimple 1.5 mm, object of 1.45", &bright),
        ];
        let mut rows = Map::new();
        for (name, surface) in scenes {
            let b = self.budget(surface, Geometry::Volume)?;
            let shares = [b.guided, b.above, b.below, b.camera, b.absorbed];
            let cells = shares.map(|share| format!("{:8.3}", 100.0 * share));
            console.line(format!("{name:34} {}", cells.join(" ")));
            let named = names
                .iter()
                .zip(shares)
                .map(|(n, s)| ((*n).to_owned(), json!(s)));
            rows.insert(name.to_owned(), Value::Object(named.collect()));
        }
        Ok(Value::Object(rows))
    }

    fn paths(&self, title: &str, surface: &dyn TopSurface) -> Result<Panel, OpticsError> {
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
                // The steepest slope of a dimple of depth d and half width w is πd/2w.
                let surface = dimple(slope * HALF_WIDTH_M * FRAC_2_PI)?;
                curve.push([slope, 100.0 * self.budget(&surface, geometry)?.camera]);
            }
            panel = panel.line(curve, colour, name);
        }
        Ok(panel)
    }

    fn against_index(&self) -> Result<Panel, OpticsError> {
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
        let mut panel = Panel::new("Where the camera's light leaves the slab")
            .x_label("along the slab (mm)")
            .y_label("light to the camera (% per mm)");
        let object = pressed(1.5e-3, 1.45)?;
        let empty = dimple(1.5e-3)?;
        let scenes: [(&str, &dyn TopSurface, Colour); 3] = [
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
