//! The guide lists every kind of caution with a remedy.

use std::path::Path;

/// The variants of an enum as named in JSON, read from its source.
fn kinds<'a>(source: &'a str, name: &str) -> impl Iterator<Item = String> + 'a {
    let (_, rest) = source
        .split_once(&format!("pub enum {name} {{"))
        .expect(name);
    let (body, _) = rest.split_once("\n}").expect("an end");
    let variants = body.lines().filter_map(|line| line.strip_prefix("    "));
    let variants = variants.filter(|line| line.starts_with(|c: char| c.is_ascii_uppercase()));
    variants.map(|line| {
        let word = line.split(|c: char| !c.is_alphanumeric()).next().unwrap();
        let snake = word.chars().flat_map(|c| {
            let bar = c.is_ascii_uppercase().then_some('_');
            bar.into_iter().chain(c.to_lowercase())
        });
        snake.skip(1).collect()
    })
}

/// The kinds that a function `kind` returns.
fn words(source: &str) -> impl Iterator<Item = String> + '_ {
    let (_, rest) = source.split_once("pub fn kind").expect("a kind");
    let (body, _) = rest.split_once("\n    }").expect("an end");
    let quoted = body.split('"').skip(1).step_by(2);
    quoted.map(str::to_owned)
}

/// The kinds of cautions of the program itself, read from its sources.
fn printed(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let found = entries.flat_map(|path| {
        if path.is_dir() {
            return printed(&path);
        }
        let source = std::fs::read_to_string(&path).unwrap();
        let calls = source.split(".warn(").skip(1);
        let first = calls.filter_map(|call| call.trim_start().strip_prefix('"')?.split('"').next());
        first.map(str::to_owned).collect()
    });
    found.collect()
}

#[test]
fn the_guide_has_a_remedy_for_every_kind_of_caution() {
    let page = include_str!("../../docs/cautions.md");
    let flags = kinds(include_str!("../../src/pipeline/flag.rs"), "Flag");
    let warning = include_str!("../../tactile-elasticity/src/modulus/warning.rs");
    let inclusion = include_str!("../../tactile-inclusion/src/estimate.rs");
    let listed = flags
        .filter(|kind| kind != "assumption")
        .chain(kinds(warning, "Warning"))
        .chain(kinds(inclusion, "InclusionWarning"))
        .chain(words(include_str!("../../tactile-gel/src/frame_check.rs")))
        .chain(words(include_str!("../../tactile-gel/src/calibration.rs")))
        .chain(printed(
            &Path::new(env!("CARGO_MANIFEST_DIR")).join("tactile-cli/src"),
        ));
    let mut count = 0;
    for kind in listed {
        let row = page
            .lines()
            .find(|line| line.starts_with(&format!("| `{kind}` |")));
        let remedy = row.and_then(|row| row.trim_end_matches(" |").rsplit(" | ").next());
        assert!(remedy.is_some_and(|r| r.ends_with('.')), "{kind}: {row:?}");
        count += 1;
    }
    assert!(count > 50, "{count}");
}
