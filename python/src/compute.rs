//! Work outside of the interpreter's lock: panics become exceptions, and Ctrl-C ends what is long.

use crate::fault::Fault;
use pyo3::prelude::*;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;
use vernis_metric::io::{Interrupt, Observer, Progress, start_threads};

/// How often long work looks for Ctrl-C and tells its progress.
const PERIOD: Duration = Duration::from_millis(50);

/// What ends a job that has no way to end early: it unwinds from its next report of progress.
struct Abandoned;

fn fault_of(panic: &(dyn Any + Send)) -> Fault {
    let said =
        panic.downcast_ref::<&str>().map(|s| (*s).to_owned()).or_else(|| panic.downcast_ref::<String>().cloned());
    Fault::Failed(format!("a fault of vernis, please report it: {}", said.unwrap_or_else(|| "no message".to_owned())))
}

/// The pool that all work uses, started at its first use.
fn start_workers() -> Result<(), Fault> {
    let advice = "ask for fewer with the variable RAYON_NUM_THREADS, which a process reads once";
    start_threads(None).map_err(|error| Fault::Failed(format!("{error}; {advice}")))
}

/// Runs work of at most some seconds without the lock.
pub fn short<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, Fault> + Send) -> Result<T, Fault> {
    py.detach(|| {
        start_workers()?;
        catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(fault_of(&*panic)))
    })
}

/// Runs work of minutes on a thread of its own. This thread looks for Ctrl-C and calls `progress(stage, done, total)` with the
/// latest news; an exception of either raises the flag that the work is given, and is the result. Work that does not look at the flag
/// ends at its next report of progress.
pub fn long<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(Observer<'_>, &Interrupt) -> Result<T, Fault> + Send,
) -> Result<T, Fault> {
    let interrupt = Interrupt::new();
    let latest: Mutex<Option<(String, Progress)>> = Mutex::new(None);
    let lock = || latest.lock().unwrap_or_else(PoisonError::into_inner);
    let observer = |stage: &str, progress: Progress| {
        if interrupt.is_raised() {
            resume_unwind(Box::new(Abandoned));
        }
        *lock() = Some((stage.to_owned(), progress));
    };
    let tell = |py: Python<'_>| {
        let Some((callback, (stage, p))) = progress.zip(lock().take()) else { return Ok(()) };
        callback.call1(py, (stage, p.done, p.total)).map(drop)
    };
    py.detach(start_workers)?;
    let mut raised = None;
    let finished = py.detach(|| {
        let (sender, receiver) = channel();
        thread::scope(|scope| {
            let worker = scope.spawn(|| {
                let result = catch_unwind(AssertUnwindSafe(|| work(&observer, &interrupt)));
                // The other end waits for it, or has given up the work.
                let _ = sender.send(());
                result
            });
            while receiver.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                if raised.is_some() {
                    continue;
                }
                if let Err(error) = Python::attach(|py| py.check_signals().and_then(|()| tell(py))) {
                    raised = Some(error);
                    interrupt.raise();
                }
            }
            worker.join()
        })
    });
    if let Some(error) = raised {
        return Err(Fault::Python(error));
    }
    // The last news, which say that all is done.
    tell(py)?;
    match finished {
        Ok(Ok(result)) => result,
        Ok(Err(panic)) | Err(panic) => Err(fault_of(&*panic)),
    }
}
