//! Case files of point matching, and the result files that answer them.
//!
//! A case is a line `case NAME D n_model n_target`, then rows `m` (a model point) and `t` (a target point). Rows `g` and
//! `p`, which hold the truth for a scorer, are passed over unread. A result is a line `case NAME time_ms`, then for every
//! model row a line `w` (its warped position) and a line `a` (the target row assigned to it, −1 for none).
use super::error::{Expected, ReadError, shorten};
use super::files::read_bytes;
use nalgebra::{Point, Point2, Point3};
use std::io::Write;
use std::path::Path;

/// The two point sets of a case, in the plane or in space.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{CasePoints, read_cases};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("two.txt");
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
    /// Two coordinates a point.
    Plane {
        /// The points that move.
        model: Vec<Point2<f64>>,
        /// The points to be met.
        target: Vec<Point2<f64>>,
    },
    /// Three coordinates a point.
    Space {
        /// The points that move.
        model: Vec<Point3<f64>>,
        /// The points to be met.
        target: Vec<Point3<f64>>,
    },
}

/// One matching problem with its name.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{CasePoints, MatchCase, read_cases};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("shift.txt");
/// std::fs::write(&path, "case shift 2 1 1\nm 0 1\nt 0.5 1\n")?;
/// let points = CasePoints::Plane { model: vec![[0.0, 1.0].into()], target: vec![[0.5, 1.0].into()] };
/// assert_eq!(read_cases(&path)?, [MatchCase { name: "shift".into(), points }]);
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MatchCase {
    /// Name, one word.
    pub name: String,
    /// What is to be matched.
    pub points: CasePoints,
}

/// Reads all cases of a file.
///
/// A case is a line `case NAME D n_model n_target`, then rows `m` (a model point) and `t` (a target point). Rows `g` and `p`, which hold the truth
/// for a scorer, are passed over unread.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use tactile_imaging::io::{CasePoints, read_cases};
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
/// [`ReadError`] with file and line, where a row is not of the format or the counts differ from the header's.
pub fn read_cases(path: impl AsRef<Path>) -> Result<Vec<MatchCase>, ReadError> {
    let path = path.as_ref();
    parse_cases(&read_bytes(path)?, path)
}

/// Parses cases from the bytes of a file. `name` stands for the file in errors.
///
/// # Errors
/// As [`read_cases`].
pub fn parse_cases(bytes: &[u8], name: impl AsRef<Path>) -> Result<Vec<MatchCase>, ReadError> {
    let path = name.as_ref();
    let text = String::from_utf8_lossy(bytes);
    let mut cases = Vec::new();
    let mut open: Option<OpenCase<'_>> = None;
    for (i, line) in text.lines().enumerate() {
        let at = At {
            path,
            line: i as u64 + 1,
        };
        let mut words = line.split_ascii_whitespace();
        match (words.next(), &mut open) {
            (None, _) => {}
            (Some(word), _) if word.starts_with('#') => {}
            (Some("case"), open) => {
                cases.extend(open.take().map(OpenCase::close).transpose()?);
                *open = Some(OpenCase::new(words, at)?);
            }
            (Some("m"), Some(case)) => case.model.push(coordinates(words, case.dimension, at)?),
            (Some("t"), Some(case)) => case.target.push(coordinates(words, case.dimension, at)?),
            (Some("g" | "p"), Some(_)) => {}
            (Some(word), Some(_)) => return Err(at.field(1, Expected::CaseTag, word)),
            (Some(word), None) => return Err(at.field(1, Expected::CaseHeader, word)),
        }
    }
    cases.extend(open.map(OpenCase::close).transpose()?);
    if cases.is_empty() {
        return Err(ReadError::Empty {
            path: path.into(),
            expected: Expected::CaseHeader,
        });
    }
    Ok(cases)
}

/// Writes the answer to one case.
///
/// # Errors
/// Those of the writer.
///
/// # Panics
/// Where `warped` and `assignment` differ in length.
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

/// A place in a file, for errors.
#[derive(Clone, Copy)]
struct At<'a> {
    path: &'a Path,
    line: u64,
}

impl At<'_> {
    fn field(self, column: usize, expected: Expected, found: &str) -> ReadError {
        ReadError::Field {
            path: self.path.into(),
            line: self.line,
            column,
            expected,
            found: shorten(found),
        }
    }

    fn line(self, expected: Expected, found: usize) -> ReadError {
        ReadError::Line {
            path: self.path.into(),
            line: self.line,
            expected,
            found,
        }
    }
}

