//! `tactile light`: how an optical tactile sensor detects a press.
use crate::console::{Bar, Context};
use crate::failure::{Exit, Failure};
use crate::plot::{Colour, Page, Panel};
use clap::Args;
use serde_json::{Map, Value, json};
use std::f64::consts::FRAC_2_PI;
use tactile_imaging::optics::surface::{Dimple, Flat, TopSurface, Touched, TouchingObject};
use tactile_imaging::optics::trace::{LightBudget, Slab, SlabLayer, TraceOptions, path, trace};
use tactile_imaging::optics::{Dispersion, Geometry, Led, OpticsError, acceptance_angle, led_cone};

/// Trace the light of an LED through the layered waveguide, at rest and under a press
///
/// Prints the acceptance angles of the layers of the paper and the distribution of the light. --out
/// gets light.svg: ray paths, the light towards the camera as a function of slope and of the index
/// of the touching object, and the convergence with the number of rays.
#[derive(Args)]
#[command(after_help = "Example:\n  tactile light --rays 2000 --out target/light")]
pub(crate) struct LightArguments {
    /// Number of rays per point of a curve.
    #[arg(long, default_value_t = 8000,
          value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    rays: u32,
}

/// Centre of the press on the slab of 30 × 12 mm.
const CENTRE_M: [f64; 2] = [15e-3, 0.0];
/// Half width of the dimple.
const HALF_WIDTH_M: f64 = 5e-3;

pub(crate) fn run(arguments: &LightArguments, context: &mut Context) -> Result<Exit, Failure> {
    context.outputs.plan(&["light.svg"], &[""; 0])?;
    let page = traced(arguments, context).map_err(Failure::no_answer)?;
    if let Some(page) = page {
        context.outputs.page("light.svg", || page)?;
    }
    Ok(Exit::Complete)
}

/// Prints the numbers and draws the page, if requested.
fn traced(arguments: &LightArguments, context: &mut Context) -> Result<Option<Page>, OpticsError> {
    let glass = Dispersion::BOROFLOAT_33.index(530e-9)?;
    // From the object's side to the glass, §3.3.
    let layers = [(1.38, 2e-3), (1.39, 3e-3), (1.40, 5e-3), (glass, 2e-3)];
    let layers = layers.map(|(index, thickness_m)| SlabLayer { index, thickness_m });
    let tracer = Tracer {
        slab: Slab::new(&layers, 1.0, 30e-3)?,
        led: Led::new(1.0, 70_f64.to_radians())?,
        rays: arguments.rays,
    };
    let angles = angles(context)?;
    let budgets = tracer.budgets(context)?;
    context.value(&json!({
        "rays": arguments.rays, "acceptance": angles, "shares_of_the_light": budgets,
    }));
    if !context.outputs.draws() {
        return Ok(None);
    }
    let mut bar = Bar::of(6, "tracing");
    let drawn: [&dyn Fn() -> Result<Panel, OpticsError>; 6] = [
        &|| tracer.paths("Rays at rest: all trapped", &Flat),
        &|| tracer.paths("Rays under a press (dimple 1.5 mm)", &dimple(1.5e-3)?),
        &|| tracer.against_slope(),
        &|| tracer.against_index(),
        &|| tracer.along_the_slab(),
        &|| tracer.convergence(),
    ];
    let mut panels = Vec::new();
    for panel in drawn {
        panels.push(panel()?);
        bar.done(panels.len());
    }
    Ok(Some(Page::new("How the sensor detects a press", 2, panels)))
}

/// Prints how each layer traps light.
fn angles(context: &mut Context) -> Result<Vec<Value>, OpticsError> {
    let indices: [f64; 4] = [1.38, 1.39, 1.40, 1.41];
    context.line("layer index   trapped within (of its plane)   share of a Lambertian LED trapped");
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
        context.line(format_args!("  {n:.2}        {text:>10} {share:33.2} %"));
        values.push(json!({ "index": n, "angle_degrees": angle, "trapped_percent": share }));
    }
    let cone = led_cone(&indices, 1.0, 140_f64.to_radians())?;
    let answer = if cone.trapped { "yes" } else { "no" };
    context.line(format_args!(
        "an LED cone of 140° is trapped by every layer: {answer}"
    ));
    Ok(values)
}

fn dimple(depth_m: f64) -> Result<Dimple, OpticsError> {
    Dimple::new(CENTRE_M, HALF_WIDTH_M, depth_m)
}

