//! Resources of every subcommand: the standard streams, Ctrl-C, the memory limit and progress bars.
use crate::failure::{Exit, Failure};
use crate::outputs::Outputs;
use crate::text::printable;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use serde_json::{Value, json};
use std::fmt::Display;
use std::io::{BufWriter, ErrorKind, Write, stderr, stdout};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};
use tactile_files::scene::Scene;
use tactile_imaging::core::Progress;
use tactile_imaging::pipeline::Flag;

/// The standard streams, Ctrl-C, the memory limit and the files to be written.
pub(crate) struct Context {
    /// One JSON object instead of text.
    pub json: bool,
    /// JSON Lines: one object per line, with that of the whole result at the end.
    pub lines: bool,
    pub interrupt: Interrupt,
    pub outputs: Outputs,
    /// The subcommand, for the JSON object.
    command: String,
    /// All cautions of the result, in the format of its JSON object.
    cautions: Vec<Value>,
    reader_left: bool,
    error: Option<std::io::Error>,
}

/// The version of the JSON objects that `docs/json.md` describes.
const SCHEMA: &str = "tactile-2";

/// The output of `--json`: the result of a subcommand, and the common fields.
#[derive(Serialize)]
struct Envelope<'a, T> {
    schema: &'a str,
    command: &'a str,
    #[serde(flatten)]
    answer: &'a T,
    cautions: &'a [Value],
}

impl Context {
    pub(crate) fn new(command: String, json: bool, outputs: Outputs) -> Self {
        Self {
            command,
            cautions: Vec::new(),
            json,
            lines: false,
            interrupt: Interrupt::install(),
            outputs,
            reader_left: false,
            error: None,
        }
    }

    /// Prints a line of the result, unless JSON is requested. If the reader of the output closes it
    /// (`| head -1`), only the printing ends, not the program.
    pub(crate) fn line(&mut self, text: impl Display) {
        let text = text.to_string();
        if let Some(report) = &mut self.outputs.report {
            report.line(&text);
        }
        self.aside(text);
    }

    /// Prints information on the speed of the computation, which is not part of a report.
    pub(crate) fn aside(&mut self, text: impl Display) {
        if self.json || self.reader_left || self.error.is_some() {
            return;
        }
        let text = text.to_string();
        let lines: Vec<String> = text.split('\n').map(printable).collect();
        if let Err(error) = writeln!(stdout(), "{}", lines.join("\n")) {
            self.keep(error);
        }
    }

    /// Prints a line of a name and its value.
    pub(crate) fn row(&mut self, name: &str, value: impl Display) {
        let value = value.to_string();
        if let Some(report) = &mut self.outputs.report {
            report.row(name, &value);
        }
        self.aside(format_args!("{name:<18}{value}"));
    }

    /// Prints a line with a name and its value, as the main result of the call.
    pub(crate) fn answer(&mut self, name: &str, value: impl Display) {
        let value = value.to_string();
        if let Some(report) = &mut self.outputs.report {
            report.answer(format!("{name}: {value}"));
        }
        self.row(name, value);
    }

    /// A sentence about an omitted input, for the terminal, the report and the JSON object.
    pub(crate) fn caution(&mut self, text: impl Display) {
        let text = text.to_string();
        self.cautions
            .push(json!({ "kind": "input_left_out", "text": text }));
        if let Some(report) = &mut self.outputs.report {
            report.caution(&text, "");
        }
        self.note(text);
    }

    /// Prints a caution about the result, and stores it for the JSON object: a kind, its numbers
    /// (an object, or null) and its sentence.
    pub(crate) fn warn(&mut self, kind: &str, numbers: Value, sentence: impl Display) {
        let sentence = sentence.to_string();
        if let Some(report) = &mut self.outputs.report {
            report.caution(&sentence, kind);
        }
        self.aside(format_args!("{:<18}{sentence}", "caution"));
        let mut caution = json!({ "kind": kind, "text": sentence });
        if let (Value::Object(caution), Value::Object(mut numbers)) = (&mut caution, numbers) {
            caution.append(&mut numbers);
        }
        self.cautions.push(caution);
    }

    /// A caution if nothing shows that the lamps are those of the calibration.
    pub(crate) fn warn_of_light(&mut self, scene: &Scene) {
        if scene.takes_light_as_unchanged() {
            self.warn_of_unknown_light("reference under [calibration]), or add a [[check]]");
        }
    }

    /// Warns that the light of the calibration is unknown; `how` to state it.
    pub(crate) fn warn_of_unknown_light(&mut self, how: &str) {
        let sentence = format!(
            "forces assume the lamps of the calibration: state its frame without contact ({how}"
        );
        self.warn("calibration_light_unknown", Value::Null, sentence);
    }

