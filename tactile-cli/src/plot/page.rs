//! A page of panels, written as one SVG file.
use super::draw::draw_panel;
use super::draw::style::black;
use super::panel::Panel;
use super::svg::{Anchor, Svg};
use std::io;
use std::path::{Path, PathBuf};
use tactile_imaging::io::replace_file;
use tactile_imaging::pipeline::PipelineError;

/// Why a page could not be drawn or written.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressLoad, PressOptions};
/// # let camera = Camera::default().coarser(16);
/// # let options = PressOptions { camera, loads: vec![PressLoad::normal(0.7)], ..PressOptions::default() };
/// # let trial = Trial::new(options, &CalibrationRun::default())?;
/// # let pipeline = trial.pipeline()?;
/// use tactile_cli::plot::{PlotError, save_press_pages};
/// let file = tempfile::NamedTempFile::new()?;
/// let error = save_press_pages(&mut trial.press(&pipeline)?, file.path()).unwrap_err();
/// assert!(matches!(error, PlotError::Write { .. }), "a file is no folder");
/// assert!(error.to_string().starts_with("cannot write "));
/// # Ok(()) }
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// A heat map could not be encoded as a PNG.
    #[error("cannot encode an image of the page `{title}`: {source}")]
    Encode {
        /// Title of the page.
        title: String,
        /// What the encoder said.
        source: io::Error,
    },
    /// The file could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A result to be drawn could not be computed.
    #[error(transparent)]
    Measure(#[from] PipelineError),
}

/// Panels in rows and columns under one title.
#[derive(Clone, Debug)]
pub(crate) struct Page {
    title: String,
    panels: Vec<Panel>,
    columns: usize,
    panel_size: (u32, u32),
}

impl Page {
    /// An empty page, one column, panels of 560 × 420 pixels.
    pub(crate) fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            panels: Vec::new(),
            columns: 1,
            panel_size: (560, 420),
        }
    }

    /// Sets the number of columns (at least one).
    #[must_use]
    pub(crate) fn columns(mut self, columns: usize) -> Self {
        self.columns = columns.max(1);
        self
    }

    /// Sets the size of every panel in pixels (at least 200 × 150).
    #[must_use]
    pub(crate) fn panel_size(mut self, width: u32, height: u32) -> Self {
        self.panel_size = (width.max(200), height.max(150));
        self
    }

    /// Adds a panel: panels fill the rows from left to right.
    #[must_use]
    pub(crate) fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// The page as the text of an SVG file.
    ///
    /// # Errors
    /// [`PlotError::Encode`].
    pub(crate) fn to_svg(&self) -> Result<String, PlotError> {
        self.draw().map_err(|source| PlotError::Encode {
            title: self.title.clone(),
            source,
        })
    }

    /// Writes the page to a file, creating its folder where needed: whole or not at all.
    ///
    /// # Errors
    /// [`PlotError`].
    pub(crate) fn save(&self, path: impl AsRef<Path>) -> Result<(), PlotError> {
        let path = path.as_ref();
        replace_file(path, self.to_svg()?.as_bytes()).map_err(|source| PlotError::Write {
            path: path.into(),
            source,
        })
    }

    fn draw(&self) -> io::Result<String> {
        let rows = self.panels.len().div_ceil(self.columns).max(1) as u32;
        let columns = self.columns as u32;
        let (width, height) = self.panel_size;
        let head = if self.title.is_empty() { 8 } else { 44 };
        let mut svg = Svg::new(width * columns, head + height * rows);
        let middle = 0.5 * f64::from(width * columns);
        svg.text(&black(&self.title, [middle, 24.0], 20.0, Anchor::Middle));
        let size = [f64::from(width), f64::from(height)];
        for (k, panel) in self.panels.iter().enumerate() {
            let (row, column) = (k / self.columns, k % self.columns);
            let corner = [
                column as f64 * size[0],
                f64::from(head) + row as f64 * size[1],
            ];
            draw_panel(&mut svg, panel, corner, size)?;
        }
        Ok(svg.finish())
    }
}
