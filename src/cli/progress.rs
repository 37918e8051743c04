//! Progress bars on standard error; silent where that is no terminal.

use indicatif::{ProgressBar, ProgressStyle};
use std::sync::Mutex;
use vernis_metric::descriptor::Progress;

/// One bar that changes its label from stage to stage.
pub struct Bar {
    bar: ProgressBar,
    stage: Mutex<&'static str>,
    #[cfg(feature = "train")]
    started: std::time::Instant,
}

impl Bar {
    pub fn new() -> Self {
        let bar = ProgressBar::new(0);
        if let Ok(style) = ProgressStyle::with_template("{msg:24} [{wide_bar}] {pos}/{len}, {eta} left") {
            bar.set_style(style);
        }
        Self {
            bar,
            stage: Mutex::new(""),
            #[cfg(feature = "train")]
            started: std::time::Instant::now(),
        }
    }

    /// Reports how far `stage` is. May be called from any thread.
    pub fn update(&self, stage: &'static str, progress: Progress) {
        if let Ok(mut current) = self.stage.lock()
            && *current != stage
        {
            *current = stage;
            self.bar.reset();
            self.bar.set_message(stage);
        }
        self.bar.set_length(progress.total as u64);
        // Threads may report out of order; the bar only moves forward.
        if progress.done as u64 > self.bar.position() {
            self.bar.set_position(progress.done as u64);
        }
    }

    /// Shows a stage whose length is not known.
    #[cfg(feature = "train")]
    pub fn stage(&self, label: &'static str) {
        self.update(label, Progress { done: 0, total: 0 });
        self.label(label);
    }

    /// Says what is being done, without a length.
    #[cfg(feature = "train")]
    pub fn label(&self, label: &str) {
        self.bar.set_message(label.to_owned());
        self.bar.tick();
        if self.bar.is_hidden() {
            // Into a log: which stage, and when.
            eprintln!("{:6.1} s  {label}", self.started.elapsed().as_secs_f64());
        }
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
