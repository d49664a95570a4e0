//! No circular use of files: a file does not use itself through the files that it uses.
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Circles that still exist, each as its files. The list may only become shorter.
const LEFT: &[&str] = &[];

/// A path of modules below the root of a crate.
type Module = Vec<String>;

#[test]
fn files_do_not_use_one_another_in_circles() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut packages = vec![("tactile-imaging".to_owned(), root.join("src"))];
    for entry in fs::read_dir(root).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().to_string_lossy().into_owned();
        let source = entry.path().join("src");
        if name.starts_with("tactile-") && source.exists() {
            packages.push((name, source));
        }
    }
    assert!(packages.len() > 10, "{packages:?}");
    let mut found = Vec::new();
    for (name, source) in &packages {
        found.extend(
            Uses::of(source)
                .circles()
                .into_iter()
                .map(|files| format!("{name}: {files}")),
        );
    }
    let new: Vec<_> = (found.iter())
        .filter(|circle| !LEFT.contains(&circle.as_str()))
        .collect();
    assert!(new.is_empty(), "open these circles: {new:#?}");
}

#[test]
fn a_circle_is_found_through_groups_and_reexports() {
    let texts = [
        ("", "mod a;\nmod b;\npub use b::{Far, inner::Near};"),
        ("a", "use crate::{Far, other};"),
        (
            "b",
            "mod inner;\npub(crate) use super::c::{self, deep::{One, Two as Three}};",
        ),
        ("b::inner", "use super::super::b::Far; // use super::d::X;"),
        ("c", "#[cfg(test)]\nmod tests { use crate::b::Far; }"),
        ("d", "use super::a::{Thing};\nuse super::b;"),
    ];
    let uses = |texts: &[(&str, &str)]| {
        Uses::between(
            texts
                .iter()
                .map(|(m, t)| (module(m), (*t).to_owned()))
                .collect(),
        )
    };
    assert_eq!(uses(&texts).circles(), [""; 0]);
    let mut circular = texts;
    circular[4].1 = "use crate::d;";
    assert_eq!(uses(&circular).circles(), ["a, b, c, d"]);
    circular[4].1 = "use super::a::X;";
    assert_eq!(uses(&circular).circles(), ["a, b, c"]);
}

fn module(path: &str) -> Module {
    path.split("::")
        .filter(|name| !name.is_empty())
        .map(str::to_owned)
        .collect()
}

/// The files of a crate that each file uses.
struct Uses(BTreeMap<Module, BTreeSet<Module>>);

impl Uses {
    fn of(source: &Path) -> Self {
        let mut texts = BTreeMap::new();
        let mut folders = vec![source.to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|e| e == "rs") {
                    texts.insert(
                        Self::module_of(source, &path),
                        fs::read_to_string(&path).unwrap(),
                    );
                }
            }
        }
        Self::between(texts)
    }

    fn module_of(source: &Path, file: &Path) -> Module {
        let below: PathBuf = file.strip_prefix(source).unwrap().with_extension("");
        let mut names: Module = (below.iter())
            .map(|name| name.to_string_lossy().into_owned())
            .collect();
        if ["mod", "lib", "main"].contains(&names.last().unwrap().as_str()) {
            names.pop();
        }
        names
    }

    fn between(texts: BTreeMap<Module, String>) -> Self {
        let paths: BTreeMap<&Module, Vec<(bool, Module)>> = (texts.iter())
            .map(|(module, text)| {
                let absolute = used_paths(text)
                    .into_iter()
                    .filter_map(|(visible, path)| Some((visible, absolute(module, path, &texts)?)));
                (module, absolute.collect())
            })
            .collect();
        // A name that a file imports from elsewhere.
        let mut elsewhere = BTreeMap::new();
        for (module, paths) in &paths {
            for (_, path) in paths {
                let mut here = (*module).clone();
                here.extend(path.last().cloned());
                elsewhere.insert(here, path.clone());
            }
        }
        let file_of = |mut path: Module| -> Module {
            // A name passes through few re-exports. The search ends at the file that defines the
            // name.
            for _ in 0..8 {
                let file = (0..=path.len())
                    .rev()
                    .find(|&k| texts.contains_key(&path[..k]))
                    .unwrap_or(0);
                let name = path.get(..=file).and_then(|name| elsewhere.get(name));
                match name {
                    Some(from) if from[..] != path[..=file] => {
                        let rest = path.split_off(file + 1);
                        path = from.iter().cloned().chain(rest).collect();
                    }
                    _ => {
                        path.truncate(file);
                        break;
                    }
                }
            }
            path
        };
        let uses = paths.iter().map(|(module, paths)| {
            let files = paths
                .iter()
                .map(|(visible, path)| (visible, file_of(path.clone())));
            // A folder and its contents count as one: it does not use its files by re-exporting
            // them, and they may use its own items.
            let counts = files.filter(|(visible, file)| {
                let shows = **visible && file.starts_with(module);
                texts.contains_key(file) && !shows && !module.starts_with(file)
            });
            ((*module).clone(), counts.map(|(_, file)| file).collect())
        });
        Self(uses.collect())
    }

    /// All files that can be reached from a file.
    fn reached(&self, from: &Module) -> BTreeSet<&Module> {
        let mut reached = BTreeSet::new();
        let mut next: Vec<&Module> = self.0[from].iter().collect();
        while let Some(file) = next.pop() {
            if reached.insert(file) {
                next.extend(&self.0[file]);
            }
        }
        reached
    }

    /// The files of each circle in alphabetical order.
    fn circles(&self) -> Vec<String> {
        let reached: BTreeMap<_, _> = self.0.keys().map(|f| (f, self.reached(f))).collect();
        let mut circles = BTreeSet::new();
        for (file, below) in reached.iter().filter(|(file, below)| below.contains(*file)) {
            let circle = below
                .iter()
                .filter(|other| reached[**other].contains(*file));
            let names: Vec<_> = circle.map(|names| names.join("::")).collect();
            circles.insert(names.join(", "));
        }
        circles.into_iter().collect()
    }
}

