//! The tables of a scene file, each read and checked.
use super::fields::{Fields, poisson, positive};
use super::{CalibrationSource, SceneError, SceneFrame, SceneLayer};
use crate::pipeline::Object;
use std::path::{Path, PathBuf};

/// What may stand at the top of a scene file.
pub(super) const FIELDS: [&str; 12] = [
    "reference",
    "sensor",
    "pixel_size_m",
    "flat_field",
    "illumination_drift",
    "bits",
    "calibration",
    "frames",
    "object",
    "waveguide",
    "contact_table",
    "stages",
];

/// The name of the sensor file. What it stands for must not be there beside it.
pub fn sensor<'a>(fields: &Fields<'a>) -> Result<Option<&'a str>, SceneError> {
    if !fields.has("sensor") {
        return Ok(None);
    }
    let name = fields.string("sensor", "the path of a sensor file")?;
    for field in ["pixel_size_m", "flat_field", "calibration", "waveguide"] {
        if fields.has(field) {
            let given = toml::Value::String("a value beside `sensor`".into());
            return Err(fields.wrong(field, "absent: the sensor file has it", &given));
        }
    }
    Ok(Some(name))
}

/// Whether changes of the lamps are divided out, where the scene says so.
pub fn corrects_drift(fields: &Fields<'_>) -> Result<Option<bool>, SceneError> {
    let field = "illumination_drift";
    let expected = "\"automatic\" or \"none\"";
    if !fields.has(field) {
        return Ok(None);
    }
    match fields.string(field, expected)? {
        "automatic" => Ok(Some(true)),
        "none" => Ok(Some(false)),
        other => Err(fields.wrong(field, expected, &toml::Value::String(other.into()))),
    }
}

/// Standard errors of the object's radius and Poisson ratio.
pub fn object_errors(fields: &Fields<'_>) -> Result<[f64; 2], SceneError> {
    let fields = fields.table("object", "a table with `shape`")?;
    let not_negative = |v: f64| v >= 0.0 && v.is_finite();
    let error = |name: &str, expected| {
        let error = fields.optional_number(name, expected, not_negative)?;
        Ok(error.unwrap_or(0.0))
    };
    Ok([
        error("radius_error_m", "zero or a positive number (metres)")?,
        error("poisson_ratio_error", "zero or a positive number")?,
    ])
}

pub fn flat_field(fields: &Fields<'_>) -> Result<bool, SceneError> {
    let expected = "\"reference\", or absent for no correction";
    if !fields.has("flat_field") {
        return Ok(false);
    }
    match fields.string("flat_field", expected)? {
        "reference" => Ok(true),
        other => Err(fields.wrong("flat_field", expected, &toml::Value::String(other.into()))),
    }
}

pub fn bits(fields: &Fields<'_>) -> Result<Option<u8>, SceneError> {
    let expected = "a whole number from 8 to 16, the bits of the camera";
    let accept = |bits: f64| (8.0..=16.0).contains(&bits) && bits.fract() == 0.0;
    let bits = fields.optional_number("bits", expected, accept)?;
    Ok(bits.map(|bits| bits as u8))
}

pub fn calibration(
    fields: &Fields<'_>,
    folder: &Path,
    gauged: bool,
) -> Result<CalibrationSource, SceneError> {
    let expected = "a table with `pairs` or `depth_table`, or `force_N` in every frame";
    if gauged && !fields.has("calibration") {
        return Ok(CalibrationSource::Gauge);
    }
    let fields = fields.table("calibration", expected)?;
    fields.only(&["pairs", "depth_table"])?;
    match (fields.has("pairs"), fields.has("depth_table")) {
        (true, false) => {
            let path = fields.string(
                "pairs",
                "the path of a CSV file (integrated_pixel_value,force_N)",
            )?;
            Ok(CalibrationSource::Pairs(folder.join(path)))
        }
        (false, true) => {
            let path = fields.string(
                "depth_table",
                "the path of a CSV file (darkness_grey_levels,depth_mm)",
            )?;
            Ok(CalibrationSource::DepthTable(folder.join(path)))
        }
        (false, false) => {
            Err(fields.missing("pairs", "`pairs` or `depth_table`, the path of a CSV file"))
        }
        (true, true) => {
            let both = toml::Value::String("both".into());
            Err(fields.wrong("pairs", "alone: give `pairs` or `depth_table`", &both))
        }
    }
}

