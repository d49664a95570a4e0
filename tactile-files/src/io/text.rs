//! Tables in text: what separates their cells, where their heading stands, and their numbers.
use super::columns::Heading;
use super::error::{FileError, FilePlace, quoted};
use super::kinds::{UTF_16, kind_of};
use std::path::Path;

/// Lines among which the first row of numbers is looked for. Preambles of instruments are shorter.
const LONGEST_PREAMBLE: usize = 1000;

/// Lines of names, long names and units below the first heading (TrackMate has three).
const MOST_FURTHER_HEADINGS: usize = 3;

/// Words for a number that is not there: of pandas, R, spreadsheets, Labview and Windows.
const MISSING: [&str; 9] = [
    "", "na", "n/a", "#n/a", "null", "none", "-", "1.#qnan", "-1.#ind",
];

/// The cells of a table, row by row.
#[derive(Default)]
pub(super) struct TextCells {
    pub header: Vec<String>,
    /// NaN if a cell holds no number.
    pub values: Vec<f64>,
    pub columns: usize,
    /// Line of the first cell of each column without a number.
    pub missing: Vec<Option<u64>>,
    /// Line of the first cell of each column with a word in place of a number, and the word.
    pub words: Vec<Option<(u64, String)>>,
    /// What was taken for granted, a sentence each.
    pub notes: Vec<String>,
}

#[derive(Clone, Copy, PartialEq)]
enum Separator {
    Sign(char),
    Blanks,
}

impl Separator {
    /// Cuts a line into its cells, without blanks and quotes around them.
    fn split<'a>(self, line: &'a str, cells: &mut Vec<&'a str>) {
        cells.clear();
        let cuts = |c: char| match self {
            Self::Sign(sign) => c == sign,
            Self::Blanks => c.is_whitespace(),
        };
        let bare = |cell: &'a str| cell.trim_matches(|c: char| c == '"' || c.is_whitespace());
        if line.contains('"') {
            let mut quoted = false;
            cells.extend(line.split(|c| {
                quoted ^= c == '"';
                !quoted && cuts(c)
            }));
            cells.iter_mut().for_each(|cell| *cell = bare(cell));
        } else {
            cells.extend(line.split(cuts).map(bare));
        }
        if self == Self::Blanks {
            cells.retain(|cell| !cell.is_empty());
        }
    }

    fn count(self, line: &str) -> usize {
        let mut cells = Vec::new();
        self.split(line, &mut cells);
        cells.len()
    }

    /// That of a row of numbers, which may have decimal commas.
    fn of(row: &str) -> Self {
        let decimal = |word: &str| {
            let number = word.replacen(',', ".", 1);
            !word.starts_with(',') && !word.ends_with(',') && number.parse::<f64>().is_ok()
        };
        let between_blanks = || row.split_whitespace().count() > 1;
        match row {
            _ if row.contains(';') => Self::Sign(';'),
            _ if row.contains('\t') => Self::Sign('\t'),
            _ if row.contains(',') && between_blanks() && row.split_whitespace().all(decimal) => {
                Self::Blanks
            }
            _ if !row.contains(',') && between_blanks() => Self::Blanks,
            _ => Self::Sign(','),
        }
    }
}

/// Number of the words of a line, if at least half of them are numbers.
fn numbers(line: &str) -> Option<usize> {
    let words = line
        .split([',', ';', '\t', ' '])
        .map(|w| w.trim_matches('"'));
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    let found = words
        .iter()
        .filter(|word| word.parse::<f64>().is_ok())
        .count();
    (found > 0 && 2 * found >= words.len()).then_some(words.len())
}

/// A number, NaN for one that is not there. `None` for a word, and for an infinite number.
fn number(cell: &str, comma: bool) -> Option<f64> {
    let value = match cell.parse::<f64>() {
        Ok(value) => Some(value),
        Err(_) if comma && cell.contains(',') => cell.replacen(',', ".", 1).parse().ok(),
        Err(_) => {
            let mut words = MISSING.iter();
            let is_missing = words.any(|word| word.eq_ignore_ascii_case(cell));
            is_missing.then_some(f64::NAN)
        }
    };
    value.filter(|value: &f64| !value.is_infinite())
}

fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with(['#', '%'])
}

/// Whether cells are a heading: words, and no number.
fn is_heading(cells: &[&str], comma: bool) -> bool {
    let is_word = |cell: &&str| !cell.is_empty() && number(cell, comma).is_none();
    cells.iter().all(|cell| cell.is_empty() || is_word(cell)) && cells.iter().any(is_word)
}

/// The heading that a line holds for so many columns: it may be separated otherwise than the rows.
fn heading(line: &str, separator: Separator, columns: usize) -> Option<Vec<String>> {
    let signs = [',', ';', '\t'].map(Separator::Sign);
    let separators = [separator]
        .into_iter()
        .chain(signs)
        .chain([Separator::Blanks]);
    let mut cells = Vec::new();
    separators.into_iter().find_map(|separator| {
        separator.split(line, &mut cells);
        (cells.len() == columns).then(|| cells.iter().map(|cell| quoted(cell, 40)).collect())
    })
}

/// Whether a comment may be the heading of as many columns as it has words, and whether it is one
/// even if their number differs.
fn names_columns(text: &str) -> [bool; 2] {
    let signs = [',', ';', '\t'];
    let words: Vec<&str> = match text.contains(signs) {
        true => text.split(signs).collect(),
        false => text.split_whitespace().collect(),
    };
    let known = words
        .iter()
        .filter(|word| Heading::of(word.trim()).is_known())
        .count();
    let sentence = !text.contains(signs) && known < words.len();
    [known > 1, known > 1 && !sentence]
}

