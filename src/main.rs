use std::process::ExitCode;

fn main() -> ExitCode {
    vernis::cli::run()
}