    /// The cautions about a frame, one per line, below the name of the frame.
    pub(crate) fn warn_of_frame(&mut self, flags: &[Flag]) {
        for flag in flags {
            self.aside(format_args!("{:<18}{}", "caution", flag.without_frame()));
        }
        self.keep_cautions(flags);
    }

    /// Stores printed cautions for the JSON object. The first frame is frame 1.
    pub(crate) fn keep_cautions(&mut self, flags: &[Flag]) {
        for flag in flags {
            let flag = &flag.clone().numbered_from(1);
            if let Some(report) = &mut self.outputs.report {
                report.flag(flag);
            }
            let mut caution = serde_json::to_value(flag).unwrap_or_default();
            caution["text"] = json!(flag.to_string());
            self.cautions.push(caution);
        }
    }

    /// Prints the result as JSON, if requested, with the cautions so far.
    pub(crate) fn value(&mut self, answer: &impl Serialize) {
        let cautions = std::mem::take(&mut self.cautions);
        let command = self.command.clone();
        self.print_json(&Envelope {
            schema: SCHEMA,
            command: &command,
            answer,
            cautions: &cautions,
        });
        self.cautions = cautions;
    }

    /// Prints a value as JSON, if requested.
    pub(crate) fn print_json(&mut self, value: &impl Serialize) {
        if !self.json || self.reader_left || self.error.is_some() {
            return;
        }
        // The value is written number by number, because the text of the result of many frames
        // would double the memory.
        let mut output = BufWriter::new(stdout().lock());
        let written = match self.lines {
            true => serde_json::to_writer(&mut output, value),
            false => serde_json::to_writer_pretty(&mut output, value),
        };
        let written = written
            .map_err(std::io::Error::from)
            .and_then(|()| writeln!(output))
            .and_then(|()| output.flush());
        drop(output);
        if let Err(error) = written {
            self.keep(error);
        }
    }

    /// A sentence for the user on standard error.
    pub(crate) fn note(&self, text: impl Display) {
        // A closed standard error is ignored.
        let _ = writeln!(stderr(), "tactile: {}", printable(&text.to_string()));
    }

    /// An error if a job needs more memory than allowed. `job` is its name and size, `remedy` the
    /// advice in the message.
    pub(crate) fn allow(&self, bytes: f64, job: &str, remedy: &str) -> Result<(), Failure> {
        self.outputs.allow(bytes, job, remedy)
    }

    /// For computations that stop after Ctrl-C.
    pub(crate) fn watch(&self) -> impl Fn() -> ControlFlow<()> + Send + Sync + 'static {
        let interrupt = self.interrupt.clone();
        move || interrupt.flow()
    }

    /// Runs a job that checks for Ctrl-C itself, many times a second, with the elapsed time on the
    /// terminal. Returns `None` after Ctrl-C.
    pub(crate) fn wait<R>(
        &self,
        job: impl Into<String>,
        work: impl FnOnce(&Interrupt) -> R,
    ) -> Option<R> {
        let _clock = Bar::clock(job);
        self.interrupt.polled(true);
        let result = work(&self.interrupt);
        // The following work is short or checks for Ctrl-C itself.
        self.interrupt.polled(false);
        (!self.interrupt.requested()).then_some(result)
    }

    /// Runs a search for inclusions with its progress. Ctrl-C stops it.
    pub(crate) fn reported<T>(
        &self,
        name: &'static str,
        search: impl FnOnce(&mut dyn FnMut(Progress) -> ControlFlow<()>) -> T,
    ) -> T {
        let mut progress: Option<Bar> = None;
        self.interrupt.polled(true);
        let found = search(&mut |now| {
            let bar = progress.get_or_insert_with(|| Bar::of(now.total, name));
            bar.done(now.done);
            self.interrupt.flow()
        });
        self.interrupt.polled(false);
        found
    }

    /// Writes the files of a call that has its result, and returns the exit code.
    pub(crate) fn close(mut self, ended: Result<Exit, Failure>) -> Exit {
        // The result has already been printed, so that an unwritable folder loses nothing.
        let ended = ended.and_then(|exit| {
            self.outputs.finish_report();
            let [written, kept] = {
                let _whole = self.interrupt.writing.lock();
                self.outputs.write(self.interrupt.requested())?
            };
            if !written.is_empty() {
                self.line(format_args!("wrote {}", written.join(", ")));
            }
            if !kept.is_empty() {
                let kept = kept.join(", ");
                self.note(format_args!("stopped: kept the earlier {kept}"));
            }
            Ok(exit)
        });
        let exit = ended.unwrap_or_else(|failure| {
            self.note(&failure);
            failure.exit
        });
        if let Err(error) = stdout().flush() {
            self.keep(error);
        }
        match &self.error {
            Some(error) => {
                self.note(format_args!("cannot write to standard output: {error}"));
                Exit::Output
            }
            // Partial results of an interrupted run must not look complete.
            None if self.interrupt.requested() => Exit::Interrupted,
            None => exit,
        }
    }

    fn keep(&mut self, error: std::io::Error) {
        // A closed pipe is not a failure, but a full disk is.
        if error.kind() == ErrorKind::BrokenPipe {
            self.reader_left = true;
        } else if self.error.is_none() {
            self.error = Some(error);
        }
    }
}

