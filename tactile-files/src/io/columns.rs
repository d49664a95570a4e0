//! Headings of columns: their names, their units, and the names that programs give to coordinates.

/// Names of x, y and z, the usual one first: DICe, TrackMate, ParaView, scikit-image.
pub(super) const AXES: [&[&str]; 3] = [
    &[
        "x",
        "coordinate_x",
        "position_x",
        "points:0",
        "pos_x",
        "centroid-1",
    ],
    &[
        "y",
        "coordinate_y",
        "position_y",
        "points:1",
        "pos_y",
        "centroid-0",
    ],
    &["z", "coordinate_z", "position_z", "points:2", "pos_z"],
];

/// Names of displacements along x, y and z (OpenPIV, finite elements, DICe).
pub(super) const DISPLACEMENTS: [&[&str]; 3] = [
    &["u", "u_x", "ux", "displacement_x"],
    &["v", "u_y", "uy", "displacement_y"],
    &["w", "u_z", "uz", "displacement_z"],
];

/// Names of a frame's number in tables of tracked points (TrackMate, trackpy).
pub(super) const FRAME: &[&str] = &["frame", "t"];

/// Other names by which a comment is known as a heading.
const USUAL: [&str; 16] = [
    "u",
    "v",
    "w",
    "depth",
    "force",
    "load",
    "darkness",
    "indentation",
    "position",
    "displacement",
    "time",
    "pressure",
    "id",
    "label",
    "pixel_value",
    "integrated_pixel_value",
];

/// A heading cut into its name, in lower case, and its unit.
pub(super) struct Heading {
    pub name: String,
    pub unit: Option<String>,
}

impl Heading {
    /// Cuts `Force (mN)`, `x [µm]`, `depth mm` or `indentation_um` into name and unit.
    pub(super) fn of(text: &str) -> Self {
        let bracketed = || {
            let inside = text.strip_suffix([')', ']'])?;
            inside.rsplit_once(['(', '['])
        };
        let suffixed = || {
            let cuts = text.match_indices(['_', ' ']);
            let mut parts = cuts.map(|(at, _)| (&text[..at], &text[at + 1..]));
            parts.find(|(name, unit)| !name.is_empty() && in_si(unit).is_some())
        };
        // Whatever stands in brackets is meant as a unit, a word after a blank or a line only if it
        // is one.
        let (name, unit) = match bracketed().or_else(suffixed) {
            Some((name, unit)) => (name, Some(unit.trim().to_owned())),
            None => (text, None),
        };
        let name = name.trim().trim_end_matches('_').to_lowercase();
        Self { name, unit }
    }

    /// Whether it is a usual name of a column, or has a known unit.
    pub(super) fn is_known(&self) -> bool {
        let mut names = AXES.iter().chain([&FRAME]).copied().flatten().chain(&USUAL);
        names.any(|name| *name == self.name)
            || self
                .unit
                .as_deref()
                .is_some_and(|unit| in_si(unit).is_some())
    }

    pub(super) fn is_in_pixels(&self) -> bool {
        let unit = self.unit.as_deref().and_then(in_si);
        unit.is_some_and(|(base, _)| base == "1")
    }
}

/// The base unit and the value in SI of a unit. Both signs for micro are `u`.
pub(super) fn in_si(unit: &str) -> Option<(&'static str, f64)> {
    let unit = unit.replace(['µ', 'μ'], "u");
    match unit.as_str() {
        "px" | "pixel" | "pixels" | "grey_levels" | "1" => return Some(("1", 1.0)),
        "micron" | "microns" => return Some(("m", 1e-6)),
        _ => {}
    }
    ["m", "N", "Pa", "s"].into_iter().find_map(|base| {
        let factor = match unit.strip_suffix(base)? {
            "n" => 1e-9,
            "u" => 1e-6,
            "m" => 1e-3,
            "c" => 1e-2,
            "" => 1.0,
            "k" => 1e3,
            "M" => 1e6,
            "G" => 1e9,
            _ => return None,
        };
        Some((base, factor))
    })
}
