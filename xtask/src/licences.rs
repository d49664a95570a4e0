//! The licence of every package that the workspace can depend on against the list in `deny.toml`, without the network.
//!
//! cargo-deny reads the same file and also looks for advisories; it takes longer to install than all other checks take to run, so here
//! only the licences are checked, and the workflow runs cargo-deny itself.

use serde::Deserialize;
use spdx::{Expression, Licensee, ParseMode};
use std::error::Error;
use std::fs;
use std::process::Command;

#[derive(Deserialize)]
struct Configuration {
    licenses: Allowed,
}

#[derive(Deserialize)]
struct Allowed {
    allow: Vec<String>,
}

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    version: String,
    license: Option<String>,
}

/// Names every package whose licence the list does not allow.
///
/// # Errors
/// One sentence: a package is refused, or `cargo metadata` or `deny.toml` cannot be read.
pub(crate) fn check() -> Result<(), Box<dyn Error>> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    let configuration: Configuration =
        toml::from_str(&fs::read_to_string(format!("{root}/deny.toml"))?)?;
    let allowed = configuration
        .licenses
        .allow
        .iter()
        .map(|licence| Licensee::parse(licence))
        .collect::<Result<Vec<_>, _>>()?;
    let packages = packages(root)?;
    let refused: Vec<_> = packages
        .iter()
        .filter(|p| !is_allowed(p, &allowed))
        .collect();
    for package in &refused {
        let licence = package.license.as_deref().unwrap_or("none stated");
        println!(
            "licences: {} {}: {licence} is not on the list in deny.toml",
            package.name, package.version
        );
    }
    println!(
        "licences: {} packages, {} refused",
        packages.len(),
        refused.len()
    );
    if refused.is_empty() {
        Ok(())
    } else {
        Err("a licence is not on the list".into())
    }
}

fn packages(root: &str) -> Result<Vec<Package>, Box<dyn Error>> {
    let output = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--format-version",
            "1",
            "--all-features",
            "--locked",
        ])
        .current_dir(root)
        .output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into());
    }
    Ok(serde_json::from_slice::<Metadata>(&output.stdout)?.packages)
}

/// Whether the SPDX expression of a package can be met from the list. The old form `MIT/Apache-2.0` means OR.
fn is_allowed(package: &Package, allowed: &[Licensee]) -> bool {
    let Some(licence) = &package.license else {
        return false;
    };
    Expression::parse_mode(licence, ParseMode::LAX).is_ok_and(|expression| {
        expression.evaluate(|term| allowed.iter().any(|a| a.satisfies(term)))
    })
}
