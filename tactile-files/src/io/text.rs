//! Tables in text: finds the separator of the cells, the heading and the numbers.
use super::columns::{Heading, axes, in_si};
use super::error::{FileError, FilePlace, quoted};
use super::kinds::{UTF_16, kind_of, kind_of_text};
use std::borrow::Cow;
use std::path::Path;

/// Number of lines that are searched for the rows of a table. Preambles of instruments are shorter.
const LONGEST_PREAMBLE: usize = 1000;

/// Largest number of further heading lines below the first (TrackMate writes three).
const MOST_FURTHER_HEADINGS: usize = 3;

/// Number of rows that are tested for whether all numbers have decimals.
const ROWS_LOOKED_AT: usize = 20;

/// Words for a missing number in pandas, R, LabVIEW and Windows.
const MISSING: [&str; 8] = ["", "na", "n/a", "null", "none", "-", "1.#qnan", "-1.#ind"];

/// Words of spreadsheets for a missing number. They begin with `#`, as comments do.
const SHEET_ERRORS: [&str; 7] = [
    "#n/a", "#div/0!", "#num!", "#value!", "#ref!", "#null!", "#name?",
];

/// First characters of comment lines in NumPy, MATLAB, C and DICe.
const COMMENTS: [&str; 4] = ["#", "%", "//", "***"];

/// The cells of a table, row by row.
#[derive(Default)]
pub(super) struct TextCells {
    pub header: Vec<String>,
    /// NaN if a cell holds no number.
    pub values: Vec<f64>,
    pub columns: usize,
    /// For each column, the line of the first cell without a number.
    pub missing: Vec<Option<u64>>,
    /// For each column, the first word in place of a number, and its line.
    pub words: Vec<Option<(u64, String)>>,
    /// What was taken for granted, a sentence each.
    pub notes: Vec<String>,
}

/// A line with its number, from 1.
type Line<'a> = (u64, &'a str);

/// The lines of a text from a given line on.
struct Lines<'a> {
    text: &'a str,
    end: char,
    skipped: usize,
}

impl<'a> Lines<'a> {
    fn new(text: &'a str, skipped: usize) -> Self {
        // Old spreadsheets end lines with only a carriage return.
        let end = if text.contains('\n') { '\n' } else { '\r' };
        let text = text.trim_end_matches('\u{1a}');
        Self { text, end, skipped }
    }

    fn all(&self) -> impl Iterator<Item = Line<'a>> + Clone + use<'a> {
        let lines = self.text.split(self.end).enumerate().skip(self.skipped);
        lines.map(|(at, line)| (at as u64 + 1, line.trim_end_matches('\r')))
    }

    /// The lines without empty lines, comments and a spreadsheet's `sep=` line.
    fn content(&self) -> impl Iterator<Item = Line<'a>> + Clone + use<'a> {
        let passed_over =
            |line: &str| line.trim().is_empty() || is_comment(line) || line.starts_with("sep=");
        self.all().filter(move |(_, line)| !passed_over(line))
    }
}

fn is_comment(line: &str) -> bool {
    let line = line.trim_start();
    let begins = |word: &str| {
        let start = line.get(..word.len());
        start.is_some_and(|start| start.eq_ignore_ascii_case(word))
    };
    COMMENTS.iter().any(|sign| line.starts_with(sign)) && !SHEET_ERRORS.into_iter().any(begins)
}

#[derive(Clone, Copy, PartialEq)]
enum Separator {
    Sign(char),
    Blanks,
}

/// Characters that separate cells.
const SIGNS: [char; 4] = [';', '\t', '|', ','];

impl Separator {
    /// Splits a line into its cells and strips blanks and quotes.
    fn split<'a>(self, line: &'a str, cells: &mut Vec<&'a str>) {
        cells.clear();
        let cuts = |c: char| match self {
            Self::Sign(sign) => c == sign,
            Self::Blanks => c.is_whitespace(),
        };
        let bare =
            |cell: &'a str| cell.trim_matches(|c: char| c == '"' || c == '\'' || c.is_whitespace());
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

