//! The distances of all pairs, on all threads.
//!
//! Rows of one reference are done one after the other, so that it is read and prepared once. Memory: a prepared reference and a
//! candidate a thread.

use super::pairs::Pairs;
use anyhow::Result;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, mpsc};
use vernis_metric::brdf::BrdfSource;
use vernis_metric::metric::{Measured, Metric, PreparedMetrics};

/// One number a metric, or why there is none.
pub type Found = Result<Vec<Measured>, String>;

/// What is compared.
pub struct Scorer<'a> {
    pub pairs: &'a Pairs,
    pub metrics: &'a [Arc<dyn Metric>],
    pub data: Option<&'a Path>,
}

/// A reference that is prepared by the first thread that needs it, and dropped after its last row.
struct Group {
    prepared: Mutex<Slot>,
    left: AtomicUsize,
}

type Slot = Arc<OnceLock<Result<PreparedMetrics, String>>>;

impl Group {
    fn slot(&self) -> Slot {
        self.prepared.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Scorer<'_> {
    /// Calls `take` on this thread with the number of rows that are done, a row, and what was found, as rows finish. It ends early
    /// where `take` says that nobody wants more.
    ///
    /// # Errors
    /// Those of `take`.
    pub fn run(&self, take: &mut dyn FnMut(usize, usize, Found) -> Result<bool>) -> Result<()> {
        let (groups, order) = self.order();
        let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
        let threads = rayon::current_num_threads().min(order.len());
        // No more finished rows wait than threads work.
        let (send, receive) = mpsc::sync_channel(threads);
        let worker = |send: mpsc::SyncSender<(usize, Found)>| {
            loop {
                let Some(&(row, group)) = order.get(next.fetch_add(1, Ordering::Relaxed)) else { return };
                if stop.load(Ordering::Relaxed) || send.send((row, self.row(row, &groups[group]))).is_err() {
                    return;
                }
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..threads {
                let (send, worker) = (send.clone(), &worker);
                scope.spawn(move || worker(send));
            }
            drop(send);
            let taken = receive.iter().enumerate().try_for_each(|(done, (row, found))| match take(done, row, found) {
                Ok(true) => Ok(()),
                Ok(false) => Err(None),
                Err(error) => Err(Some(error)),
            });
            stop.store(true, Ordering::Relaxed);
            drop(receive);
            match taken {
                Err(Some(error)) => Err(error),
                _ => Ok(()),
            }
        })
    }

    /// The groups, and every row with its group in the order of the work: at the place of the first row of a reference stand all.
    fn order(&self) -> (Vec<Group>, Vec<(usize, usize)>) {
        let mut known: BTreeMap<String, usize> = BTreeMap::new();
        let mut members: Vec<Vec<usize>> = Vec::new();
        for (row, pair) in self.pairs.rows.iter().enumerate() {
            let next = members.len();
            let group = match &pair.sources {
                Ok([reference, _]) => *known.entry(reference.identity()).or_insert(next),
                Err(_) => next,
            };
            match members.get_mut(group) {
                Some(rows) => rows.push(row),
                None => members.push(vec![row]),
            }
        }
        let order = members.iter().enumerate().flat_map(|(g, rows)| rows.iter().map(move |&row| (row, g))).collect();
        let group = |rows: &Vec<usize>| Group { prepared: Mutex::default(), left: AtomicUsize::new(rows.len()) };
        (members.iter().map(group).collect(), order)
    }

    fn row(&self, row: usize, group: &Group) -> Found {
        let [reference, candidate] = self.pairs.rows[row].sources.as_ref().map_err(Clone::clone)?;
        let slot = group.slot();
        let prepared = slot.get_or_init(|| self.prepare(reference));
        let found = match prepared {
            Ok(prepared) => self.measure(prepared, candidate),
            Err(reason) => Err(reason.clone()),
        };
        if group.left.fetch_sub(1, Ordering::AcqRel) == 1 {
            *group.prepared.lock().unwrap_or_else(PoisonError::into_inner) = Slot::default();
        }
        found
    }

    fn prepare(&self, reference: &BrdfSource) -> Result<PreparedMetrics, String> {
        let reference = reference.open_unhashed(self.data).map_err(|e| e.to_string())?;
        PreparedMetrics::new(self.metrics, &*reference).map_err(|e| e.to_string())
    }

    fn measure(&self, prepared: &PreparedMetrics, candidate: &BrdfSource) -> Found {
        let candidate = candidate.open_unhashed(self.data).map_err(|e| e.to_string())?;
        prepared.measure(&*candidate).map_err(|e| e.to_string())
    }
}
