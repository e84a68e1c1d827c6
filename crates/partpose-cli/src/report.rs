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
            note(format_args!("error: {error}"));
            let mut last = error.to_string();
            for cause in error.chain().skip(1).map(ToString::to_string) {
                // A transparent wrapper repeats its source.
                if cause != last {
                    note(format_args!("  caused by: {cause}"));
                }
                last = cause;
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
