//! The `[stages]` table: stages by name.
use super::SceneError;
use super::fields::Fields;
use crate::pipeline::{
    EstimatorChoice, MatcherChoice, ReconstructionChoice, SamplerChoice, StagesConfig,
    StrainChoice, UnknownStage, WarpChoice,
};
use std::str::FromStr;

pub(super) fn read(scene: &Fields<'_>) -> Result<StagesConfig, SceneError> {
    if !scene.has("stages") {
        return Ok(StagesConfig::default());
    }
    let fields = scene.table("stages", "a table of stages by name")?;
    fields.only(&[
        "reconstruction",
        "sampler",
        "matcher",
        "warp",
        "strain",
        "estimator",
    ])?;
    let depth_table =
        scene.has("calibration") && scene.table("calibration", "a table")?.has("depth_table");
    if fields.has("reconstruction") && depth_table {
        let given = toml::Value::String(
            fields
                .string("reconstruction", ReconstructionChoice::EXPECTED)?
                .into(),
        );
        return Err(fields.wrong(
            "reconstruction",
            "absent: the depth table makes the surface",
            &given,
        ));
    }
    Ok(StagesConfig {
        reconstruction: choice(&fields, "reconstruction", ReconstructionChoice::EXPECTED)?,
        sampler: choice(&fields, "sampler", SamplerChoice::EXPECTED)?,
        matcher: choice(&fields, "matcher", MatcherChoice::EXPECTED)?,
        warp: choice(&fields, "warp", WarpChoice::EXPECTED)?,
        strain: choice(&fields, "strain", StrainChoice::EXPECTED)?,
        estimator: choice(&fields, "estimator", EstimatorChoice::EXPECTED)?,
    })
}

fn choice<C: FromStr<Err = UnknownStage> + Default>(
    fields: &Fields<'_>,
    name: &str,
    expected: &'static str,
) -> Result<C, SceneError> {
    if !fields.has(name) {
        return Ok(C::default());
    }
    let text = fields.string(name, expected)?;
    text.parse()
        .map_err(|_: UnknownStage| fields.wrong(name, expected, &toml::Value::String(text.into())))
}
