//! Every example in the help runs as it stands.
use super::harness::{folder_with_examples, printed, words};
use super::json::assert_keeps_to_schema;
use std::collections::BTreeSet;

/// The commands of a help's examples, without what explains them.
fn examples(help: &str) -> Vec<String> {
    let lines = help
        .lines()
        .filter_map(|line| line.strip_prefix("  tactile "));
    lines
        .map(|line| line.split("   ").next().unwrap_or(line).to_owned())
        .collect()
}

fn help(arguments: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    printed(folder.path(), arguments)
}

/// The subcommands that the help lists.
fn subcommands() -> Vec<String> {
    let help = help("--help");
    let list = help.split("Commands:").nth(1).expect("a list of commands");
    let lines = list
        .lines()
        .skip(1)
        .take_while(|line| line.starts_with("  "));
    let names = lines.filter_map(|line| line.split_whitespace().next());
    names
        .filter(|name| *name != "help")
        .map(Into::into)
        .collect()
}

fn runs(example: &str) {
    let folder = folder_with_examples();
    let printed = printed(folder.path(), example);
    assert!(!printed.is_empty(), "tactile {example} prints nothing");
    // Files go to --out and nowhere else.
    let entries = std::fs::read_dir(folder.path()).unwrap();
    let left: BTreeSet<_> = entries.map(|e| e.unwrap().file_name()).collect();
    let expected = if example.contains("--out") { 2 } else { 1 };
    assert_eq!(left.len(), expected, "tactile {example} leaves {left:?}");
}

#[test]
fn every_example_of_every_subcommand_runs() {
    let names = subcommands();
    assert!(names.len() >= 12, "{names:?}");
    for name in names {
        let found = examples(&help(&format!("{name} --help")));
        assert!(!found.is_empty(), "the help of {name} shows no example");
        found.iter().for_each(|example| runs(example));
    }
}

#[test]
fn the_first_help_shows_one_example_for_each_subcommand() {
    let shown = examples(&help("--help"));
    let names: Vec<_> = shown.iter().map(|example| words(example)[0]).collect();
    // The next test runs them.
    let distinct: BTreeSet<_> = names.iter().copied().collect();
    assert_eq!(distinct.len(), names.len(), "{names:?}");
    for name in subcommands() {
        assert!(distinct.contains(name.as_str()), "no example for {name}");
    }
}

const OTHER_ANSWERS: [&str; 4] = [
    "measure --ideal-camera",
    "calibrate examples/data/press/calibration.csv --there-and-back",
    "stream examples/data/press/scene.toml --allowed-late 100",
    "depth --reference examples/data/dark_reference.pgm --table examples/data/depth_table.csv \
     --pixel-um 100 examples/data/dark_frame.pgm --ball-radius-mm 4",
];

#[test]
fn json_of_every_example_keeps_to_the_schema() {
    let folder = folder_with_examples();
    let mut calls = examples(&help("--help"));
    // Other answers of the same subcommands.
    calls.extend(OTHER_ANSWERS.map(str::to_owned));
    for example in calls {
        let printed = printed(folder.path(), &format!("{example} --json"));
        let value: serde_json::Value =
            serde_json::from_str(&printed).unwrap_or_else(|e| panic!("tactile {example}: {e}"));
        assert_keeps_to_schema(&value, &example);
    }
}