    fn cells(self, line: &str) -> Vec<&str> {
        let mut cells = Vec::new();
        self.split(line, &mut cells);
        cells
    }

    /// The separator of a row of numbers, which may have decimal commas.
    fn of(row: &str) -> Self {
        let decimal = |word: &str| {
            !word.starts_with(',') && !word.ends_with(',') && number(word, true).is_some()
        };
        let between_blanks = || row.split_whitespace().nth(1).is_some();
        match SIGNS.into_iter().find(|sign| row.contains(*sign)) {
            None if between_blanks() => Self::Blanks,
            Some(',') if between_blanks() && row.split_whitespace().all(decimal) => Self::Blanks,
            sign => Self::Sign(sign.unwrap_or(',')),
        }
    }
}

/// Number of words in a line, if at least half of them are numbers.
fn numbers(line: &str) -> Option<usize> {
    let words = line.split([',', ';', '\t', ' ', '|']);
    let words = words.map(|word| word.trim_matches(['"', '\'']));
    let (mut all, mut found) = (0, 0);
    for word in words.filter(|word| !word.is_empty()) {
        all += 1;
        found += usize::from(parse(word).is_some());
    }
    (found > 0 && 2 * found >= all).then_some(all)
}

fn parse(cell: &str) -> Option<f64> {
    cell.parse().ok().or_else(|| {
        // Fortran writes exponents with D, and typeset text has its own minus sign.
        let plain = cell.replace(['D', 'd'], "e").replace('−', "-");
        plain.parse().ok().filter(|_| plain != cell)
    })
}

/// A number, or NaN if it is missing. `None` for a word or an infinite number.
fn number(cell: &str, comma: bool) -> Option<f64> {
    let with_point = || parse(&cell.replacen(',', ".", 1)).filter(|_| comma);
    let missing = || {
        let mut words = MISSING.iter().chain(&SHEET_ERRORS);
        let is_missing = words.any(|word| word.eq_ignore_ascii_case(cell));
        is_missing.then_some(f64::NAN)
    };
    let value = parse(cell).or_else(with_point).or_else(missing);
    value.filter(|value: &f64| !value.is_infinite())
}

/// Layout of the rows of a table.
struct Layout {
    separator: Separator,
    /// Whether a comma may be the decimal point.
    comma: bool,
    columns: usize,
    /// Whether the first cell of each row is its name, without a heading (R, pandas).
    named_rows: bool,
}

impl Layout {
    /// The most frequent number of words per line marks the rows, because a preamble may have
    /// numbers too.
    fn of(lines: &Lines<'_>, first: &str) -> Self {
        let rows: Vec<(&str, usize)> = lines
            .content()
            .take(LONGEST_PREAMBLE)
            .filter_map(|(_, line)| Some((line, numbers(line)?)))
            .collect();
        let mut counts = std::collections::BTreeMap::new();
        rows.iter()
            .for_each(|(_, count)| *counts.entry(count).or_insert(0) += 1);
        let usual = counts
            .iter()
            .max_by_key(|(_, times)| **times)
            .map(|(count, _)| **count);
        let row = rows.iter().rfind(|(_, count)| Some(*count) == usual);
        let row = row.map_or(first, |(line, _)| line);
        let separator = Separator::of(row.trim());
        let cells = separator.cells(row);
        let heading = separator.cells(first).len();
        // Rows may end with a separator although their heading does not.
        let trails = cells.last() == Some(&"") && heading + 1 == cells.len();
        Self {
            separator,
            comma: separator != Separator::Sign(','),
            columns: cells.len() - usize::from(trails),
            named_rows: false,
        }
    }

