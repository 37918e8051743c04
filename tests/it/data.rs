//! Getting, comparing and converting the files of a study.

mod convert;
mod fetch;
mod fuzz;
#[cfg(feature = "fetch")]
mod server;

use std::path::Path;
use std::process::{Command, Output};

/// Runs `vernis data` without a data folder of the environment and without proxies.
fn vernis_data(args: &[&str]) -> Output {
    program(Command::new(env!("CARGO_BIN_EXE_vernis")).arg("data").args(args))
}

fn program(command: &mut Command) -> Output {
    for variable in ["VERNIS_DATA", "VERNIS_CACHE", "HTTP_PROXY", "http_proxy", "ALL_PROXY", "all_proxy"] {
        command.env_remove(variable);
    }
    command.output().expect("the program starts")
}

fn out(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The one line that the program says of what went wrong.
fn error(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(text.lines().count(), 1, "{text}");
    text
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}
