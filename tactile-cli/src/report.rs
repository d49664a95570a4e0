//! Results as report pages: one self-contained HTML file.
use crate::relief::HeightGrid;
use crate::text::{four_digits, printable};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use hmac_sha256::Hash;
use ndarray::ArrayView2;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::fmt::Write;
use std::io::Read;
use std::path::{Path, PathBuf};
use tactile_files::scene::Scene;
use tactile_imaging::core::Source;
use tactile_imaging::pipeline::{Flag, Measurement, Object, interval_text, with_error};

/// A printed line.
enum Printed {
    Line(String),
    Row(String, String),
}

/// The content of the report of a call, collected while it runs, and its page.
///
/// The policy of the page allows no requests, and only the script that rotates surfaces. The page
/// does not depend on time, place or speed of the call, so that two pages differ only if calls or
/// data do.
pub(crate) struct Report {
    pub path: PathBuf,
    /// The call, in the syntax of a shell.
    call: String,
    question: String,
    answers: Vec<String>,
    printed: Vec<Printed>,
    cautions: Vec<[String; 2]>,
    tables: Vec<(&'static str, Vec<[String; 2]>)>,
    pictures: Vec<String>,
    surfaces: Vec<String>,
    inputs: Vec<PathBuf>,
}

impl Report {
    pub(crate) fn new(path: PathBuf, call: &[OsString], question: String) -> Self {
        let words: Vec<String> = call
            .iter()
            .map(|word| quoted(&word.to_string_lossy()))
            .collect();
        Self {
            path,
            call: words.join(" "),
            question,
            answers: Vec::new(),
            printed: Vec::new(),
            cautions: Vec::new(),
            tables: Vec::new(),
            pictures: Vec::new(),
            surfaces: Vec::new(),
            inputs: Vec::new(),
        }
    }

    /// Adds a printed line.
    pub(crate) fn line(&mut self, text: &str) {
        self.printed.push(Printed::Line(text.to_owned()));
    }

    /// Adds a printed name with its value.
    pub(crate) fn row(&mut self, name: &str, value: &str) {
        let row = Printed::Row(name.to_owned(), value.to_owned());
        self.printed.push(row);
    }

    /// Adds a sentence to the result at the top.
    pub(crate) fn answer(&mut self, text: impl Into<String>) {
        self.answers.push(text.into());
    }

    /// Adds a caution with the remedy of its kind, which is empty if the guide does not list the
    /// kind. A caution appears on the page once.
    pub(crate) fn caution(&mut self, text: impl Into<String>, kind: &str) {
        let caution = [text.into(), remedy(kind).to_owned()];
        if !self.cautions.contains(&caution) {
            self.cautions.push(caution);
        }
    }

    /// Adds a caution of the library.
    pub(crate) fn flag(&mut self, flag: &Flag) {
        self.caution(flag.to_string(), &kind(flag));
    }

    /// Adds a table of names and values.
    pub(crate) fn table(&mut self, title: &'static str, rows: Vec<[String; 2]>) {
        self.tables.push((title, rows));
    }

    /// Adds a picture (an SVG of this program).
    pub(crate) fn picture(&mut self, svg: String) {
        self.pictures.push(svg);
    }

    /// Adds heights that can be rotated with the mouse, NaN outside the surface. Heights and pixels
    /// are in millimetres.
    pub(crate) fn surface(&mut self, title: &str, heights: ArrayView2<'_, f64>, pixel: [f64; 2]) {
        let Some(relief) = HeightGrid::of(heights, pixel) else {
            return;
        };
        self.surfaces.push(format!(
            "<canvas class=\"surface\" tabindex=\"0\" width=\"900\" height=\"600\" \
             data-relief='{}'></canvas><figcaption>{}: {} mm high. Drag to rotate</figcaption>",
            json!(relief),
            escaped(title),
            four_digits(relief.height_mm),
        ));
    }

    /// Adds files on which the result depends.
    pub(crate) fn inputs(&mut self, files: impl IntoIterator<Item = PathBuf>) {
        for file in files {
            if !self.inputs.contains(&file) {
                self.inputs.push(file);
            }
        }
    }