/// A dimple of 1.5 mm in contact with a white object over its inner 3 mm.
fn pressed(index: f64) -> Result<Touched<Dimple>, OpticsError> {
    let object = TouchingObject { index, albedo: 0.8 };
    Touched::new(dimple(1.5e-3)?, object, CENTRE_M, 3e-3)
}

struct Tracer<'a> {
    slab: Slab<'a>,
    led: Led,
    rays: u32,
}

impl Tracer<'_> {
    /// Distribution of the light. `profile` is filled with the fraction towards the camera along
    /// the slab.
    fn trace(
        &self,
        surface: &dyn TopSurface,
        geometry: Geometry,
        (rays, seed): (u32, u64),
        profile: &mut [f64],
    ) -> Result<LightBudget, OpticsError> {
        let options = TraceOptions::default()
            .with_geometry(geometry)
            .with_seed(seed)
            .with_rays(rays)?
            .with_emitter_half_width_m(5e-3)?;
        trace(&self.slab, &self.led, surface, &options, profile)
    }

    /// Per cent of the light that reaches the camera.
    fn camera(&self, surface: &dyn TopSurface, geometry: Geometry) -> Result<f64, OpticsError> {
        let budget = self.trace(surface, geometry, (self.rays, 1), &mut [])?;
        Ok(100.0 * budget.camera)
    }

    /// Prints the distribution of the light, without load and in four presses.
    fn budgets(&self, context: &mut Context) -> Result<Value, OpticsError> {
        context.line(format_args!(
            "\nwhere the light of a 140° LED goes (% of its light, {} rays in space)",
            self.rays
        ));
        let names = ["guided", "top", "bottom", "camera", "object"];
        let heading = names.map(|n| format!("{n:>8}")).join(" ");
        context.line(format_args!("{:34} {heading}", ""));
        let scenes: [(&str, &dyn TopSurface); 5] = [
            ("at rest", &Flat),
            ("dimple 0.5 mm, nothing touching", &dimple(0.5e-3)?),
            ("dimple 1.5 mm, nothing touching", &dimple(1.5e-3)?),
            ("dimple 1.5 mm, object of 1.35", &pressed(1.35)?),
            ("dimple 1.5 mm, object of 1.45", &pressed(1.45)?),
        ];
        let mut rows = Map::new();
        for (name, surface) in scenes {
            let b = self.trace(surface, Geometry::Volume, (self.rays, 1), &mut [])?;
            let shares = [b.guided, b.above, b.below, b.camera, b.absorbed];
            let cells = shares.map(|share| format!("{:8.3}", 100.0 * share));
            context.line(format_args!("{name:34} {}", cells.join(" ")));
            let named = names
                .map(str::to_owned)
                .into_iter()
                .zip(shares.map(Value::from));
            rows.insert(name.to_owned(), Value::Object(named.collect()));
        }
        Ok(Value::Object(rows))
    }

    fn paths(&self, title: &str, surface: &dyn TopSurface) -> Result<Panel, OpticsError> {
        let mut panel = Panel::new(title, "along the slab (mm)", "height (mm)");
        let mut vertices = [[0.0; 3]; 200];
        let (mut stays, mut leaves) = (Vec::new(), Vec::new());
        for k in 0..5 {
            // Aimed at the flank that faces the LED, from five angles within its cone.
            let angle = 0.3 + 0.2 * k as f64;
            let inside = (angle.sin() / 1.40).asin();
            let depth_share = (12.5 * inside.tan() / 12.0).min(1.0);
            let written = path(&self.slab, surface, depth_share, angle, &mut vertices)?;
            let line = vertices[..written].iter().map(|v| [1e3 * v[0], 1e3 * v[2]]);
            let line: Vec<[f64; 2]> = line.collect();
            let end = line[written - 1];
            let ends = if end[0] < 30.0 - 1e-3 {
                &mut leaves
            } else {
                &mut stays
            };
            ends.push(end);
            // Red marks the rays that leave.
            panel = panel.line(line, Colour::category(if k < 3 { k } else { k + 1 }), "");
        }
        for (ends, colour, name) in [
            (stays, Colour::Black, "still trapped"),
            (leaves, Colour::Red, "leaves here"),
        ] {
            if !ends.is_empty() {
                panel = panel.points(ends, colour, name);
            }
        }
        let places = (0..=300).map(|i| 1e-4 * f64::from(i));
        let top = places.map(|x| [1e3 * x, 1e3 * surface.height(x, 0.0)]);
        panel = panel.line(top, Colour::Black, "");
        for z in [-2.0, -5.0, -10.0, -12.0] {
            panel = panel.dashed([[0.0, z], [30.0, z]], Colour::Grey, "");
        }
        Ok(panel)
    }

    fn against_slope(&self) -> Result<Panel, OpticsError> {
        let title = "Light to the camera as a function of the dimple's steepest slope";
        let mut panel = Panel::new(title, "steepest slope", "light to the camera (%)");
        for (geometry, name, colour) in [
            (Geometry::Section, "section", Colour::Blue),
            (Geometry::Volume, "space", Colour::Orange),
        ] {
            let mut curve = Vec::new();
            for step in 0..=24 {
                let slope = 0.025 * f64::from(step);
                // The steepest slope of a dimple of depth d and half width w is πd/2w.
                let surface = dimple(slope * HALF_WIDTH_M * FRAC_2_PI)?;
                curve.push([slope, self.camera(&surface, geometry)?]);
            }
            panel = panel.line(curve, colour, name);
        }
        Ok(panel)
    }

    fn against_index(&self) -> Result<Panel, OpticsError> {
        let title = "Light to the camera against the object's index (flat contact, 3 mm)";
        let x = "refractive index of the touching object";
        let mut panel = Panel::new(title, x, "light to the camera (%)");
        for (albedo, colour) in [(0.8, Colour::Orange), (0.4, Colour::Blue)] {
            let mut curve = Vec::new();
            for step in 0..=24 {
                let index = 1.0 + 0.025 * f64::from(step);
                let touched = Touched::new(Flat, TouchingObject { index, albedo }, CENTRE_M, 3e-3)?;
                curve.push([index, self.camera(&touched, Geometry::Volume)?]);
            }
            panel = panel.line(curve, colour, &format!("albedo {albedo}"));
        }
        Ok(panel)
    }

    fn along_the_slab(&self) -> Result<Panel, OpticsError> {
        let title = "Where the camera's light leaves the slab";
        let y = "light to the camera (% per mm)";
        let mut panel = Panel::new(title, "along the slab (mm)", y);
        let scenes: [(&str, &dyn TopSurface, Colour); 3] = [
            ("at rest", &Flat, Colour::Grey),
            ("dimple 1.5 mm", &dimple(1.5e-3)?, Colour::Blue),
            (
                "dimple with object of 1.45",
                &pressed(1.45)?,
                Colour::Orange,
            ),
        ];
        for (name, surface, colour) in scenes {
            // One bin per millimetre of the slab, and rays for all of them.
            let mut profile = [0.0; 30];
            self.trace(surface, Geometry::Volume, (4 * self.rays, 1), &mut profile)?;
            let bins = profile.iter().enumerate();
            let line = bins.map(|(k, v)| [k as f64 + 0.5, 100.0 * v]);
            panel = panel.line(line, colour, name);
        }
        Ok(panel)
    }

    fn convergence(&self) -> Result<Panel, OpticsError> {
        let surface = dimple(1.5e-3)?;
        let camera = |rays: u32, seed: u64| -> Result<f64, OpticsError> {
            let budget = self.trace(&surface, Geometry::Section, (rays, seed), &mut [])?;
            Ok(budget.camera)
        };
        // Thirty-two times as many rays as the longest of the series represent the exact result.
        let best = camera(1 << 19, 99)?;
        let mut curve: Vec<[f64; 2]> = Vec::new();
        for power in 5..=14 {
            let rays = 1_u32 << power;
            let mut square = 0.0;
            // Sixteen starts of the sequence determine the error of one.
            for seed in 0..16 {
                square += (camera(rays, seed)? / best - 1.0).powi(2);
            }
            curve.push([f64::from(rays), 100.0 * (square / 16.0).sqrt()]);
        }
        let [rays, error] = curve[0];
        let random = curve.iter().map(|p| [p[0], error * (rays / p[0]).sqrt()]);
        let random: Vec<_> = random.collect();
        Ok(Panel::new(
            "Convergence with the number of rays",
            "rays",
            "rms error (%)",
        )
        .logarithmic()
        .dashed(random, Colour::Grey, "random rays, 1/√N")
        .line(curve, Colour::Blue, "evenly spread rays"))
    }
}
