//! Progress bars on standard error; into a log, which stage began when.

use super::note;
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::Mutex;
use std::time::Instant;
use vernis_metric::io::{Progress, one_line};

/// One bar that changes its label from stage to stage.
pub struct Bar {
    bar: ProgressBar,
    stage: Mutex<String>,
    started: Instant,
}

impl Bar {
    pub fn new() -> Self {
        let bar = ProgressBar::new(0);
        if let Ok(style) = ProgressStyle::with_template("{msg:24} [{wide_bar}] {pos}/{len}, {eta} left") {
            bar.set_style(style);
        }
        Self { bar, stage: Mutex::new(String::new()), started: Instant::now() }
    }

    /// Reports how far `stage` is. May be called from any thread.
    pub fn update(&self, stage: &str, progress: Progress) {
        if let Ok(mut current) = self.stage.lock()
            && *current != stage
        {
            stage.clone_into(&mut current);
            self.bar.reset();
            self.bar.set_message(one_line(stage).into_owned());
            if self.bar.is_hidden() && progress == Progress::BEGUN {
                note(format_args!("{:6.1} s  {stage}", self.started.elapsed().as_secs_f64()));
            }
        }
        self.bar.set_length(progress.total as u64);
        // Threads may report out of order; the bar only moves forward.
        if progress.done as u64 > self.bar.position() {
            self.bar.set_position(progress.done as u64);
        }
        if progress == Progress::BEGUN {
            self.bar.tick();
        }
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.finish();
    }
}
