//! The program `vernis`: all it does is in [`vernis::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(vernis::cli::run(std::env::args_os()))
}