/// The paths of all `use` lines before the tests of a file, and whether they are public.
fn used_paths(text: &str) -> Vec<(bool, Module)> {
    let code: Vec<&str> = (text.split("#[cfg(test)]\nmod ").next().unwrap_or_default())
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect();
    let mut paths = Vec::new();
    for (number, line) in code.iter().enumerate() {
        let visible = line.trim_start().strip_prefix("pub").map(|line| {
            let inside = line.strip_prefix('(').and_then(|line| line.split_once(')'));
            inside.map_or(line, |(_, line)| line)
        });
        let statement = visible.unwrap_or(line).trim_start();
        if let Some(first) = statement.strip_prefix("use ") {
            let tree = format!("{first} {}", code[number + 1..].join(" "));
            let mut tree_paths = Vec::new();
            expand(
                &[],
                tree.split(';').next().unwrap_or_default(),
                &mut tree_paths,
            );
            paths.extend(tree_paths.into_iter().map(|path| (visible.is_some(), path)));
        }
    }
    paths
}

/// The paths of a tree such as `a::{b, c::{d, e as f}}`.
fn expand(before: &[String], tree: &str, paths: &mut Vec<Module>) {
    let (mut depth, mut start) = (0_usize, 0);
    let ends = tree.char_indices().filter(|&(_, c)| {
        depth += usize::from(c == '{');
        depth -= usize::from(c == '}');
        c == ',' && depth == 0
    });
    let ends: Vec<usize> = ends.map(|(i, _)| i).chain([tree.len()]).collect();
    for end in ends {
        let branch = tree[start..end].trim();
        start = end + 1;
        let names = |path: &str| -> Module {
            let path = path.split(" as ").next().unwrap_or_default();
            let names = path.split("::").map(str::trim);
            let names = names.filter(|name| !name.is_empty() && *name != "self");
            before
                .iter()
                .cloned()
                .chain(names.map(str::to_owned))
                .collect()
        };
        match branch.split_once('{') {
            Some((path, rest)) => {
                let inside = rest.strip_suffix('}').unwrap_or(rest);
                expand(&names(path), inside, paths);
            }
            None if branch.is_empty() => {}
            None => paths.push(names(branch)),
        }
    }
}

/// A path from the root of the crate. `None` for another crate.
fn absolute(module: &Module, path: Module, texts: &BTreeMap<Module, String>) -> Option<Module> {
    let mut names = path.into_iter().peekable();
    let mut base = match names.peek()?.as_str() {
        "crate" => {
            names.next();
            Vec::new()
        }
        "super" => module.clone(),
        first => {
            let mut inside = module.clone();
            inside.push(first.to_owned());
            texts.contains_key(&inside).then(|| module.clone())?
        }
    };
    while names.next_if(|name| name == "super").is_some() {
        base.pop();
    }
    base.extend(names);
    Some(base)
}
