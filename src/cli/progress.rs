//! Progress bars on standard error; into a log, which stage began when.

use super::note;
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::Mutex;
use std::time::Instant;
use vernis_metric::io::{Progress, one_line};

/// One bar that changes its label from stage to stage.
pub struct Bar {
    bar: ProgressBar,
    shown: Mutex<Shown>,
    started: Instant,
}

/// What the bar shows now.
#[derive(Default)]
struct Shown {
    stage: String,
    form: Option<Form>,
}

/// How a stage is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// Nothing is counted yet.
    Begun,
    /// Nobody knows how much there is.
    Open,
    /// So much of so much.
    Counted,
}

impl Form {
    fn of(progress: Progress) -> Self {
        match progress {
            Progress { total: 0, done: 0 } => Self::Begun,
            Progress { total: 0, .. } => Self::Open,
            _ => Self::Counted,
        }
    }

    fn template(self) -> &'static str {
        match self {
            Self::Begun => "{msg:24} {elapsed}",
            Self::Open => "{msg:24} {pos} done, {elapsed}",
            Self::Counted => "{msg:24} [{wide_bar}] {pos}/{len}, {eta} left",
        }
    }
}

impl Bar {
    pub fn new() -> Self {
        let bar = Self { bar: ProgressBar::new(0), shown: Mutex::default(), started: Instant::now() };
        bar.show_as(Form::Begun);
        bar
    }

    /// Reports how far `stage` is. May be called from any thread.
    pub fn update(&self, stage: &str, progress: Progress) {
        let Ok(mut shown) = self.shown.lock() else { return };
        if shown.stage != stage {
            stage.clone_into(&mut shown.stage);
            // A length that belongs to the stage before is not shown for this one.
            shown.form = None;
            self.show_as(Form::Begun);
            self.bar.reset();
            if self.bar.is_hidden() && progress == Progress::BEGUN {
                note(format_args!("{:6.1} s  {stage}", self.started.elapsed().as_secs_f64()));
            }
        }
        if progress.total > 0 {
            self.bar.set_length(progress.total as u64);
        }
        let form = Form::of(progress);
        if shown.form != Some(form) {
            self.show_as(form);
            self.bar.set_message(one_line(stage).into_owned());
            shown.form = Some(form);
        }
        // Threads may report out of order; the bar only moves forward.
        if progress.done as u64 > self.bar.position() {
            self.bar.set_position(progress.done as u64);
        }
        if progress == Progress::BEGUN {
            self.bar.tick();
        }
    }

    /// Writes a line on standard error, above the bar.
    pub fn line(&self, text: &str) {
        self.bar.suspend(|| note(text));
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    /// The bar itself, for who must clear it from another thread.
    pub fn handle(&self) -> ProgressBar {
        self.bar.clone()
    }

    /// Draws nothing by itself.
    fn show_as(&self, form: Form) {
        if let Ok(style) = ProgressStyle::with_template(form.template()) {
            self.bar.set_style(style);
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.finish();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_is_shown_only_where_it_is_known() {
        for (done, total, expected) in
            [(0, 0, Form::Begun), (7, 0, Form::Open), (0, 3, Form::Counted), (3, 3, Form::Counted)]
        {
            assert_eq!(Form::of(Progress { done, total }), expected);
        }
        for form in [Form::Begun, Form::Open, Form::Counted] {
            assert_eq!(form.template().contains("{len}"), form == Form::Counted);
            assert!(ProgressStyle::with_template(form.template()).is_ok());
        }
    }
}
