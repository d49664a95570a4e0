//! A calibration's TOML file, with the images that it names.
use super::{SensorCalibration, SensorPress};
use crate::force::Branch;
use crate::io::{Grey, read_bytes, read_grey_image};
use crate::scene::SceneError;
use crate::scene::SceneLayer;
use crate::scene::fields::{Fields, poisson, positive};
use crate::sensor::error::SensorError;
use crate::sensor::input::{Indenter, LayerInput};
use ndarray::Array2;
use std::path::Path;

impl SensorCalibration {
    /// Reads a calibration file and the images that it names.
    ///
    /// ```toml
    /// date = "2026-11-22"
    /// temperature_c = 22.5                # may be left out
    /// references = ["reference.png"]
    /// pixel_size_m = [21.55e-6, 21.55e-6] # without a target
    /// pixel_size_error = 1e-3             # relative
    /// flat_field = true                   # the default
    /// gauge_error = 1e-3                  # relative, common to all forces
    /// gauge_noise_N = 2e-3
    /// covers_N = [0.1, 1.2]               # forces of later scenes, may be left out
    /// target = { image = "target.png", pitch_m = 1e-3, error = 5e-4 }
    ///
    /// [[presses]]
    /// image = "press_01.png"
    /// force_N = 0.1
    /// branch = "loading"                  # or "unloading"
    /// indenter = { shape = "ball", radius_m = 4e-3, radius_error_m = 5e-6 } # or { shape = "punch", radius_m = 2e-3 }
    ///
    /// [[layers]]                          # from the object's side to the glass
    /// refractive_index = 1.41
    /// thickness_m = 2e-3
    /// thickness_error_m = 20e-6
    /// youngs_modulus_pa = 1.36e5
    /// youngs_modulus_error_pa = 1.4e4
    /// poisson_ratio = 0.5
    /// poisson_ratio_error = 0.0
    /// ```
    ///
    /// # Errors
    /// [`SensorError::File`]: one sentence with file and field.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, SensorError> {
        let path = path.as_ref();
        let bytes = read_bytes(path).map_err(|error| SceneError::Open(Box::new(error)))?;
        let text = String::from_utf8_lossy(&bytes);
        let table = crate::scene::parse_table(&text, path)?;
        Ok(calibration(&Fields::new(path, &table), path)?)
    }
}

fn calibration(fields: &Fields<'_>, file: &Path) -> Result<SensorCalibration, SceneError> {
    fields.only(&[
        "date",
        "temperature_c",
        "references",
        "pixel_size_m",
        "pixel_size_error",
        "flat_field",
        "gauge_error",
        "gauge_noise_N",
        "covers_N",
        "target",
        "presses",
        "layers",
    ])?;
    let images = Images { file };
    let mut references = Vec::new();
    for name in fields.strings("references", "an array of paths of images without contact")? {
        references.push(images.read("references", name)?);
    }
    let shape = references.first().map_or((0, 0), Array2::dim);
    let target = match fields.has("target") {
        true => Some(target(
            &fields.table("target", "a table with `image` and `pitch_m`")?,
            &images,
        )?),
        false => None,
    };
    let pixel_size_m = if target.is_some() && !fields.has("pixel_size_m") {
        [1.0; 2]
    } else {
        fields.positive_pair(
            "pixel_size_m",
            "two positive numbers [x, y] (metres per pixel)",
        )?
    };
    let share = |name: &str, otherwise: f64| {
        let expected = "zero or a positive number (relative)";
        let value = fields.optional_number(name, expected, not_negative)?;
        Ok(value.unwrap_or(otherwise))
    };
    let mut presses = Vec::new();
    for (k, table) in fields
        .tables("presses", "one or more [[presses]] tables with `image`")?
        .iter()
        .enumerate()
    {
        presses.push(press(table, k, &images, shape)?);
    }
    let layers = if fields.has("layers") {
        let tables = fields.tables("layers", "one or more [[layers]] tables")?;
        tables.iter().map(layer).collect::<Result<_, _>>()?
    } else {
        Vec::new()
    };
    Ok(SensorCalibration {
        date: fields
            .string("date", "a date such as \"2026-11-22\"")?
            .into(),
        temperature_c: fields.optional_number(
            "temperature_c",
            "a number (degrees Celsius)",
            f64::is_finite,
        )?,
        references,
        presses,
        target,
        pixel_size_m: (pixel_size_m, share("pixel_size_error", 1e-3)?),
        layers,
        flat_field: fields.optional_flag("flat_field")?.unwrap_or(true),
        gauge_error: share("gauge_error", 1e-3)?,
        gauge_noise_n: fields
            .optional_number("gauge_noise_N", "a positive number (newtons)", positive)?
            .unwrap_or(2e-3),
        shear: None,
        covers_n: match fields.has("covers_N") {
            true => Some(fields.positive_pair(
                "covers_N",
                "two positive numbers [least, greatest] (newtons)",
            )?),
            false => None,
        },
    })
}

