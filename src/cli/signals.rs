//! What a command does when it is asked to end, by Ctrl-C (SIGINT) or SIGTERM.
//!
//! A fit ends early and writes its best so far. Commands that keep what they finish say how to go on, and end at once. A second
//! signal always ends the program at once. The exit code is that of shells: 130 for SIGINT, 143 for SIGTERM.

use super::progress::Bar;
use anyhow::Result;
use indicatif::ProgressBar;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;
use vernis_metric::io::Interrupt;

/// How often the flag is looked at.
const PERIOD: Duration = Duration::from_millis(50);

/// A command that was asked to end, and did.
#[derive(Debug)]
pub struct Ended {
    message: String,
    code: u8,
}

impl Ended {
    pub fn code(&self) -> u8 {
        self.code
    }
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Ended {}

/// The signals that ask a command to end, caught.
pub struct Signals {
    interrupt: Interrupt,
    /// The number of the last one.
    last: Arc<AtomicUsize>,
}

impl Signals {
    /// Catches them for a job that looks at [`Signals::interrupt`]; the first one says so on standard error.
    pub fn caught(bar: &Bar) -> Result<Self> {
        let (signals, bar) = (Self { interrupt: Interrupt::new(), last: Arc::default() }, bar.handle());
        signals.watch(move |_| say(&bar, "vernis: ending with the best so far; a second signal ends at once"))?;
        Ok(signals)
    }

    /// The flag that the first signal raises.
    pub fn interrupt(&self) -> Interrupt {
        self.interrupt.clone()
    }

    /// The error of a command that has ended early.
    pub fn ended(&self, message: String) -> Ended {
        Ended { message, code: code(&self.last) }
    }

    /// Calls `told` once, from a thread of its own, with the exit code, after the first signal.
    fn watch(&self, told: impl FnOnce(u8) + Send + 'static) -> Result<()> {
        let (interrupt, last) = (self.interrupt.clone(), self.last.clone());
        // Signals are caught only where somebody will act on them.
        std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
            while !interrupt.is_raised() {
                std::thread::sleep(PERIOD);
            }
            told(code(&last));
        })?;
        for signal in [SIGINT, SIGTERM] {
            let number = usize::try_from(signal)?;
            // In this order: the second signal finds the flag raised by the first.
            flag::register_conditional_shutdown(signal, 128 + signal, self.interrupt.flag())?;
            flag::register_usize(signal, self.last.clone(), number)?;
            flag::register(signal, self.interrupt.flag())?;
        }
        Ok(())
    }
}

/// Of a command that keeps what it finishes as it goes: a signal ends it at once, with a message. `kept` says what is kept, and where.
pub fn resumable(bar: &Bar, kept: String) -> Result<()> {
    let bar = bar.handle();
    let signals = Signals { interrupt: Interrupt::new(), last: Arc::default() };
    signals.watch(move |code| {
        say(&bar, &format!("vernis: interrupted; {kept}"));
        std::process::exit(i32::from(code));
    })
}

fn code(last: &AtomicUsize) -> u8 {
    u8::try_from(128 + last.load(Ordering::Relaxed)).unwrap_or(130)
}

/// One line on standard error, without the bar.
fn say(bar: &ProgressBar, line: &str) {
    bar.finish_and_clear();
    super::note(line);
}
