//! What the user reads when something is wrong, and the exit code that follows.
//!
//! stdout carries data only; everything here goes to stderr. 0: done; 1: done, but something was skipped; 2: could not
//! be done.

use std::fmt;
use std::io::{self, Write};
use std::process::ExitCode;

use partpose::vehicle::ZooError;

/// How a command ended when it did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// All of it was done.
    Done,
    /// Something was reported and skipped, the rest was done.
    Skipped,
}

/// An error with advice on what to do about it.
#[derive(Debug)]
struct Hinted {
    hint: String,
    error: anyhow::Error,
}

impl fmt::Display for Hinted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.error.fmt(f)
    }
}

impl std::error::Error for Hinted {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.error.chain().nth(1)
    }
}

/// Adds advice to an error.
pub(crate) fn hint(error: impl Into<anyhow::Error>, hint: impl Into<String>) -> anyhow::Error {
    Hinted { hint: hint.into(), error: error.into() }.into()
}

/// Writes a message to stderr; a closed stderr is nobody's loss.
pub(crate) fn note(message: impl fmt::Display) {
    let _ = writeln!(io::stderr(), "{message}");
}

/// Reports something that was skipped.
pub(crate) fn warn(message: impl fmt::Display) {
    note(format_args!("warning: {message}"));
}

/// Reports something that was skipped because of an error, with all its causes.
pub(crate) fn warn_error(context: impl fmt::Display, error: &(dyn std::error::Error + 'static)) {
    warn(format_args!("{context}: {}", messages(error).join(": ")));
}

/// What an error and its causes say, outermost first, without what has been said already.
fn messages(error: &(dyn std::error::Error + 'static)) -> Vec<String> {
    let mut messages: Vec<String> = Vec::new();
    for cause in anyhow::Chain::new(error).map(ToString::to_string) {
        // A transparent wrapper repeats its source, and some write it behind their own words.
        if !messages.last().is_some_and(|last| last.ends_with(&cause)) {
            messages.push(cause);
        }
    }
    messages
}

/// Writes data to stdout; a closed pipe is success, as `partpose ... | head` expects.
pub(crate) fn data(text: &str) -> anyhow::Result<()> {
    match io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other?),
    }
}

/// Reports a failure and gives the exit code.
pub(crate) fn exit_code(outcome: anyhow::Result<Outcome>) -> ExitCode {
    match outcome {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Skipped) => ExitCode::from(1),
        Err(error) => {
            for (depth, message) in messages(error.as_ref()).iter().enumerate() {
                let label = if depth == 0 { "error" } else { "  caused by" };
                note(format_args!("{label}: {message}"));
            }
            for cause in error.chain() {
                if let Some(hinted) = cause.downcast_ref::<Hinted>() {
                    note(format_args!("hint: {}", hinted.hint));
                }
                if let Some(remedy) = cause.downcast_ref::<ZooError>().and_then(ZooError::remedy) {
                    note(format_args!("hint: {remedy}"));
                }
            }
            ExitCode::from(2)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use partpose::files;

    #[test]
    fn every_cause_of_an_error_is_told_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let image = files::RgbImage { size: [9, 9], pixels: (0..243).collect() };
        let png = files::encode_png(&image);
        files::write(&path, &png[..png.len() / 2]).unwrap();
        // Transparent wrapper, our words, the decoder's words, which end with their own cause.
        let error = partpose::dataset::DatasetError::from(files::read_rgb(&path).unwrap_err());
        let messages = messages(&error);
        assert_eq!(messages[0], format!("cannot decode the image `{}`", path.display()));
        assert_eq!(messages.len(), 2, "{messages:?}");
        assert!(messages[1].contains("unexpected"), "{messages:?}");
    }
}
