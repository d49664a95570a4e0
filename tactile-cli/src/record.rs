//! `tactile stream --record FILE`: records frames and their results.
use crate::failure::Failure;
use ndarray::{ArrayView3, Axis};
use std::fs::File;
use std::io::{BufWriter, Result as IoResult, Write};
use std::path::{Path, PathBuf};

/// A recording that `tactile stream` measures again to the same bits, and a table of the results.
/// Grey frames become a video. Colour frames become a sequence of PPM images, because a video
/// stores colours at half the resolution.
///
/// Both files grow frame by frame. A killed run leaves all frames except perhaps the last.
pub(crate) struct FrameRecorder {
    path: PathBuf,
    video: BufWriter<File>,
    answers: File,
    started: bool,
}

impl FrameRecorder {
    /// Creates both files. An existing file is an error.
    pub(crate) fn create(path: &Path) -> Result<Self, Failure> {
        let create = |path: &Path| {
            File::create_new(path).map_err(|error| {
                Failure::input(format!("cannot record to {}: {error}", path.display()))
            })
        };
        let video = BufWriter::with_capacity(1 << 20, create(path)?);
        let answers = create(&path.with_extension("csv"))?;
        Ok(Self {
            path: path.into(),
            video,
            answers,
            started: false,
        })
    }

    /// Adds a frame of one or three channels, `[row, column, channel]`.
    pub(crate) fn frame(&mut self, frame: ArrayView3<'_, u8>, rate_hz: f64) -> Result<(), Failure> {
        self.written(|recorder| {
            let video = &mut recorder.video;
            let (rows, columns, channels) = frame.dim();
            if channels == 3 {
                write!(video, "P6\n{columns} {rows}\n255\n")?;
            } else {
                if !recorder.started {
                    // The format states the rate as a fraction. Six decimals suffice for all
                    // cameras.
                    let rate = (1e6 * rate_hz).round();
                    writeln!(
                        video,
                        "YUV4MPEG2 W{columns} H{rows} F{rate}:1000000 Ip A1:1 Cmono"
                    )?;
                    recorder.started = true;
                }
                video.write_all(b"FRAME\n")?;
            }
            for row in frame.axis_iter(Axis(0)) {
                match row.as_slice() {
                    Some(row) => video.write_all(row)?,
                    None => row
                        .iter()
                        .try_for_each(|level| video.write_all(&[*level]))?,
                }
            }
            video.flush()
        })
    }

    /// Adds lines to the table of results.
    pub(crate) fn answers(&mut self, lines: &[u8]) -> Result<(), Failure> {
        self.written(|recorder| recorder.answers.write_all(lines))
    }

    fn written(&mut self, write: impl FnOnce(&mut Self) -> IoResult<()>) -> Result<(), Failure> {
        let name = self.path.display().to_string();
        write(self).map_err(|error| Failure::output(format!("cannot record to {name}: {error}")))
    }
}