pub fn frames(fields: &Fields<'_>, folder: &Path) -> Result<Vec<SceneFrame>, SceneError> {
    let tables = fields.tables("frames", "one or more [[frames]] tables with `image`")?;
    let mut last_s = 0.0;
    let mut frame = |f: &Fields<'_>| {
        f.only(&["image", "force_N", "force_error_N", "time_s"])?;
        let image = folder.join(f.string("image", "the path of an image")?);
        let force_n = f.optional_number("force_N", "a positive number (newtons)", positive)?;
        let not_negative = |v: f64| v >= 0.0 && v.is_finite();
        let force_error_n = f.optional_number(
            "force_error_N",
            "zero or a positive number (newtons)",
            not_negative,
        )?;
        let time_s = f.optional_number(
            "time_s",
            "zero or a positive number (seconds)",
            not_negative,
        )?;
        if let Some(found) = time_s {
            if found < last_s {
                let reason = format!("{found} s is before the frame that it follows ({last_s} s)");
                return Err(f.unusable("time_s", &reason));
            }
            last_s = found;
        }
        Ok(SceneFrame {
            image,
            force_n,
            force_error_n,
            time_s,
        })
    };
    tables.iter().map(&mut frame).collect()
}

pub fn contact_table(fields: &Fields<'_>, folder: &Path) -> Result<Option<PathBuf>, SceneError> {
    if !fields.has("contact_table") {
        return Ok(None);
    }
    let path = fields.string("contact_table", "the path of a contact table (TOML)")?;
    Ok(Some(folder.join(path)))
}

pub fn object(fields: &Fields<'_>) -> Result<Object, SceneError> {
    const SHAPE: &str =
        "\"sphere\", \"block\", \"cylinder\", \"flat_punch\", \"layer\", \"cone\" or \"unknown\"";
    let fields = fields.table("object", "a table with `shape`")?;
    fields.only(&[
        "shape",
        "radius_m",
        "thickness_m",
        "half_angle_rad",
        "poisson_ratio",
        "radius_error_m",
        "poisson_ratio_error",
    ])?;
    let shape = fields.string("shape", SHAPE)?;
    let poisson_ratio = fields
        .optional_number("poisson_ratio", "a number above -1, at most 0.5", poisson)?
        .unwrap_or(Object::DEFAULT_POISSON_RATIO);
    let radius = || fields.number("radius_m", "a positive number (metres)", positive);
    match shape {
        "sphere" => Ok(Object::Sphere {
            radius_m: radius()?,
            poisson_ratio,
        }),
        "flat_punch" => Ok(Object::FlatPunch {
            radius_m: radius()?,
            poisson_ratio,
        }),
        "layer" => Ok(Object::Layer {
            indenter_radius_m: radius()?,
            thickness_m: fields.number("thickness_m", "a positive number (metres)", positive)?,
            poisson_ratio,
        }),
        "cone" => Ok(Object::Cone {
            half_angle_rad: fields.number(
                "half_angle_rad",
                "a number between 0 and π/2 (radians)",
                |v| v > 0.0 && v < std::f64::consts::FRAC_PI_2,
            )?,
            poisson_ratio,
        }),
        "block" => Ok(Object::Block { poisson_ratio }),
        "cylinder" => Ok(Object::Cylinder { poisson_ratio }),
        "unknown" => {
            let _ = fields.optional_number("radius_m", "a positive number (metres)", positive)?;
            Ok(Object::Unknown { poisson_ratio })
        }
        other => Err(fields.wrong("shape", SHAPE, &toml::Value::String(other.into()))),
    }
}

pub fn layers(fields: &Fields<'_>) -> Result<Vec<SceneLayer>, SceneError> {
    let expected = "a table with `layers`, or \"rigid\" (as where it is absent)";
    if !fields.has("waveguide")
        || fields
            .string("waveguide", expected)
            .is_ok_and(|s| s == "rigid")
    {
        return Ok(Vec::new());
    }
    let fields = fields.table("waveguide", expected)?;
    fields.only(&["layers"])?;
    let tables = fields.tables(
        "layers",
        "an array of one or more tables, from the object's side to the glass",
    )?;
    let layer = |f: &Fields<'_>| {
        f.only(&[
            "refractive_index",
            "thickness_m",
            "youngs_modulus_pa",
            "poisson_ratio",
        ])?;
        Ok(SceneLayer {
            refractive_index: f.number("refractive_index", "a number of at least 1", |v| {
                v >= 1.0 && v.is_finite()
            })?,
            thickness_m: f.number("thickness_m", "a positive number (metres)", positive)?,
            youngs_modulus_pa: f.number(
                "youngs_modulus_pa",
                "a positive number (pascals)",
                positive,
            )?,
            poisson_ratio: f
                .optional_number("poisson_ratio", "a number above -1, at most 0.5", poisson)?
                .unwrap_or(0.5),
        })
    };
    tables.iter().map(layer).collect()
}
