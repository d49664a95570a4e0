//! The map of the workspace names existing files and every equation of the paper.
use std::path::Path;
use tactile_imaging::pipeline::Assumption;

#[test]
fn every_path_of_the_map_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let map = std::fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap();
    let quoted = map.split('`').skip(1).step_by(2);
    let is_path = |text: &&str| {
        (text.contains('/') || text.ends_with(".md")) && !text.contains(char::is_whitespace)
    };
    let paths: Vec<&str> = quoted.filter(is_path).collect();
    // Without its backticks the map would name no files.
    assert!(paths.len() > 40, "{} paths", paths.len());
    let missing: Vec<_> = paths.iter().filter(|p| !root.join(p).exists()).collect();
    assert!(missing.is_empty(), "{missing:#?}");
}

#[test]
fn every_equation_of_the_paper_has_its_file() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let map = std::fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap();
    let mut found = Vec::new();
    for row in map.lines().filter(|line| line.starts_with("| (")) {
        let equations = row.split('|').nth(1).unwrap_or_default();
        let numbers: Vec<usize> = (equations.split(|c: char| !c.is_ascii_digit()))
            .filter_map(|digits| digits.parse().ok())
            .collect();
        // "(9)–(12)" is a range, "(7), (8)" a list.
        match numbers[..] {
            [first, last] if equations.contains('–') => found.extend(first..=last),
            _ => found.extend(numbers),
        }
        assert!(row.contains(".rs`") || row.contains("/`"), "no file: {row}");
    }
    assert_eq!(found, (1..=31).collect::<Vec<_>>());
}

/// The documentation of scene files lists every assumed error with its default.
#[test]
fn every_assumption_is_documented_with_its_default() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("tactile-files/src/scene/mod.rs")).unwrap();
    let (_, table) = text
        .split_once("Errors that are not stated are assumed")
        .unwrap();
    for assumption in Assumption::ALL {
        let default = match assumption.unit.starts_with("of ") {
            true => format!("{} %", (1000.0 * assumption.default).round() / 10.0),
            false => assumption.default.to_string(),
        };
        let rest = table.split_once(assumption.key).unwrap().1;
        let said = rest.split_once("if absent").unwrap().0;
        assert!(said.contains(&default), "{assumption:?}: {said}");
    }
}