    /// Splits a row into its cells.
    fn split<'a>(&self, line: &'a str, cells: &mut Vec<&'a str>) {
        self.separator.split(line, cells);
        if self.named_rows && !cells.is_empty() {
            cells.remove(0);
        }
        // A separator at the end of the line adds an empty cell.
        if cells.len() == self.columns + 1 && cells.last() == Some(&"") {
            cells.pop();
        }
    }

    /// Whether cells are a heading, which has words and no numbers.
    fn is_heading(&self, cells: &[&str]) -> bool {
        let is_word = |cell: &&str| !cell.is_empty() && number(cell, self.comma).is_none();
        cells.iter().all(|cell| cell.is_empty() || is_word(cell)) && cells.iter().any(is_word)
    }

    /// The heading in a line. Its separator may differ from that of the rows.
    fn heading(&self, line: &str) -> Option<Vec<String>> {
        let signs = SIGNS.map(Separator::Sign);
        let separators = [self.separator]
            .into_iter()
            .chain(signs)
            .chain([Separator::Blanks]);
        let mut cells = separators.map(|separator| separator.cells(line));
        let cells = cells.find(|cells| cells.len() == self.columns)?;
        Some(cells.iter().map(|cell| quoted(cell, 40)).collect())
    }

    /// Whether the first line numbers the columns from 0, as pandas does for arrays. Such a line
    /// either starts with an empty cell, above the names of the rows, or is followed by rows in
    /// which every number has decimals.
    fn numbers_columns<'a>(&self, cells: &[&str], below: impl Iterator<Item = &'a str>) -> bool {
        let names = cells.strip_prefix(&[""]).unwrap_or(cells);
        let counted = names
            .iter()
            .enumerate()
            .all(|(k, name)| *name == k.to_string());
        let decimal = |row: &str| {
            self.separator
                .cells(row)
                .iter()
                .all(|cell| cell.contains('.'))
        };
        let is_above = || names.len() < cells.len() || below.take(ROWS_LOOKED_AT).all(decimal);
        names.len() > 1 && counted && is_above()
    }

    /// A hint about the line where the table begins, if rows are found further down.
    fn remedy(&self, lines: &Lines<'_>, first: u64) -> String {
        let width = |line: &str| self.separator.cells(line).len();
        let is_row = |line: &str| numbers(line).is_some() && width(line) == self.columns;
        let mut before = None;
        let mut pairs = lines.content().zip(lines.content().skip(1));
        let start = pairs.find_map(|((at, line), (_, next))| {
            let is_name =
                |(_, line): &Line<'_>| width(line) == self.columns && numbers(line).is_none();
            let heading = before.replace((at, line)).filter(is_name);
            (is_row(line) && is_row(next)).then(|| heading.map_or(at, |(at, _)| at))
        });
        start
            .filter(|start| *start > first)
            .map_or(String::new(), |start| {
                let skip = start - 1;
                format!(" (the table seems to begin at line {start}: --skip-lines {skip})")
            })
    }
}

/// Whether a comment may be the heading if its number of words fits the columns, and whether it is
/// the heading even if the number differs.
fn names_columns(text: &str) -> [bool; 2] {
    let words: Vec<&str> = match text.contains(SIGNS) {
        true => text.split(SIGNS).collect(),
        false => text.split_whitespace().collect(),
    };
    let known = words
        .iter()
        .filter(|word| Heading::of(word.trim()).is_known());
    let known = known.count();
    let sentence = !text.contains(SIGNS) && known < words.len();
    [known > 1, known > 1 && !sentence]
}

/// A file as text. Bytes that are not UTF-8 are read as Latin-1, whose micro sign occurs in many
/// headings.
fn decoded<'a>(bytes: &'a [u8], path: &Path, skip_lines: usize) -> Result<Cow<'a, str>, FileError> {
    if let Some(kind) = kind_of(bytes).or_else(|| kind_of_text(bytes).filter(|_| skip_lines == 0)) {
        let expected = match kind.as_str() {
            UTF_16 => "UTF-8 text",
            _ => "a table of numbers (text, NPY, NPZ or MAT)",
        };
        return Err(FileError::content(path, FilePlace::File, expected, kind));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let latin = || {
        bytes
            .iter()
            .map(|byte| char::from(*byte))
            .collect::<String>()
    };
    Ok(std::str::from_utf8(bytes).map_or_else(|_| latin().into(), Cow::from))
}

