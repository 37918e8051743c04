//! How far a task has come, told to whoever wants to know; nothing here prints.

/// How much of a stage is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Progress {
    /// How many units of work are done.
    pub done: usize,
    /// 0 where nobody knows.
    pub total: usize,
}

impl Progress {
    /// A stage begins whose length is not known.
    pub const BEGUN: Self = Self { done: 0, total: 0 };
}

/// Called with the name of a stage and how far it is, from any thread.
pub type Observer<'a> = &'a (dyn Fn(&str, Progress) + Sync);

/// An observer for those who do not want to know.
pub fn silent(_stage: &str, _progress: Progress) {}
