//! The `[stages]` table: stages by name.
use super::SceneError;
use super::fields::Fields;
use crate::pipeline::{
    EstimatorChoice, IntegratorChoice, MatcherChoice, ReconstructionChoice, SamplerChoice,
    StagesConfig, StrainChoice, UnknownStage, WarpChoice,
};
use std::str::FromStr;

pub fn read(scene: &Fields<'_>) -> Result<StagesConfig, SceneError> {
    if !scene.has("stages") {
        return Ok(StagesConfig::default());
    }
    let fields = scene.table("stages", "a table of stages by name")?;
    fields.only(&[
        "reconstruction",
        "integrator",
        "sampler",
        "matcher",
        "warp",
        "strain",
        "estimator",
    ])?;
    let depth_table =
        scene.has("calibration") && scene.table("calibration", "a table")?.has("depth_table");
    for (name, expected) in [
        ("reconstruction", ReconstructionChoice::EXPECTED),
        ("integrator", IntegratorChoice::EXPECTED),
    ] {
        if depth_table && fields.has(name) {
            let given = toml::Value::String(fields.string(name, expected)?.into());
            let absent = "absent: the depth table makes the surface";
            return Err(fields.wrong(name, absent, &given));
        }
    }
    let reconstruction = choice(&fields, "reconstruction", ReconstructionChoice::EXPECTED)?;
    let integrator: IntegratorChoice = choice(&fields, "integrator", IntegratorChoice::EXPECTED)?;
    if integrator != IntegratorChoice::default()
        && reconstruction != ReconstructionChoice::BrooksHorn
    {
        let given = toml::Value::String(integrator.name().into());
        let absent = "absent: of the reconstructions \"brooks-horn\" alone has slopes to integrate";
        return Err(fields.wrong("integrator", absent, &given));
    }
    Ok(StagesConfig {
        reconstruction,
        integrator,
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
