//! The picture of a study: time across, error upwards, both in decades.

use crate::study::Study;
use std::path::Path;
use tactile_imaging::plot::{Colour, Layer, Legend, Marker, Page, Panel, PlotError, Scale};

const COLOURS: [Colour; 7] = [
    Colour::BLUE,
    Colour::GREEN,
    Colour::ORANGE,
    Colour::PURPLE,
    Colour::SKY,
    Colour(120, 94, 60),
    Colour(90, 90, 200),
];

pub(crate) fn save(study: &Study, path: &Path) -> Result<(), PlotError> {
    let at = |seconds: f64, error: f64| [1e3 * seconds, error];
    let mut panel = Panel::new(format!(
        "{}: time against error",
        study.name.replace('_', " ")
    ))
    .x_label("time / ms")
    .y_label(study.error_label)
    .scales(Scale::Log10, Scale::Log10)
    .legend(Legend::UpperRight)
    .dashed(
        study.front().iter().map(|e| at(e.seconds, e.error)),
        Colour::GREY,
        "front",
    );
    let mut knobs: Vec<&str> = study.entries.iter().map(|e| e.knob).collect();
    knobs.dedup();
    for (k, knob) in knobs.iter().enumerate() {
        let points = study
            .entries
            .iter()
            .filter(|e| e.knob == *knob)
            .map(|e| at(e.seconds, e.error));
        panel = panel.points(points, COLOURS[k % COLOURS.len()], knob);
    }
    let points = study
        .entries
        .iter()
        .filter(|e| e.is_default)
        .map(|e| at(e.seconds, e.error))
        .collect();
    panel = panel.layer(Layer::Points {
        points,
        colour: Colour::RED,
        marker: Marker::Ring,
        radius: 7.0,
        label: "default".into(),
    });
    if !study.peers.is_empty() {
        let peers = study
            .peers
            .iter()
            .map(|(_, seconds, error)| at(*seconds, *error));
        panel = panel.marked(peers, Marker::Cross, Colour::BLACK, "other packages");
    }
    Page::new("").panel_size(760, 520).panel(panel).save(path)
}
