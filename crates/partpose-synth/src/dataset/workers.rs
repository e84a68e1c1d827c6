//! Threads that take one frame after the other.
//!
//! Each has a pool of one thread for what the drawing of a frame does in parallel, so that nobody begins a frame while
//! waiting for another: as many frames are in work as there are threads, and memory is bounded by that.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::SynthError;

pub(super) struct Workers {
    pools: Vec<ThreadPool>,
}

impl Workers {
    /// So many threads, 0 for as many as there are processors.
    pub(super) fn new(threads: usize) -> Result<Self, SynthError> {
        let threads = if threads == 0 { rayon::current_num_threads() } else { threads };
        let pool = |_| {
            let pool = ThreadPoolBuilder::new().num_threads(1).build();
            pool.map_err(|source| SynthError::Threads { threads, source })
        };
        Ok(Self { pools: (0..threads).map(pool).collect::<Result<_, _>>()? })
    }

    /// Does jobs 0 to `count` - 1, begun in this order. After an error no more are begun, and it is returned.
    pub(super) fn run(
        &self,
        count: usize,
        job: &(dyn Fn(usize) -> Result<(), SynthError> + Sync),
    ) -> Result<(), SynthError> {
        let next = AtomicUsize::new(0);
        let stopped = AtomicBool::new(false);
        let failure: Mutex<Option<SynthError>> = Mutex::new(None);
        let work = |pool: &ThreadPool| {
            while !stopped.load(Ordering::Relaxed) {
                let at = next.fetch_add(1, Ordering::Relaxed);
                if at >= count {
                    return;
                }
                if let Err(error) = pool.install(|| job(at)) {
                    stopped.store(true, Ordering::Relaxed);
                    failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
                }
            }
        };
        std::thread::scope(|scope| {
            for pool in self.pools.iter().take(count) {
                scope.spawn(|| work(pool));
            }
        });
        failure.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_job_is_done_once_and_an_error_stops_the_rest() {
        let done: Vec<AtomicUsize> = (0..50).map(|_| AtomicUsize::new(0)).collect();
        let workers = Workers::new(3).unwrap();
        workers
            .run(done.len(), &|at| {
                done[at].fetch_add(1, Ordering::Relaxed);
                Ok(())
            })
            .unwrap();
        assert!(done.iter().all(|count| count.load(Ordering::Relaxed) == 1));
        let begun = AtomicUsize::new(0);
        let error = workers.run(1000, &|_| {
            begun.fetch_add(1, Ordering::Relaxed);
            Err(SynthError::NoVehicles)
        });
        assert!(matches!(error, Err(SynthError::NoVehicles)));
        assert!(begun.into_inner() <= 3);
    }
}
