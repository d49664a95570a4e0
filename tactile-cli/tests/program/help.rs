//! Every example in the help runs, and its JSON conforms to the schema.
use super::harness::{folder_with_examples, json, printed, words};
use super::json::assert_keeps_to_schema;
use std::collections::BTreeSet;

/// The commands of the examples in a help text, without explanations.
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

/// The subcommands listed in the help.
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

/// Runs an example with JSON output. The lines of text are computed too, but not printed.
fn runs(example: &str) {
    let folder = folder_with_examples();
    let option = if example.contains("--json") {
        ""
    } else {
        " --json"
    };
    let printed = printed(folder.path(), &format!("{example}{option}"));
    let value = json(&printed).unwrap_or_else(|e| panic!("tactile {example}: {e}"));
    assert_keeps_to_schema(&value, example);
    // Files are written only to --out.
    let entries = std::fs::read_dir(folder.path()).unwrap();
    let left: BTreeSet<_> = entries.map(|e| e.unwrap().file_name()).collect();
    let expected = if example.contains("--out") { 2 } else { 1 };
    assert_eq!(left.len(), expected, "tactile {example} leaves {left:?}");
}

/// Other results of the same subcommands.
const OTHER_ANSWERS: [&str; 4] = [
    "measure --ideal-camera",
    "calibrate examples/data/press/calibration.csv --there-and-back",
    "stream examples/data/press/scene.toml --allowed-late 100",
    "depth --reference examples/data/dark_reference.pgm --table examples/data/depth_table.csv \
     --pixel-um 100 examples/data/dark_frame.pgm --ball-radius-mm 4",
];

#[test]
fn every_example_runs_and_its_json_keeps_to_the_schema() {
    let names = subcommands();
    assert!(names.len() >= 12, "{names:?}");
    let first = examples(&help("--help"));
    let shown: BTreeSet<_> = first.iter().map(|example| words(example)[0]).collect();
    assert_eq!(shown.len(), first.len(), "one example for each: {first:?}");
    let mut calls = BTreeSet::from(OTHER_ANSWERS.map(str::to_owned));
    for name in &names {
        assert!(shown.contains(name.as_str()), "no example for {name}");
        let found = examples(&help(&format!("{name} --help")));
        assert!(!found.is_empty(), "the help of {name} shows no example");
        calls.extend(found);
    }
    calls.extend(first.iter().cloned());
    calls.iter().for_each(|example| runs(example));
}
