//! The command `groundel`: turns what [`groundel::cli`] finds into an exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(groundel::cli::run(std::env::args_os()))
}