/// Reads the cells of a table from the line after `skip_lines`.
///
/// # Errors
/// [`FileError::Content`] if the file is not text or its rows differ in length.
pub(super) fn cells(bytes: &[u8], path: &Path, skip_lines: usize) -> Result<TextCells, FileError> {
    let text = decoded(bytes, path, skip_lines)?;
    let lines = Lines::new(&text, skip_lines);
    let none = || FileError::no_rows(path);
    let (first, first_line) = lines.content().next().ok_or_else(none)?;
    let mut layout = Layout::of(&lines, first_line);
    let ragged = |layout: &Layout, line: u64, found: usize| {
        let found = found.to_string() + &layout.remedy(&lines, first);
        FileError::content(
            path,
            FilePlace::Line(line),
            columns_in_words(layout.columns),
            found,
        )
    };
    // Files of Elastix begin with the kind and the number of points.
    let kind = ["point", "index"].contains(&first_line.trim());
    let is_count = |line: &str| line.trim().parse::<usize>().is_ok();
    let mut rows = lines.content().skip(usize::from(kind)).peekable();
    rows.next_if(|(_, line)| kind && is_count(line));
    let mut table = TextCells::default();
    let &(line, text) = rows.peek().ok_or_else(none)?;
    let mut cells = layout.separator.cells(text);
    let numbered = layout.numbers_columns(&cells, rows.clone().skip(1).map(|(_, row)| row));
    if numbered || layout.is_heading(&cells) {
        rows.next();
        rows.peek().ok_or_else(none)?;
        let names = layout.heading(text).filter(|_| !numbered);
        let is_row = |row: &[&str]| row.len() == layout.columns && !layout.is_heading(row);
        let below = rows.peek().map(|(_, row)| layout.separator.cells(row));
        let is_shorter = cells.len() > 1 && cells.len() + 1 == layout.columns;
        let above_names = match numbered {
            true => cells[0].is_empty(),
            false => is_shorter && below.is_some_and(|row| is_row(&row)),
        };
        layout.named_rows = names.is_none() && above_names;
        layout.columns -= usize::from(layout.named_rows);
        if numbered {
            table.notes.push(format!("line {line} numbers the columns"));
        } else {
            table.header = match names {
                Some(names) => names,
                None if above_names => cells.iter().map(|cell| quoted(cell, 40)).collect(),
                None => return Err(ragged(&layout, line, cells.len())),
            };
        }
        if layout.named_rows {
            table.notes.push("its first column names the rows".into());
        }
    } else {
        let comments = lines.all().take_while(|(at, _)| *at < line);
        table.heading_of_comment(&layout, comments, path)?;
    }
    (table.columns, table.missing) = (layout.columns, vec![None; layout.columns]);
    table.words = vec![None; layout.columns];
    let (mut further, mut commas, mut points) = (0, false, false);
    let mut thousands = None;
    for (line, text) in rows {
        layout.split(text, &mut cells);
        if cells.len() != layout.columns {
            return Err(ragged(&layout, line, cells.len()));
        }
        let above = table.values.is_empty() && further < MOST_FURTHER_HEADINGS;
        if above && layout.is_heading(&cells) && table.further_heading(line, &cells, further > 0) {
            further += 1;
            continue;
        }
        for (column, cell) in cells.iter().enumerate() {
            let value = number(cell, layout.comma);
            if layout.comma && value.is_some() {
                points |= cell.contains('.');
                if let Some((whole, rest)) = cell.split_once(',') {
                    commas = true;
                    let is_group = whole.len() < 4 && rest.len() == 3;
                    thousands = thousands.or(is_group.then_some((line, column, *cell)));
                }
            }
            match value {
                None if table.words[column].is_none() => {
                    table.words[column] = Some((line, quoted(cell, 40)));
                }
                Some(value) if value.is_nan() => {
                    table.missing[column].get_or_insert(line);
                }
                _ => {}
            }
            table.values.push(value.unwrap_or(f64::NAN));
        }
    }
    if let Some((line, column, cell)) = thousands.filter(|_| points) {
        let place = FilePlace::Cell {
            line,
            column: column + 1,
        };
        let found = format!("`{cell}` beside decimal points");
        return Err(FileError::content(
            path,
            place,
            "a decimal comma or a thousands separator alone",
            found,
        ));
    }
    if commas {
        table.notes.push("its decimal points are commas".into());
    }
    if further > 0 {
        let note = format!("{further} further lines of headings are skipped");
        table.notes.push(note);
    }
    Ok(table)
}