/// Ctrl-C, termination or a closed terminal. Computations that poll it stop with their results so
/// far, and others end immediately. A second signal always ends the program.
#[derive(Clone, Default)]
pub(crate) struct Interrupt {
    requested: Arc<AtomicBool>,
    polled: Arc<AtomicBool>,
    /// Locked while files are renamed.
    writing: Arc<Mutex<()>>,
}

impl Interrupt {
    /// Installs the handler of the signals. If the system does not allow a handler, the signals end
    /// the program, as usual. Under `nohup`, which protects a program from a closed terminal, they
    /// keep their meaning.
    fn install() -> Self {
        let interrupt = Self::default();
        if hang_up_is_ignored() {
            return interrupt;
        }
        let copy = interrupt.clone();
        let _ = ctrlc::set_handler(move || {
            let again = copy.requested.swap(true, Ordering::SeqCst);
            if again || !copy.polled.load(Ordering::SeqCst) {
                // A file that replaces another has a temporary name for a moment.
                let _whole = (!again).then(|| copy.writing.lock());
                std::process::exit(Exit::Interrupted.code().into());
            }
        });
        interrupt
    }

    pub(crate) fn requested(&self) -> bool {
        self.requested.load(Ordering::SeqCst)
    }

    /// Whether a job should continue.
    pub(crate) fn flow(&self) -> ControlFlow<()> {
        if self.requested() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// States whether the following computation polls [`requested`](Self::requested).
    pub(crate) fn polled(&self, polled: bool) {
        self.polled.store(polled, Ordering::SeqCst);
    }
}

/// Whether the program was started with the signal of a closed terminal switched off.
fn hang_up_is_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status
        .lines()
        .find_map(|line| line.strip_prefix("SigIgn:"))
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    // SIGHUP is signal 1, the mask's lowest bit.
    ignored.is_some_and(|mask| mask & 1 == 1)
}

/// A progress bar for a job of more than a second. It is hidden if standard error is not a
/// terminal.
pub(crate) struct Bar {
    bar: ProgressBar,
    started: Instant,
    shown: bool,
    /// Dropped at the end, for which the thread of a clock waits.
    end: Option<mpsc::Sender<()>>,
}

impl Bar {
    /// Creates a bar for a job of `total` steps.
    pub(crate) fn of(total: usize, job: impl Into<String>) -> Self {
        let bar = ProgressBar::with_draw_target(Some(total as u64), ProgressDrawTarget::hidden());
        Self::styled(bar, "{msg} [{bar:32}] {percent} %, {eta} left", job)
    }

    /// Creates a clock for a job that does not report its progress.
    pub(crate) fn clock(job: impl Into<String>) -> Self {
        let mut progress = Self::styled(ProgressBar::hidden(), "{spinner} {msg}, {elapsed}", job);
        let bar = progress.bar.clone();
        let (end, ended) = mpsc::channel::<()>();
        progress.end = Some(end);
        // Without a thread there is no clock.
        let _ = std::thread::Builder::new().spawn(move || {
            let still_runs = Err(mpsc::RecvTimeoutError::Timeout);
            if ended.recv_timeout(Duration::from_secs(1)) == still_runs {
                bar.set_draw_target(ProgressDrawTarget::stderr());
                bar.enable_steady_tick(Duration::from_millis(200));
            }
        });
        progress
    }

    fn styled(bar: ProgressBar, template: &str, job: impl Into<String>) -> Self {
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(printable(&job.into()));
        Self {
            bar,
            started: Instant::now(),
            shown: false,
            end: None,
        }
    }

    /// Shows the number of completed steps.
    pub(crate) fn done(&mut self, steps: usize) {
        self.bar.set_position(steps as u64);
        if !self.shown && self.started.elapsed() > Duration::from_secs(1) {
            self.shown = true;
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.end = None;
        self.bar.finish_and_clear();
    }
}

/// The median of repeated times in milliseconds.
pub(crate) fn median_ms(mut times: Vec<Duration>) -> f64 {
    times.sort_unstable();
    let middle = times.get(times.len() / 2);
    middle.map_or(0.0, |t| t.as_secs_f64() * 1e3)
}