/// A case whose rows are being read. Third coordinates are zero in the plane.
struct OpenCase<'a> {
    at: At<'a>,
    name: String,
    dimension: usize,
    counts: [usize; 2],
    model: Vec<[f64; 3]>,
    target: Vec<[f64; 3]>,
}

impl<'a> OpenCase<'a> {
    fn new<'w>(words: impl Iterator<Item = &'w str>, at: At<'a>) -> Result<Self, ReadError> {
        let words: Vec<_> = words.collect();
        let &[name, dimension, n_model, n_target] = words.as_slice() else {
            return Err(at.line(Expected::CaseHeader, words.len() + 1));
        };
        let count = |column: usize, word: &str| {
            word.parse::<usize>()
                .map_err(|_| at.field(column, Expected::WholeNumber, word))
        };
        if dimension != "2" && dimension != "3" {
            return Err(at.field(3, Expected::Dimension, dimension));
        }
        Ok(Self {
            at,
            name: name.into(),
            dimension: count(3, dimension)?,
            counts: [count(4, n_model)?, count(5, n_target)?],
            model: Vec::new(),
            target: Vec::new(),
        })
    }

    fn close(self) -> Result<MatchCase, ReadError> {
        for (tag, wanted, found) in [
            ('m', self.counts[0], self.model.len()),
            ('t', self.counts[1], self.target.len()),
        ] {
            if wanted != found {
                return Err(self.at.line(Expected::TaggedRows(tag, wanted), found));
            }
        }
        let plane = |rows: &[[f64; 3]]| rows.iter().map(|r| Point2::new(r[0], r[1])).collect();
        let space = |rows: &[[f64; 3]]| rows.iter().map(|&r| Point3::from(r)).collect();
        let points = if self.dimension == 2 {
            CasePoints::Plane {
                model: plane(&self.model),
                target: plane(&self.target),
            }
        } else {
            CasePoints::Space {
                model: space(&self.model),
                target: space(&self.target),
            }
        };
        Ok(MatchCase {
            name: self.name,
            points,
        })
    }
}

fn coordinates<'w>(
    words: impl Iterator<Item = &'w str>,
    dimension: usize,
    at: At<'_>,
) -> Result<[f64; 3], ReadError> {
    let mut point = [0.0; 3];
    let mut found = 0;
    for word in words {
        let value = word.parse().ok().filter(|v: &f64| v.is_finite());
        let value = value.ok_or_else(|| at.field(found + 2, Expected::FiniteNumber, word))?;
        if found < dimension {
            point[found] = value;
        }
        found += 1;
    }
    if found == dimension {
        Ok(point)
    } else {
        Err(at.line(Expected::Columns(dimension + 1), found + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_model_and_target_and_not_the_truth() {
        let text = "case a_1 2 1 2\nm 1 2\nt 3 4\nt 5 6\ng not read\np x\n# note\ncase b 3 1 1\nm 1 2 3\nt 4 5 6\n";
        let cases = parse_cases(text.as_bytes(), "c.txt").unwrap();
        assert_eq!(cases[0].name, "a_1");
        let CasePoints::Plane { model, target } = &cases[0].points else {
            panic!("two coordinates")
        };
        assert_eq!(
            (model[0], target[1]),
            ([1.0, 2.0].into(), [5.0, 6.0].into())
        );
        assert!(
            matches!(&cases[1].points, CasePoints::Space { model, .. } if model[0] == [1.0, 2.0, 3.0].into())
        );
    }

    #[test]
    fn errors_name_the_line() {
        let message = |text: &str| {
            parse_cases(text.as_bytes(), "c.txt")
                .unwrap_err()
                .to_string()
        };
        assert_eq!(
            message("case a 2 1 1\nm 1 x\n"),
            "c.txt, line 2, column 3: expected a finite number, found `x`"
        );
        assert_eq!(
            message("case a 2 2 0\nm 1 2\n"),
            "c.txt, line 1: expected 2 rows tagged m, found 1"
        );
        assert_eq!(
            message("case a 4 0 0\n"),
            "c.txt, line 1, column 3: expected dimension 2 or 3, found `4`"
        );
        assert!(message("m 1 2\n").contains("expected `case NAME D n_model n_target`"));
        assert!(message("").contains("found none"));
    }

    #[test]
    fn a_result_is_written_as_the_scorer_reads_it() {
        let mut out = Vec::new();
        let warped = [Point2::new(0.1, 2.0), Point2::new(-1.0, 1e-20)];
        write_case_result(&mut out, "a", 1.5, &warped, &[Some(3), None]).unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "case a 1.5\nw 0.1 2.0\nw -1.0 1e-20\na 3\na -1\n"
        );
    }
}