/// Where images are named.
struct Images<'a> {
    file: &'a Path,
}

impl Images<'_> {
    fn read(&self, field: &str, name: &str) -> Result<Array2<u8>, SceneError> {
        let path = self.file.parent().unwrap_or(Path::new("")).join(name);
        let image =
            read_grey_image(&path, Grey::default(), None).map_err(|source| SceneError::File {
                file: self.file.into(),
                field: field.into(),
                source: Box::new(source),
            })?;
        Ok(image.to_u8())
    }
}

fn target(fields: &Fields<'_>, images: &Images<'_>) -> Result<(Array2<u8>, f64, f64), SceneError> {
    fields.only(&["image", "pitch_m", "error"])?;
    let name = fields.string("image", "the path of an image of the target")?;
    let pitch_m = fields.number("pitch_m", "a positive number (metres)", positive)?;
    let error = fields.optional_number(
        "error",
        "zero or a positive number (relative)",
        not_negative,
    )?;
    Ok((
        images.read("target.image", name)?,
        pitch_m,
        error.unwrap_or(1e-3),
    ))
}

fn press(
    fields: &Fields<'_>,
    number: usize,
    images: &Images<'_>,
    shape: (usize, usize),
) -> Result<SensorPress, SceneError> {
    const BRANCH: &str = "\"loading\" or \"unloading\"";
    fields.only(&["image", "force_N", "branch", "indenter"])?;
    let name = fields.string("image", "the path of an image")?;
    let field = format!("presses[{}].image", number + 1);
    let frame = images.read(&field, name)?;
    if frame.dim() != shape {
        return Err(SceneError::Value {
            file: images.file.into(),
            field,
            message: format!(
                "the image is {} × {} pixels, but the reference is {} × {}",
                frame.ncols(),
                frame.nrows(),
                shape.1,
                shape.0
            ),
        });
    }
    let branch = match fields.string("branch", BRANCH)? {
        "loading" => Branch::Loading,
        "unloading" => Branch::Unloading,
        other => return Err(fields.wrong("branch", BRANCH, &toml::Value::String(other.into()))),
    };
    Ok(SensorPress {
        frame,
        force_n: fields.number(
            "force_N",
            "zero or a positive number (newtons)",
            not_negative,
        )?,
        branch,
        indenter: indenter(&fields.table("indenter", "a table with `shape` and `radius_m`")?)?,
    })
}

fn indenter(fields: &Fields<'_>) -> Result<Indenter, SceneError> {
    const SHAPE: &str = "\"ball\" or \"punch\"";
    fields.only(&["shape", "radius_m", "radius_error_m"])?;
    let radius_m = fields.number("radius_m", "a positive number (metres)", positive)?;
    match fields.string("shape", SHAPE)? {
        "ball" => Ok(Indenter::Ball {
            radius_m,
            radius_error_m: fields
                .optional_number(
                    "radius_error_m",
                    "zero or a positive number (metres)",
                    not_negative,
                )?
                .unwrap_or(0.0),
        }),
        "punch" => Ok(Indenter::Punch { radius_m }),
        other => Err(fields.wrong("shape", SHAPE, &toml::Value::String(other.into()))),
    }
}

fn layer(fields: &Fields<'_>) -> Result<LayerInput, SceneError> {
    fields.only(&[
        "refractive_index",
        "thickness_m",
        "thickness_error_m",
        "youngs_modulus_pa",
        "youngs_modulus_error_pa",
        "poisson_ratio",
        "poisson_ratio_error",
    ])?;
    let error = |name: &str| {
        let expected = "zero or a positive number, a standard error";
        fields.number(name, expected, not_negative)
    };
    Ok(LayerInput {
        layer: SceneLayer {
            refractive_index: fields.number("refractive_index", "a number of at least 1", |v| {
                v >= 1.0 && v.is_finite()
            })?,
            thickness_m: fields.number("thickness_m", "a positive number (metres)", positive)?,
            youngs_modulus_pa: fields.number(
                "youngs_modulus_pa",
                "a positive number (pascals)",
                positive,
            )?,
            poisson_ratio: fields.number(
                "poisson_ratio",
                "a number above -1, at most 0.5",
                poisson,
            )?,
        },
        thickness_error_m: error("thickness_error_m")?,
        youngs_modulus_error_pa: error("youngs_modulus_error_pa")?,
        poisson_ratio_error: error("poisson_ratio_error")?,
    })
}

fn not_negative(v: f64) -> bool {
    v >= 0.0 && v.is_finite()
}