    /// Adds the result of a measurement, its cautions and its error budget.
    pub(crate) fn measurement(&mut self, measurement: &Measurement) {
        match &measurement.youngs_modulus_pa {
            Ok(found) => {
                let value = with_error(found.value, found.standard_error, 1e-3);
                self.answer(format!("Young's modulus {value} kPa"));
                let ends = interval_text(found.interval_95, found.standard_error, 1e-3);
                self.answer(format!("with 95 % confidence {ends} kPa"));
                self.answer(format!("by the estimator {}", found.estimator));
            }
            Err(error) => self.answer(format!("No modulus: {error}")),
        }
        let shares = measurement.error_budget.iter().map(|share| {
            let percent = format!("{:.2} % of the modulus", 100.0 * share.relative_error);
            [share.source.to_string(), percent]
        });
        self.table("Where the error comes from", shares.collect());
    }

    /// Adds the values stated by a scene with and without an error.
    pub(crate) fn assumptions(&mut self, scene: &Scene) {
        let stated = |value: f64, error: Option<f64>, scale: f64, unit: &str| match error {
            Some(error) if error > 0.0 => format!("{}{unit}", with_error(value, error, scale)),
            Some(_) => format!("{}{unit}, taken as exact", four_digits(scale * value)),
            None => format!("{}{unit}, its error assumed", four_digits(scale * value)),
        };
        let mut rows = Vec::new();
        let mut add = |name: &str, value: String| rows.push([name.to_owned(), value]);
        if let Object::Sphere {
            radius_m,
            poisson_ratio,
        } = scene.object
        {
            let relative = scene.errors.stated(Source::ObjectSize);
            let radius_error_m = relative.map(|relative| relative * radius_m);
            add(
                "radius of the ball",
                stated(radius_m, radius_error_m, 1e3, " mm"),
            );
            let error = scene.errors.stated(Source::PoissonRatio);
            add("Poisson's ratio", stated(poisson_ratio, error, 1.0, ""));
        } else {
            // Fields and numbers, as in the scene.
            add("object", format!("{:?}, taken as exact", scene.object));
        }
        match scene.pixel_size_m {
            [0.0, _] => add(
                "size of a pixel",
                "from the sensor's file, with its error".into(),
            ),
            [x, y] => add(
                "size of a pixel",
                format!(
                    "{} × {} µm, taken as exact",
                    four_digits(1e6 * x),
                    four_digits(1e6 * y)
                ),
            ),
        }
        for (k, layer) in scene.layers.iter().enumerate() {
            let value = format!(
                "{} mm of {} kPa, Poisson's ratio {}, taken as exact",
                four_digits(1e3 * layer.thickness_m),
                four_digits(1e-3 * layer.youngs_modulus_pa),
                layer.poisson_ratio
            );
            add(&format!("layer {}", k + 1), value);
        }
        self.table("What was taken as known", rows);
    }

    /// The page.
    pub(crate) fn html(&self) -> String {
        let mut page = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(&mut page);
        page
    }