/// Reads the cells of a table from the line after `skip_lines`.
///
/// # Errors
/// [`FileError::Content`] for what is no text, and for rows of another length than the others.
pub(super) fn cells(bytes: &[u8], path: &Path, skip_lines: usize) -> Result<TextCells, FileError> {
    let error =
        |place, expected: &str, found: &str| FileError::content(path, place, expected, found);
    if let Some(kind) = kind_of(bytes) {
        let expected = if kind == UTF_16 {
            "UTF-8 text"
        } else {
            "a table of numbers"
        };
        return Err(error(FilePlace::File, expected, kind));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    // What is no UTF-8 is read as Latin-1, whose micro sign stands in many headings.
    let latin = || {
        bytes
            .iter()
            .map(|byte| char::from(*byte))
            .collect::<String>()
    };
    let text = std::str::from_utf8(bytes).map_or_else(|_| latin().into(), std::borrow::Cow::from);
    let lines = || {
        let lines = text.split('\n').enumerate().skip(skip_lines);
        lines.map(|(at, line)| (at as u64 + 1, line.trim_end_matches('\r')))
    };
    let content = || lines().filter(move |(_, line)| !line.trim().is_empty() && !is_comment(line));
    let Some((first, first_line)) = content().next() else {
        return Err(error(
            FilePlace::File,
            "at least one row of numbers",
            "none",
        ));
    };
    // The first of two rows of as many words shows how all are separated: a preamble may have a
    // number here and there.
    let counts = || {
        content()
            .take(LONGEST_PREAMBLE)
            .map(|(_, line)| (line, numbers(line)))
    };
    let pair = counts()
        .zip(counts().skip(1))
        .find(|(a, b)| a.1.is_some() && a.1 == b.1);
    let row = pair
        .map(|(row, _)| row)
        .or_else(|| counts().find(|row| row.1.is_some()));
    let row = row.map_or(first_line, |(line, _)| line);
    let separator = Separator::of(row.trim());
    let comma = separator != Separator::Sign(',');
    let mut cells = Vec::new();
    let mut columns = separator.count(row);
    // Rows may end with a separator that their heading does not have.
    separator.split(row, &mut cells);
    if cells.last() == Some(&"") && separator.count(first_line) + 1 == columns {
        columns -= 1;
    }
    let mut table = TextCells::default();
    // Elastix begins with the kind of its points and their number.
    let mut rows = content().peekable();
    if ["point", "index"].contains(&first_line.trim()) {
        let is_count = |(_, line): &(u64, &str)| line.trim().parse::<usize>().is_ok();
        rows.next();
        rows.next_if(is_count);
    }
    let begin = || {
        let width = |line: &str| numbers(line).is_some() && separator.count(line) == columns;
        let mut before = None;
        let start = content()
            .zip(content().skip(1))
            .find_map(|((at, line), (_, next))| {
                let is_start = width(line) && width(next);
                let heading = before.replace((at, line)).filter(|(_, line)| {
                    separator.count(line) == columns && numbers(line).is_none()
                });
                is_start.then(|| heading.map_or(at, |(at, _)| at))
            });
        let start = start.filter(|start| *start > first);
        start.map_or(String::new(), |start| {
            let skip = start - 1;
            format!(" (the table seems to begin at line {start}: --skip-lines {skip})")
        })
    };
    let ragged = |line: u64, columns: usize, found: usize| {
        let expected = columns_in_words(columns);
        error(
            FilePlace::Line(line),
            &expected,
            &(found.to_string() + &begin()),
        )
    };
    if let Some(&(line, text)) = rows.peek() {
        separator.split(text, &mut cells);
        if is_heading(&cells, comma) {
            rows.next();
            if rows.peek().is_none() {
                return Err(error(
                    FilePlace::File,
                    "at least one row of numbers",
                    "none",
                ));
            }
            match heading(text, separator, columns) {
                Some(names) => table.header = names,
                None => return Err(ragged(line, columns, cells.len())),
            }
        } else {
            let comments = lines().take_while(|(at, _)| *at < line);
            if let Some((at, comment)) = comments.filter(|(_, line)| is_comment(line)).last() {
                let comment = comment.trim_start().trim_start_matches(['#', '%']).trim();
                let comment = comment.strip_prefix("columns =").unwrap_or(comment);
                let [may_name, does_name] = names_columns(comment);
                match heading(comment, separator, columns) {
                    Some(names) if may_name => {
                        table
                            .notes
                            .push(format!("the heading is the comment in line {at}"));
                        table.header = names;
                    }
                    None if does_name => {
                        let expected = format!("a heading of {}", columns_in_words(columns));
                        let remedy = "name them all in the first line, or leave the comment out";
                        let found = format!("the comment `{}`: {remedy}", quoted(comment, 60));
                        return Err(error(FilePlace::Line(at), &expected, &found));
                    }
                    _ => {}
                }
            }
        }
    }
    table.missing = vec![None; columns];
    table.words = vec![None; columns];
    let (mut further, mut commas) = (0, false);
    for (line, text) in rows {
        separator.split(text, &mut cells);
        // A separator at the end of each line makes one more, empty cell.
        if cells.len() == columns + 1 && cells.last().is_some_and(|cell| cell.is_empty()) {
            cells.pop();
        }
        if cells.len() != columns {
            return Err(ragged(line, columns, cells.len()));
        }
        let is_first = table.values.is_empty() && !table.header.is_empty();
        if is_first && further < MOST_FURTHER_HEADINGS && columns > 2 && is_heading(&cells, comma) {
            further += 1;
            for (name, unit) in table.header.iter_mut().zip(&cells) {
                if unit.starts_with('(') && Heading::of(name).unit.is_none() {
                    *name = format!("{name} {}", quoted(unit, 20));
                }
            }
            continue;
        }
        for (column, cell) in cells.iter().enumerate() {
            let value = number(cell, comma);
            commas |= comma && value.is_some() && cell.contains(',');
            match value {
                None if table.words[column].is_none() => {
                    table.words[column] = Some((line, quoted(cell, 40)));
                }
                Some(value) if value.is_nan() && table.missing[column].is_none() => {
                    table.missing[column] = Some(line);
                }
                _ => {}
            }
            table.values.push(value.unwrap_or(f64::NAN));
        }
    }
    if commas {
        table.notes.push("its decimal points are commas".into());
    }
    if further > 0 {
        table.notes.push(format!(
            "{further} further lines of headings are passed over"
        ));
    }
    table.columns = columns;
    Ok(table)
}

pub(super) fn columns_in_words(count: usize) -> String {
    format!("{count} column{}", if count == 1 { "" } else { "s" })
}
