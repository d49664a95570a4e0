//! Case files of point matching, and the result files that answer them.
//!
//! [`read_cases`] describes a case. A result starts with a line `case NAME time_ms`. For every
//! model row it has a line `w` (the warped position) and a line `a` (the assigned target row, −1
//! for none).
use super::error::{FileError, FilePlace, quoted};
use super::files::read_bytes;
use super::kinds::kind_of;
use nalgebra::{Point, Point2, Point3};
use std::io::Write;
use std::path::Path;

/// The two point sets of a case, in the plane or in space.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::{CasePoints, read_cases};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("two.txt");
/// let text = b"case flat 2 1 1\nm 0 1\nt 0.5 1\ncase solid 3 1 1\nm 0 1 2\nt 0 1 2.5\n";
/// std::fs::write(&path, text)?;
/// let moved = read_cases(&path)?.into_iter().map(|case| match case.points {
///     CasePoints::Plane { model, target } => (target[0] - model[0]).norm(),
///     CasePoints::Space { model, target } => (target[0] - model[0]).norm(),
/// });
/// assert_eq!(moved.collect::<Vec<_>>(), [0.5, 0.5]);
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum CasePoints {
    /// Two coordinates per point.
    Plane {
        /// The model points, which are warped.
        model: Vec<Point2<f64>>,
        /// The target points, which stay.
        target: Vec<Point2<f64>>,
    },
    /// Three coordinates per point.
    Space {
        /// The model points, which are warped.
        model: Vec<Point3<f64>>,
        /// The target points, which stay.
        target: Vec<Point3<f64>>,
    },
}

/// One matching problem with its name.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::{CasePoints, MatchCase, read_cases};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("shift.txt");
/// std::fs::write(&path, "case shift 2 1 1\nm 0 1\nt 0.5 1\n")?;
/// let (model, target) = (vec![[0.0, 1.0].into()], vec![[0.5, 1.0].into()]);
/// let points = CasePoints::Plane { model, target };
/// assert_eq!(read_cases(&path)?, [MatchCase { name: "shift".into(), points }]);
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MatchCase {
    /// The name, which is one word.
    pub name: String,
    /// The two point sets.
    pub points: CasePoints,
}

/// Reads all cases of a file.
///
/// A case is a line `case NAME D n_model n_target`, then rows `m` (a model point) and `t` (a target
/// point). Rows `g` and `p`, which hold the true answer for a scorer, are skipped.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_files::io::{CasePoints, read_cases};
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("cases.txt");
/// std::fs::write(&path, "case shift 2 2 1\nm 0 1\nm 2 3\nt 0.5 1\n")?;
/// let cases = read_cases(&path)?;
/// let CasePoints::Plane { model, target } = &cases[0].points else { unreachable!() };
/// assert_eq!((cases[0].name.as_str(), model.len(), target.len()), ("shift", 2, 1));
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`FileError`] with file and line if a row has another format, or if the counts differ from the
/// header.
pub fn read_cases(path: impl AsRef<Path>) -> Result<Vec<MatchCase>, FileError> {
    let path = path.as_ref();
    let bytes = read_bytes(path)?;
    let header = "`case NAME D n_model n_target`";
    if let Some(kind) = kind_of(&bytes) {
        let expected = "a text of matching cases, or two tables of points";
        return Err(FileError::content(path, FilePlace::File, expected, kind));
    }
    let mut cases = Vec::new();
    let mut open: Option<OpenCase<'_>> = None;
    for (line, text) in (1..).zip(String::from_utf8_lossy(&bytes).lines()) {
        let row = Row { path, line };
        let mut words = text.split_ascii_whitespace();
        match (words.next(), &mut open) {
            (None, _) => {}
            (Some(word), _) if word.starts_with('#') => {}
            (Some("case"), open) => {
                // A case ends where the next begins.
                cases.extend(open.take().map(OpenCase::close).transpose()?);
                let words: Vec<_> = words.collect();
                let &[name, dimension, n_model, n_target] = words.as_slice() else {
                    return Err(row.error(header, format!("{} words", words.len() + 1)));
                };
                if dimension != "2" && dimension != "3" {
                    return Err(row.word(3, "dimension 2 or 3", dimension));
                }
                let count = |column: usize, word: &str| {
                    let count = word.parse::<usize>();
                    count.map_err(|_| row.word(column, "a whole number", word))
                };
                *open = Some(OpenCase {
                    row,
                    name: name.into(),
                    dimension: count(3, dimension)?,
                    counts: [count(4, n_model)?, count(5, n_target)?],
                    sets: [Vec::new(), Vec::new()],
                });
            }
            (Some("m"), Some(case)) => case.sets[0].push(row.point(words, case.dimension)?),
            (Some("t"), Some(case)) => case.sets[1].push(row.point(words, case.dimension)?),
            (Some("g" | "p"), Some(_)) => {}
            (Some(word), Some(_)) => {
                return Err(row.word(1, "a row that starts with case, m, t, g or p", word));
            }
            (Some(word), None) => return Err(row.word(1, header, word)),
        }
    }
    cases.extend(open.map(OpenCase::close).transpose()?);
    // A file without a case is more likely the wrong file than an empty list.
    if cases.is_empty() {
        return Err(FileError::content(path, FilePlace::File, header, "none"));
    }
    Ok(cases)
}