    fn write(&self, page: &mut String) -> std::fmt::Result {
        let question = escaped(&self.question);
        let allowed = BASE64_STANDARD.encode(Hash::hash(TURN.as_bytes()));
        writeln!(
            page,
            r#"<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none';
style-src 'unsafe-inline'; img-src data:; script-src 'sha256-{allowed}'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{question}</title>
<style>{STYLE}</style>
</head>
<body>
<h1>{question}</h1>"#
        )?;
        if let Some((first, rest)) = self.answers.split_first() {
            writeln!(page, "<p class=\"answer\">{}</p>", escaped(first))?;
            for text in rest {
                writeln!(page, "<p class=\"beside\">{}</p>", escaped(text))?;
            }
        }
        if !self.cautions.is_empty() {
            // Cautions of every kind come before the numbers to which they apply.
            writeln!(page, "<h2>Cautions</h2>\n<ul class=\"cautions\">")?;
            for [text, remedy] in &self.cautions {
                let (text, remedy) = (escaped(text), escaped(remedy));
                writeln!(page, "<li>{text}<br><em>{remedy}</em></li>")?;
            }
            writeln!(page, "</ul>")?;
        }
        if !self.pictures.is_empty() || !self.surfaces.is_empty() {
            writeln!(page, "<h2>Pictures</h2>")?;
        }
        for surface in &self.surfaces {
            writeln!(page, "<figure>{surface}</figure>")?;
        }
        for svg in &self.pictures {
            writeln!(page, "<figure>{svg}</figure>")?;
        }
        for (title, rows) in self.tables.iter().filter(|(_, rows)| !rows.is_empty()) {
            writeln!(page, "<h2>{title}</h2>\n<table>")?;
            for [name, value] in rows {
                row(page, name, value)?;
            }
            writeln!(page, "</table>")?;
        }
        self.write_printed(page)?;
        if !self.inputs.is_empty() {
            writeln!(page, "<h2>Inputs</h2>\n<table class=\"files\">")?;
            for file in &self.inputs {
                row(page, &file.display().to_string(), &hash(file))?;
            }
            writeln!(page, "</table>\n<p>Hashes are SHA-256.</p>")?;
        }
        if !self.call.is_empty() {
            let call = escaped(&self.call);
            writeln!(page, "<h2>To repeat it</h2>\n<pre>{call}</pre>")?;
        }
        if !self.surfaces.is_empty() {
            writeln!(page, "<script>{TURN}</script>")?;
        }
        let version = env!("CARGO_PKG_VERSION");
        writeln!(page, "<p>tactile {version}</p>\n</body>\n</html>")
    }

    /// All printed output: rows as tables, lines unchanged.
    fn write_printed(&self, page: &mut String) -> std::fmt::Result {
        writeln!(page, "<h2>All numbers</h2>")?;
        let mut open = "";
        for printed in &self.printed {
            let kind = match printed {
                Printed::Line(_) => "pre",
                Printed::Row(..) => "table",
            };
            if open != kind {
                if !open.is_empty() {
                    writeln!(page, "</{open}>")?;
                }
                write!(page, "<{kind}>")?;
                open = kind;
            }
            match printed {
                Printed::Line(text) => writeln!(page, "{}", escaped(text))?,
                Printed::Row(name, value) => row(page, name, value)?,
            }
        }
        if !open.is_empty() {
            writeln!(page, "</{open}>")?;
        }
        Ok(())
    }
}

fn row(page: &mut String, name: &str, value: &str) -> std::fmt::Result {
    let (name, value) = (escaped(name), escaped(value));
    writeln!(page, "<tr><th>{name}</th><td>{value}</td></tr>")
}

/// Kinds of cautions with their remedies: the tables of the guide.
const CAUTIONS: &str = include_str!("../cautions.md");

/// The remedy for a kind of caution in the guide. Empty if the guide does not list the kind.
fn remedy(kind: &str) -> &'static str {
    let row = CAUTIONS.lines().find(|line| {
        let cell = line.strip_prefix("| `").and_then(|row| row.split_once('`'));
        cell.is_some_and(|(listed, _)| listed == kind)
    });
    let cells = row.and_then(|row| row.trim_end_matches(" |").rsplit_once(" | "));
    cells.map_or("", |(_, remedy)| remedy)
}

/// The kind of a caution of the library, as listed in the guide. For an assumption it is the kind
/// of its warning.
fn kind(flag: &Flag) -> String {
    let name = match flag {
        Flag::Assumption { warning } => json!(warning),
        _ => json!(flag)["kind"].clone(),
    };
    match name {
        Value::Object(fields) => fields.keys().next().cloned().unwrap_or_default(),
        word => word.as_str().unwrap_or_default().to_owned(),
    }
}

/// The SHA-256 of a file, or the reason why there is none.
fn hash(path: &Path) -> String {
    let hashed = || -> std::io::Result<String> {
        if !path.is_file() {
            return Ok("not a regular file: its content is not kept".to_owned());
        }
        let mut file = std::fs::File::open(path)?;
        let (mut hash, mut bytes) = (Hash::new(), vec![0; 1 << 16]);
        loop {
            match file.read(&mut bytes)? {
                0 => break,
                read => hash.update(&bytes[..read]),
            }
        }
        let digits = hash.finalize().map(|byte| format!("{byte:02x}"));
        Ok(digits.concat())
    };
    hashed().unwrap_or_else(|error| format!("cannot be read: {error}"))
}

