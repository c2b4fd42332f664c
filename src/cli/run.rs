//! From the process's arguments to its exit code.

use std::error::Error as _;
use std::ffi::OsString;

use super::args::{Args, Command};
use super::config::Config;
use super::{compare, console, demo, info, interrupt, job, locate, ortho, ortho::ExitStatus};
use crate::{Error, Result};

/// Exit code of a wrong command line.
const USAGE: u8 = 2;

/// Does what the command line `typed` (the program's name first) asks for, prints what is to be said, and returns
/// the exit code: 0 done; 1 done, but photos had to be left out; 2 bad input or usage; 3 over budget; 4 I/O error.
pub fn run(typed: impl IntoIterator<Item = OsString>) -> u8 {
    let args = match Args::from_typed(typed) {
        Ok(args) => args,
        Err(refusal) if refusal.use_stderr() => {
            console::note(&usage_message(&refusal.render().to_string()));
            return USAGE;
        }
        Err(asked_for) => {
            console::answer(&asked_for.render().to_string());
            return 0;
        }
    };
    interrupt::watch();
    match dispatch(args.command) {
        Ok(status) => status.code(),
        Err(error) => {
            console::note(&message(&error));
            error.exit_code()
        }
    }
}

fn dispatch(command: Command) -> Result<ExitStatus> {
    match command {
        Command::Ortho(args) => ortho::run(&Config::build(*args)?),
        Command::Demo(args) => demo::run(&args),
        Command::Info { path, mesh, photos, camera } => {
            // What contradicts itself is described, not refused.
            let options = camera.options(photos, true);
            console::answer(&info::describe(&path, mesh.as_deref(), &options)?);
            Ok(ExitStatus::Done)
        }
        Command::Locate { mosaic, pixel, ground, elevation, cameras, camera } => {
            let options = camera.options(None, true);
            let question = locate::Question {
                mosaic: &mosaic,
                pixels: &pixel,
                grounds: &ground,
                elevation,
                cameras: cameras.as_deref().map(|path| (path, &options)),
            };
            console::answer(&locate::answer(&question)?);
            Ok(ExitStatus::Done)
        }
        Command::Compare { a, b, out } => {
            console::answer(&compare::answer(&a, &b, out.as_deref())?);
            Ok(ExitStatus::Done)
        }
        Command::Plan(args) => job::plan(*args),
        Command::Render(args) => job::render(&args),
        Command::Assemble(args) => job::assemble(&args),
    }
}

/// What clap says is wrong, without its advice on usage and help.
fn usage_message(rendered: &str) -> String {
    let said = rendered.split("\n\nUsage:").next().unwrap_or(rendered);
    let said = said.split("\n\nFor more information").next().unwrap_or(said);
    format!("groundel: {}", said.trim_end())
}

/// The error and its causes on one line, each cause once.
fn message(error: &Error) -> String {
    let mut text = format!("groundel: error: {error}");
    let mut cause = error.source();
    while let Some(inner) = cause {
        let said = inner.to_string();
        // Some messages already end in their cause.
        if !text.ends_with(&said) {
            text = format!("{text}: {said}");
        }
        cause = inner.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;

    #[test]
    fn an_error_is_one_line_with_each_cause_once() {
        let error = Error::io("a.tif", io::Error::other("no space"));
        assert_eq!(message(&error), "groundel: error: a.tif: no space");
    }
}