/// Writes the result of one case.
///
/// # Errors
/// The errors of the writer.
///
/// # Panics
/// If `warped` and `assignment` differ in length.
pub fn write_case_result<const D: usize>(
    out: &mut impl Write,
    name: &str,
    time_ms: f64,
    warped: &[Point<f64, D>],
    assignment: &[Option<usize>],
) -> std::io::Result<()> {
    assert_eq!(
        warped.len(),
        assignment.len(),
        "one assignment for every warped point"
    );
    writeln!(out, "case {name} {time_ms:?}")?;
    for p in warped {
        write!(out, "w")?;
        p.iter().try_for_each(|v| write!(out, " {v:?}"))?;
        writeln!(out)?;
    }
    assignment.iter().try_for_each(|a| match a {
        Some(row) => writeln!(out, "a {row}"),
        None => writeln!(out, "a -1"),
    })
}

/// A row of a file, for errors.
#[derive(Clone, Copy)]
struct Row<'a> {
    path: &'a Path,
    line: u64,
}

impl Row<'_> {
    fn word(self, column: usize, expected: &str, found: &str) -> FileError {
        let line = self.line;
        let found = format!("`{}`", quoted(found, 40));
        FileError::content(self.path, FilePlace::Cell { line, column }, expected, found)
    }

    fn error(self, expected: impl Into<String>, found: impl Into<String>) -> FileError {
        FileError::content(self.path, FilePlace::Line(self.line), expected, found)
    }

    /// The coordinates after a tag. The third is zero in the plane.
    fn point<'w>(
        self,
        words: impl Iterator<Item = &'w str>,
        dimension: usize,
    ) -> Result<[f64; 3], FileError> {
        let (mut point, mut found) = ([0.0; 3], 0);
        for word in words {
            let value = word.parse().ok().filter(|v: &f64| v.is_finite());
            let value = value.ok_or_else(|| self.word(found + 2, "a finite number", word))?;
            // Surplus coordinates are counted for the error message but not stored.
            if found < dimension {
                point[found] = value;
            }
            found += 1;
        }
        if found != dimension {
            let expected = format!("{} columns", dimension + 1);
            return Err(self.error(expected, (found + 1).to_string()));
        }
        Ok(point)
    }
}

/// A case whose rows are being read.
struct OpenCase<'a> {
    row: Row<'a>,
    name: String,
    dimension: usize,
    counts: [usize; 2],
    sets: [Vec<[f64; 3]>; 2],
}

impl OpenCase<'_> {
    fn close(self) -> Result<MatchCase, FileError> {
        for (k, tag) in ["m", "t"].into_iter().enumerate() {
            if self.counts[k] != self.sets[k].len() {
                let expected = format!("{} rows tagged {tag}", self.counts[k]);
                return Err(self.row.error(expected, self.sets[k].len().to_string()));
            }
        }
        let points = if self.dimension == 2 {
            let plane = |set: Vec<_>| set.iter().map(|p: &[f64; 3]| [p[0], p[1]].into()).collect();
            let [model, target] = self.sets.map(plane);
            CasePoints::Plane { model, target }
        } else {
            let space = |set: Vec<[f64; 3]>| set.into_iter().map(Point3::from).collect();
            let [model, target] = self.sets.map(space);
            CasePoints::Space { model, target }
        };
        Ok(MatchCase {
            name: self.name,
            points,
        })
    }
}