/// Foreign text as HTML.
fn escaped(text: &str) -> String {
    let lines: Vec<String> = text.split('\n').map(printable).collect();
    lines
        .join("\n")
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#39;")
}

/// A word of a command in the syntax of a shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// Draws every surface of the page.
const TURN: &str = concat!(
    include_str!("relief.js"),
    r#"for (const canvas of document.querySelectorAll("canvas.surface")) {
  const stretch = turnable(canvas)(JSON.parse(canvas.dataset.relief));
  if (stretch > 1) canvas.nextElementSibling.textContent += `, heights ×${stretch.toPrecision(2)}`;
}
"#
);

const STYLE: &str = "
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.1rem; font-weight: 500; opacity: .75; margin: .5rem 0; }
h2 { font-size: 1.1rem; margin: 2rem 0 .5rem; border-bottom: 1px solid #8886; break-after: avoid; }
.answer { font-size: 1.9rem; font-weight: 600; line-height: 1.2; margin: .3rem 0; }
.beside { margin: .2rem 0; }
.cautions li { margin: .4rem 0; }
figure { margin: 1rem 0; padding: .5rem; background: #fff; border-radius: .5rem; break-inside: \
                     avoid; overflow-x: auto; }
.surface { display: block; width: 100%; max-width: 45rem; margin: auto; cursor: grab; \
                     touch-action: none; }
figcaption { color: #444; text-align: center; font-size: .9rem; }
figure svg { display: block; width: 100%; min-width: 40rem; height: auto; }
@media print { figure svg { min-width: 0; } }
table { border-collapse: collapse; }
th, td { text-align: left; vertical-align: top; padding: .2rem 1.2rem .2rem 0; font-weight: 400; \
                     overflow-wrap: anywhere; }
th { opacity: .75; }
.files td { font: .75rem/1.6 ui-monospace, monospace; }
pre { font: .8rem/1.5 ui-monospace, monospace; overflow-x: auto; margin: .5rem 0; }
@media print { body { max-width: none; padding: 0; } pre { white-space: pre-wrap; } }
";

#[cfg(test)]
mod tests {
    use super::*;
    use tactile_imaging::elasticity::modulus::Warning;

    #[test]
    fn text_of_others_stays_text() {
        let name = "<script>alert('a')</script>&\u{202e}\"".to_owned();
        let call = ["tactile".into(), name.clone().into()];
        let mut report = Report::new("r.html".into(), &call, name.clone());
        report.answer(&name);
        report.caution(&name, &name);
        report.row(&name, &name);
        report.line(&name);
        report.table("Known", vec![[name.clone(), name.clone()]]);
        report.inputs([PathBuf::from(&name)]);
        let page = report.html();
        assert!(!page.contains("<script") && !page.contains('\u{202e}'));
        assert_eq!(page.matches("&lt;script&gt;").count(), 11);
        assert!(page.contains("content=\"default-src 'none';"));
    }

    #[test]
    fn a_caution_has_the_remedy_of_its_kind_once() {
        let mut report = Report::new("r.html".into(), &[], String::new());
        let warning = Warning::GuideIgnored;
        for flag in [Flag::TouchesEdge { frame: 0 }, Flag::Assumption { warning }] {
            report.flag(&flag);
            report.flag(&flag);
        }
        let remedies = report.cautions.iter().map(|[_, remedy]| remedy.as_str());
        let begins: Vec<_> = remedies.map(|r| r.split(' ').next().unwrap()).collect();
        assert_eq!(begins, ["Move", "Use"]);
    }

    #[test]
    fn a_word_of_a_call_is_one_word_of_a_shell() {
        assert_eq!(quoted("a/b-1.png"), "a/b-1.png");
        assert_eq!(quoted("it's $1"), r"'it'\''s $1'");
        assert_eq!(quoted(""), "''");
    }
}
