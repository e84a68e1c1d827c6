//! Images side by side, each on threads of its own.
//!
//! All threads on one image wait for each other at the end of every layer; a thread that has an image to itself does not.
//! Memory grows with the images under way, so they are limited.

use std::panic::resume_unwind;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

use rayon::ThreadPoolBuilder;

/// Items under way at most, unless more are asked for.
const MOST: usize = 8;

/// How many images are under way at once.
#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct JobsFlag {
    /// Images under way at once; more need more memory [default: one a processor and 8 at most, 1 with another `--device`
    /// than `cpu`]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
}

impl JobsFlag {
    /// `shared` tells whether all images go through one device, whose memory each of them needs for itself.
    pub(crate) fn count(&self, shared: bool) -> usize {
        let usual = if shared { 1 } else { rayon::current_num_threads().min(MOST) };
        self.jobs.map_or(usual, usize::from)
    }
}

/// What `work` makes of each item, in their order, `jobs` of them under way at once.
///
/// The first error ends it, and so does a panic; items that are under way are finished.
pub(crate) fn side_by_side<T: Sync, R: Send, E: Send + Sync>(
    items: &[T],
    jobs: usize,
    work: impl Fn(&T) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    let threads = rayon::current_num_threads();
    let workers = jobs.min(items.len());
    if workers <= 1 {
        return items.iter().map(work).collect();
    }
    let next = AtomicUsize::new(0);
    let ended = AtomicBool::new(false);
    let first_error = OnceLock::new();
    let take = &|| {
        let _panics = EndsOnPanic(&ended);
        let mut done = Vec::new();
        while !ended.load(Ordering::Relaxed) {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(at) else { break };
            match work(item) {
                Ok(result) => done.push((at, result)),
                Err(error) => {
                    // Another may have been faster.
                    let _ = first_error.set(error);
                    ended.store(true, Ordering::Relaxed);
                }
            }
        }
        done
    };
    let mut done: Vec<(usize, R)> = thread::scope(|scope| {
        // Where the system gives no more threads, those that there are do it; this one always.
        let running: Vec<_> = (1..workers)
            .map_while(|worker| {
                let share = share(threads, workers, worker);
                let begin = move || on_threads(share, take);
                thread::Builder::new().spawn_scoped(scope, begin).ok()
            })
            .collect();
        let mut done = on_threads(share(threads, workers, 0), take);
        for worker in running {
            done.extend(worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
        }
        done
    });
    if let Some(error) = first_error.into_inner() {
        return Err(error);
    }
    done.sort_by_key(|(at, _)| *at);
    Ok(done.into_iter().map(|(_, result)| result).collect())
}

/// Threads of a worker, at least one: together as many as there are.
fn share(threads: usize, workers: usize, worker: usize) -> usize {
    (threads / workers + usize::from(worker < threads % workers)).max(1)
}

/// Tells the others that a worker panicked: a bug, after which their work would be thrown away.
struct EndsOnPanic<'a>(&'a AtomicBool);

impl Drop for EndsOnPanic<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

/// Runs `work` in a pool of some threads; in the common one where the system gives no more threads.
fn on_threads<R: Send>(threads: usize, work: &(impl Fn() -> R + Sync)) -> R {
    match ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(work),
        Err(_) => work(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::time::Duration;

    #[test]
    fn results_come_in_the_order_of_items() {
        let items: Vec<usize> = (0..50).collect();
        for jobs in [1, 2, 7, 80] {
            let doubled = side_by_side(&items, jobs, |item| Ok::<_, ()>(2 * item));
            assert_eq!(doubled, Ok((0..50).map(|item| 2 * item).collect()));
        }
        assert_eq!(side_by_side(&[0; 0], 4, |item| Ok::<i32, ()>(*item)), Ok(Vec::new()));
    }

    #[test]
    fn an_error_ends_it() {
        let calls = AtomicUsize::new(0);
        let items: Vec<usize> = (0..1000).collect();
        let result = side_by_side(&items, 4, |item| {
            calls.fetch_add(1, Ordering::Relaxed);
            if *item == 3 { Err(*item) } else { Ok(()) }
        });
        assert_eq!(result, Err(3));
        assert!(calls.load(Ordering::Relaxed) < 1000);
    }

    #[test]
    fn the_error_is_the_first_in_time() {
        let failed = AtomicBool::new(false);
        let items: Vec<usize> = (0..20).collect();
        let result = side_by_side::<_, (), _>(&items, 2, |item| match item {
            // The first item fails only after the second did.
            0 => {
                while !failed.load(Ordering::Relaxed) {
                    thread::sleep(Duration::from_millis(1));
                }
                thread::sleep(Duration::from_millis(20));
                Err(0)
            }
            other => {
                failed.store(true, Ordering::Relaxed);
                Err(*other)
            }
        });
        assert_eq!(result, Err(1));
    }

    #[test]
    fn a_panic_ends_it() {
        let calls = AtomicUsize::new(0);
        let items: Vec<usize> = (0..1000).collect();
        let work = |item: &usize| {
            calls.fetch_add(1, Ordering::Relaxed);
            assert!(*item != 3, "this one is broken");
            thread::sleep(Duration::from_millis(1));
            Ok::<_, ()>(())
        };
        let result = catch_unwind(AssertUnwindSafe(|| side_by_side(&items, 4, work)));
        assert!(result.is_err() && calls.load(Ordering::Relaxed) < 1000);
    }

    #[test]
    fn a_shared_device_gets_one_image_at_once_unless_told_otherwise() {
        let usual = JobsFlag::default();
        assert_eq!(usual.count(true), 1);
        assert_eq!(usual.count(false), rayon::current_num_threads().min(MOST));
        let told = JobsFlag { jobs: Some(12) };
        assert_eq!([told.count(true), told.count(false)], [12, 12]);
    }

    #[test]
    fn workers_share_the_threads() {
        for (threads, workers) in [(8, 8), (9, 8), (15, 8), (17, 8), (5, 3), (2, 2)] {
            let shares = (0..workers).map(|worker| share(threads, workers, worker));
            assert_eq!(shares.sum::<usize>(), threads, "{threads} {workers}");
        }
        assert_eq!(share(2, 3, 2), 1);
    }
}
