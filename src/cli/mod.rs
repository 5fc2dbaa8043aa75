//! The command line: the only code that prints, and that picks exit codes.

mod args;
mod commands;
mod inspect;
mod send;
mod show;
mod template;
mod watch;

use std::{
    process::ExitCode,
    sync::atomic::{AtomicBool, Ordering},
};

use clap::Parser;

/// Exit codes of CONTRACT.md.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Exit {
    Done = 0,
    ChecksFailed = 1,
    Usage = 2,
    Input = 3,
    Output = 4,
    Machine = 5,
    Interrupted = 130,
}

/// Set by Ctrl-C and SIGTERM; every long computation polls it.
static CANCEL: AtomicBool = AtomicBool::new(false);

/// Parses the command line, runs the command, and says how it ended.
pub fn main() -> ExitCode {
    let args = match args::Args::try_parse() {
        Ok(args) => args,
        Err(err) => {
            // clap prints help and version to stdout and complaints to stderr; only the latter are usage errors.
            let code = if err.use_stderr() { Exit::Usage } else { Exit::Done };
            return match err.print() {
                Ok(()) => ExitCode::from(code as u8),
                Err(_) => ExitCode::from(Exit::Output as u8),
            };
        }
    };
    if let Err(err) = ctrlc::set_handler(|| CANCEL.store(true, Ordering::Relaxed)) {
        show::warning(&format!("Ctrl-C cannot be caught ({err}); it will end the program at once"));
    }
    ExitCode::from(commands::run(args) as u8)
}
