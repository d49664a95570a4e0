//! A real press: a ball of 4 mm radius on the 9DTact sensor, which grows darker with depth.
//!
//! ```text
//! TACTILE_DATA=/path/to/data cargo run --release --example press_9dtact
//! ```
//! Finds the contact, turns grey into depth with the makers' table, fits the ball, prints both beside each other and
//! draws them. Data: <https://github.com/linchangyi1/9DTact> (MIT).
#![allow(clippy::print_stdout, clippy::print_stderr)]
use clap::Parser;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tactile_imaging::io::{ReadError, read_grey_image, read_table};
use tactile_imaging::pipeline::{
    BallFit, ContactReading, ContactSurface, DarkContact, Object, Pipeline, SurfaceInput,
};
use tactile_imaging::plot::{Colour, HeatMap, Marker, Page, Panel};

const PIXEL_M: f64 = 0.0510151e-3;
const BALL_M: f64 = 4.0e-3;
const MM: f64 = 1e3;

/// Finds the ball of a real press and checks its depth.
#[derive(Parser)]
struct Arguments {
    /// Folder with rectify_crop_ref.png, rectify_crop_sample.png and grey_to_depth_mm.csv; the subfolder 9dtact of the
    /// environment's TACTILE_DATA, or of ../shared/data, if not given.
    #[arg(long)]
    data: Option<PathBuf>,
    /// Folder for the plot.
    #[arg(long, default_value = "target/press_9dtact")]
    out: PathBuf,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("press_9dtact: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let root = std::env::var_os("TACTILE_DATA").map_or("../shared/data".into(), PathBuf::from);
    let folder = arguments
        .data
        .clone()
        .unwrap_or_else(|| root.join("9dtact"));
    if arguments.data.is_none() && !folder.is_dir() {
        println!(
            "skipped: no folder {} (set TACTILE_DATA or --data)",
            folder.display()
        );
        return Ok(());
    }
    let reference = read_grey_image(folder.join("rectify_crop_ref.png"))?.to_u8();
    let frame = read_grey_image(folder.join("rectify_crop_sample.png"))?.to_u8();
    let entries = depth_table(&folder)?;
    let contact = DarkContact::new(&entries, [PIXEL_M; 2])?;
    let pipeline = Pipeline::new(contact, Object::sphere(BALL_M))?
        .with_surface(DarkContact::depth_table(&entries)?, SurfaceInput::Signal);
    let mut press = pipeline.press(reference.view())?;
    press.add_frame(frame.view());
    let reading = *press.contact(0)?.ok_or("no contact found")?;
    let surface = press.surface(0)?;
    let ball = surface.fit_ball(BALL_M).ok_or("no ball fits the surface")?;

    let rings = profile(surface, &ball);
    print(&reading, &ball, &rings);
    let page = draw(
        surface,
        &ball,
        &rings,
        HeatMap::of_frame(frame.view(), [PIXEL_M * MM; 2]),
    );
    page.save(arguments.out.join("press.svg"))?;
    eprintln!("plot: {}", arguments.out.join("press.svg").display());
    Ok(())
}

/// (darkness in grey levels, depth in metres) of the makers' table.
fn depth_table(folder: &Path) -> Result<Vec<(f64, f64)>, ReadError> {
    let path = folder.join("grey_to_depth_mm.csv");
    let table = read_table(&path)?;
    let darkness = table.column("darkness_grey_levels", 0, &path)?;
    let depth_mm = table.column("depth_mm", 1, &path)?;
    Ok(darkness
        .into_iter()
        .zip(depth_mm.iter().map(|z| z / MM))
        .collect())
}

/// The contact and the ball beside each other, and both depths by distance from the centre.
fn print(reading: &ContactReading, ball: &BallFit, rings: &[[f64; 3]]) {
    let px = |m: f64| m / PIXEL_M;
    println!(
        "contact    centroid ({:.1}, {:.1}) px",
        reading.centroid_px[0].value, reading.centroid_px[1].value
    );
    println!(
        "           radius {:.1} px = {:.3} mm (from its area)",
        px(reading.contact_radius_m.value),
        reading.contact_radius_m.value * MM
    );
    println!(
        "ball       centre ({:.1}, {:.1}) px",
        px(ball.centre_m[0]),
        px(ball.centre_m[1])
    );
    println!(
        "           contact radius {:.1} px = {:.3} mm",
        px(ball.contact_radius_m),
        ball.contact_radius_m * MM
    );
    println!(
        "           cap {:.3} mm deep",
        ball.depth_m(ball.centre_m) * MM
    );
    println!(
        "depth      mean absolute error {:.4} mm over {} pixels (the makers state 0.0462 mm)",
        ball.mean_absolute_error_m * MM,
        ball.pixels
    );
    println!("\n   r (mm)   measured   ball (mm)");
    for [r, measured, expected] in rings {
        println!(
            "  {:7.2} {:10.3} {:10.3}",
            r * MM,
            measured * MM,
            expected * MM
        );
    }
}

/// Mean measured depth and the ball's, in rings of 0.2 mm around the centre: radius, measured, ball.
fn profile(surface: &ContactSurface, ball: &BallFit) -> Vec<[f64; 3]> {
    let mut rings = vec![[0.0; 4]; 20];
    let origin = surface.origin_m();
    for ((row, column), h) in surface.surface.heights.indexed_iter() {
        let at = [
            origin[0] + column as f64 * PIXEL_M,
            origin[1] + row as f64 * PIXEL_M,
        ];
        let r = (at[0] - ball.centre_m[0]).hypot(at[1] - ball.centre_m[1]);
        if let Some(ring) = rings.get_mut((r / 0.2e-3) as usize) {
            let depth = if h.is_finite() { *h } else { 0.0 };
            for (sum, v) in ring.iter_mut().zip([1.0, r, depth, ball.depth_m(at)]) {
                *sum += v;
            }
        }
    }
    rings
        .iter()
        .filter(|ring| ring[0] > 0.0)
        .map(|[n, r, z, b]| [r / n, z / n, b / n])
        .collect()
}

fn draw(surface: &ContactSurface, ball: &BallFit, rings: &[[f64; 3]], frame: HeatMap) -> Page {
    let turn = (0..=120).map(|i| f64::from(i) * std::f64::consts::TAU / 120.0);
    let circle: Vec<_> = turn
        .map(|t| [t.cos(), t.sin()])
        .map(|[c, s]| {
            let at = |k: usize, v: f64| (ball.centre_m[k] + ball.contact_radius_m * v) * MM;
            [at(0, c), at(1, s)]
        })
        .collect();
    let axes = |title: &str| Panel::new(title).x_label("x (mm)").y_label("y (mm)");
    let depth = surface.surface.heights.mapv(|h| h * MM);
    let map = HeatMap::of_pixels(depth.view(), [PIXEL_M * MM; 2], "depth (mm)")
        .origin(surface.origin_m().map(|o| o * MM));
    let column = |k: usize| rings.iter().map(move |ring| [ring[0] * MM, ring[k] * MM]);
    let cut = Panel::new("Depth around the centre")
        .x_label("distance from the centre (mm)")
        .y_label("depth (mm)")
        .line(column(2), Colour::BLUE, "ball of 4 mm")
        .marked(column(1), Marker::Ring, Colour::RED, "measured");
    Page::new("9DTact: a ball of 4 mm radius")
        .columns(3)
        .panel(
            axes("Frame")
                .heat_map(frame)
                .line(circle.clone(), Colour::ORANGE, "ball's contact"),
        )
        .panel(axes("Depth").heat_map(map).line(circle, Colour::ORANGE, ""))
        .panel(cut)
}
