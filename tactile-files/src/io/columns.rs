//! Column headings: names, units, and the names that other programs use for coordinates.

/// Names of x, y and z, the usual one first (DICe, TrackMate, ParaView, scikit-image).
pub(super) const AXES: [&str; 3] = [
    "x coordinate_x position_x points:0 centroid-1 cx xc col column",
    "y coordinate_y position_y points:1 centroid-0 cy yc row",
    "z coordinate_z position_z points:2 centroid-2 cz zc",
];

/// Names of displacements along x, y and z (OpenPIV, finite elements, DICe).
pub(super) const DISPLACEMENTS: [&[&str]; 3] = [
    &["u", "u_x", "ux", "dx", "displacement_x"],
    &["v", "u_y", "uy", "dy", "displacement_y"],
    &["w", "u_z", "uz", "dz", "displacement_z"],
];

/// Names of the frame number in tables of tracked points (TrackMate, trackpy).
pub(super) const FRAME: &[&str] = &["frame", "t"];

/// Other names that mark a comment as a heading.
const USUAL: &str = "u v w depth force load darkness indentation position displacement time pressure \
                     id label pixel_value integrated_pixel_value frame t";

/// A heading, split into its name in lower case and its unit.
pub(super) struct Heading {
    pub name: String,
    pub unit: Option<String>,
}

impl Heading {
    /// Splits `Force (mN)`, `x [µm]`, `depth mm` or `indentation_um` into name and unit.
    pub(super) fn of(text: &str) -> Self {
        let bracketed = || {
            let inside = text.strip_suffix([')', ']'])?;
            inside.rsplit_once(['(', '['])
        };
        let suffixed = || {
            let cuts = text.match_indices(['_', ' ', '/']);
            let mut parts = cuts.map(|(at, _)| (&text[..at], &text[at + 1..]));
            parts.find(|(name, unit)| !name.is_empty() && in_si(unit).is_some())
        };
        // Text in brackets is always a unit. A word after a blank, an underscore or a slash is one
        // only if it is a known unit.
        let (name, unit) = match bracketed().or_else(suffixed) {
            Some((name, unit)) => (name, Some(unit.trim().to_owned())),
            None => (text, None),
        };
        let name = name.trim().trim_end_matches('_').to_lowercase();
        let name = name.strip_suffix(" in").unwrap_or(&name).into();
        Self { name, unit }
    }

    /// Whether the name is a usual one or the unit is known.
    pub(super) fn is_known(&self) -> bool {
        let mut names = AXES
            .into_iter()
            .chain([USUAL])
            .flat_map(str::split_whitespace);
        names.any(|name| name == self.name)
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

/// The base unit of a unit, and its value in SI units. Both signs for micro are `u`.
pub(super) fn in_si(unit: &str) -> Option<(&'static str, f64)> {
    let unit = unit.replace(['µ', 'μ'], "u").replace("/frame", "");
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

/// The headings of x and y, and of z if there is one. They are found by their usual names.
/// Otherwise they are the only headings that differ in nothing but the letter of the axis (`x
/// coordinate`, `Pos. X`, `weighted_centroid_x`).
pub(super) fn axes(headings: &[Heading]) -> Vec<&Heading> {
    let usual = |names: &&str| {
        let mut names = names.split_whitespace();
        names.find_map(|name| headings.iter().find(|heading| heading.name == name))
    };
    let found: Vec<&Heading> = AXES.iter().map_while(usual).collect();
    if found.len() > 1 {
        return found;
    }
    // The words of a heading, with a mark in place of the axis. `None` if no word is the axis.
    let along = |heading: &Heading, axis: &str| {
        let words = heading.name.split(|c: char| !c.is_alphanumeric());
        let words: Vec<&str> = words
            .map(|word| if word == axis { "*" } else { word })
            .collect();
        words.contains(&"*").then(|| words.join(" "))
    };
    let sets = headings.iter().filter_map(|first| {
        let rest = along(first, "x")?;
        let beside = |axis| {
            headings
                .iter()
                .find(|h| along(h, axis).is_some_and(|r| r == rest))
        };
        let set: Vec<&Heading> = ["x", "y", "z"]
            .iter()
            .map_while(|axis| beside(axis))
            .collect();
        Some(set).filter(|set| set.len() > 1)
    });
    let mut sets = sets.collect::<Vec<_>>();
    match sets.len() {
        1 => sets.remove(0),
        _ => Vec::new(),
    }
}
