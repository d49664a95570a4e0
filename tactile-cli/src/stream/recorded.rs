//! A series of recorded frames: those of a scene, or images and folders of images.
use super::live::Live;
use super::{Arguments, finish};
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::images::eight_bits;
use crate::outputs::Outputs;
use crate::progress::{Progress, waiting};
use std::path::{Path, PathBuf};
use std::time::Instant;
use tactile_imaging::pipeline::Session;
use tactile_imaging::scene::Scene;

/// Frames up to which every one is printed.
const PRINTED_ALL: usize = 32;

pub fn run(
    path: &Path,
    arguments: &Arguments,
    outputs: Outputs,
    context: &mut Context,
) -> Result<Exit, Failure> {
    if arguments.strain && arguments.force.is_none() {
        return Err(Failure::input(
            "--strain of recorded frames needs --force, the largest force in newtons: strain is counted from the first frame of a third of it",
        ));
    }
    let scene = Scene::read(path).map_err(Failure::input)?;
    let frames = if arguments.frames.is_empty() {
        scene
            .frames
            .iter()
            .map(|frame| frame.image.clone())
            .collect()
    } else {
        listed(&arguments.frames)?
    };
    let inputs: Vec<&Path> = frames.iter().map(PathBuf::as_path).collect();
    outputs.check(&inputs)?;
    let data = waiting("reading the scene", || scene.load()).map_err(Failure::input)?;
    let pipeline = scene.pipeline(&data).map_err(Failure::input)?;
    let session = Session::new(&pipeline, &[data.reference.view()])
        .map_err(|error| Failure::input(scene.measure_error(error)))?;
    let strained_above_n = arguments
        .force
        .filter(|_| arguments.strain)
        .map(|n| n / 3.0);
    let mut live = Live::new(session, None, strained_above_n);
    live.print_heading(&mut context.console);
    let mut bar = Progress::of(frames.len(), "measuring");
    let mut unusable = 0;
    context.interrupt.hear(true);
    for (k, path) in frames.iter().enumerate() {
        if context.interrupt.requested() {
            break;
        }
        let time_s = k as f64 / arguments.rate;
        let measured = eight_bits(path, scene.bits).and_then(|frame| {
            let start = Instant::now();
            let pushed = live.push(time_s, frame.view());
            pushed.map_err(|error| Failure::input(format!("{}: {error}", path.display())))?;
            Ok(start.elapsed())
        });
        match measured {
            Ok(took) => {
                live.late += usize::from(took.as_secs_f64() > 1.0 / arguments.rate);
                live.print_last(frames.len() <= PRINTED_ALL, &mut context.console);
            }
            Err(failure) => {
                unusable += 1;
                context.console.note(failure);
            }
        }
        bar.done(k + 1);
    }
    drop(bar);
    if live.rows.is_empty() && unusable > 0 {
        return Err(Failure::input(format!(
            "none of the {unusable} frames can be measured"
        )));
    }
    let exit = finish(&mut live, arguments, outputs, context)?;
    Ok(if unusable > 0 { Exit::Partial } else { exit })
}

/// The images that are named, and those of the folders that are named in the order of their names.
fn listed(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut frames = Vec::new();
    for path in paths {
        if !path.is_dir() {
            frames.push(path.clone());
            continue;
        }
        let unreadable = |error| {
            Failure::input(format!(
                "cannot list the folder {}: {error}",
                path.display()
            ))
        };
        let entries = std::fs::read_dir(path).map_err(unreadable)?;
        let mut images: Vec<PathBuf> = entries
            .map(|entry| entry.map(|e| e.path()))
            .collect::<Result<_, _>>()
            .map_err(unreadable)?;
        images.retain(|file| is_image(file));
        if images.is_empty() {
            return Err(Failure::input(format!(
                "the folder {} has no PNG, PGM or JPEG images",
                path.display()
            )));
        }
        images.sort_by_cached_key(|image| natural(image));
        frames.append(&mut images);
    }
    Ok(frames)
}

fn is_image(path: &Path) -> bool {
    let extension = path
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default();
    ["png", "pgm", "jpg", "jpeg"].contains(&extension.to_ascii_lowercase().as_str())
}

/// The parts of a file's name, numbers by their value: frame_2 comes before frame_10.
fn natural(path: &Path) -> Vec<(u64, String)> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut parts: Vec<(u64, String)> = vec![(0, String::new())];
    let mut in_number = false;
    for character in name.chars() {
        let digit = character.to_digit(10);
        if digit.is_some() && !in_number {
            parts.push((0, String::new()));
        }
        in_number = digit.is_some();
        let Some((number, text)) = parts.last_mut() else {
            continue;
        };
        match digit {
            Some(digit) => *number = number.saturating_mul(10).saturating_add(digit.into()),
            None => text.push(character),
        }
    }
    parts
}