impl TextCells {
    /// Uses the last of these lines as the heading if it is a comment that names the columns.
    fn heading_of_comment<'a>(
        &mut self,
        layout: &Layout,
        lines: impl Iterator<Item = Line<'a>>,
        path: &Path,
    ) -> Result<(), FileError> {
        let Some((at, comment)) = lines.filter(|(_, line)| is_comment(line)).last() else {
            return Ok(());
        };
        let comment = comment
            .trim_start()
            .trim_start_matches(['#', '%', '/', '*'])
            .trim();
        let comment = comment.strip_prefix("columns =").unwrap_or(comment);
        let [may_name, does_name] = names_columns(comment);
        match layout.heading(comment) {
            Some(names) if may_name => {
                self.notes
                    .push(format!("the heading is the comment in line {at}"));
                self.header = names;
            }
            None if does_name => {
                let expected = format!("a heading of {}", columns_in_words(layout.columns));
                let remedy = "name them all in the first line, or leave the comment out";
                let found = format!("the comment `{}`: {remedy}", quoted(comment, 60));
                return Err(FileError::content(
                    path,
                    FilePlace::Line(at),
                    expected,
                    found,
                ));
            }
            _ => {}
        }
        Ok(())
    }

    /// Reads a line of words below the heading as units, longer names, or names of columns whose
    /// groups stand above (pandas, DeepLabCut). Returns false if the words stand in place of
    /// numbers.
    fn further_heading(&mut self, line: u64, cells: &[&str], below_others: bool) -> bool {
        let has_axes = |names: &mut dyn Iterator<Item = &str>| {
            axes(&names.map(Heading::of).collect::<Vec<_>>()).len() > 1
        };
        let is_named = has_axes(&mut self.header.iter().map(String::as_str));
        if !self.header.is_empty() && !is_named && has_axes(&mut cells.iter().copied()) {
            self.header = cells.iter().map(|cell| quoted(cell, 40)).collect();
            self.notes.push(format!("the heading is line {line}"));
            return true;
        }
        let bare = |cell: &str| cell.trim_matches(['(', ')', '[', ']']).trim().to_owned();
        let is_unit = |cell: &&str| cell.is_empty() || in_si(&bare(cell)).is_some();
        let units = cells.iter().all(is_unit);
        if self.header.is_empty() || !units && !below_others && self.columns <= 2 {
            return false;
        }
        for (name, unit) in self.header.iter_mut().zip(cells) {
            let is_unit = units || unit.starts_with(['(', '[']);
            if is_unit && !unit.is_empty() && Heading::of(name).unit.is_none() {
                *name = format!("{name} ({})", quoted(&bare(unit), 20));
            }
        }
        true
    }
}

pub(super) fn columns_in_words(count: usize) -> String {
    format!("{count} column{}", if count == 1 { "" } else { "s" })
}
