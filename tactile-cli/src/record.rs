//! `tactile stream --record FILE`: the frames as they came, with their answers beside them.
use crate::failure::Failure;
use ndarray::{ArrayView3, Axis};
use std::fs::File;
use std::io::{BufWriter, Result as IoResult, Write};
use std::path::{Path, PathBuf};

/// Frames that `tactile stream` measures again to the same bits, and a table of the answers: a
/// video of grey frames, or PPM images one after the other, for the colours of a video are coarser.
///
/// Both grow frame by frame: a run that is killed leaves all frames but perhaps the last.
pub(crate) struct FrameRecorder {
    path: PathBuf,
    video: BufWriter<File>,
    answers: File,
    started: bool,
}

impl FrameRecorder {
    /// Makes both files. They replace none.
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
                    // A rate is a fraction there. Six decimals hold those of all cameras.
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

    /// Adds lines to the table of answers.
    pub(crate) fn answers(&mut self, lines: &[u8]) -> Result<(), Failure> {
        self.written(|recorder| recorder.answers.write_all(lines))
    }

    fn written(&mut self, write: impl FnOnce(&mut Self) -> IoResult<()>) -> Result<(), Failure> {
        let name = self.path.display().to_string();
        write(self).map_err(|error| Failure::output(format!("cannot record to {name}: {error}")))
    }
}
