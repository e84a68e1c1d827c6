//! Images side by side, each on threads of its own.
//!
//! All threads on one image wait for each other at the end of every layer; a thread that has an image to itself does not.
//! Memory grows with the images under way, so they are limited.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

use rayon::ThreadPoolBuilder;

/// Items under way at most.
const MOST: usize = 8;

/// What `work` makes of each item, in their order. The first error ends it; items that are under way are finished.
pub(crate) fn side_by_side<T: Sync, R: Send, E: Send>(
    items: &[T],
    work: impl Fn(&T) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    let threads = rayon::current_num_threads();
    let workers = threads.min(items.len()).min(MOST);
    if workers <= 1 {
        return items.iter().map(work).collect();
    }
    let next = AtomicUsize::new(0);
    let failed = AtomicBool::new(false);
    let take = || -> Result<Vec<(usize, R)>, E> {
        let mut done = Vec::new();
        while !failed.load(Ordering::Relaxed) {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(at) else { break };
            let result = work(item).inspect_err(|_| failed.store(true, Ordering::Relaxed));
            done.push((at, result?));
        }
        Ok(done)
    };
    let share = threads.div_ceil(workers);
    let parts: Result<Vec<_>, E> = thread::scope(|scope| {
        let begin = |_| scope.spawn(|| on_threads(share, &take));
        let running: Vec<_> = (0..workers).map(begin).collect();
        running
            .into_iter()
            .map(|worker| worker.join().unwrap_or_else(|panic| resume_unwind(panic)))
            .collect()
    });
    let mut done: Vec<(usize, R)> = parts?.into_iter().flatten().collect();
    done.sort_by_key(|(at, _)| *at);
    Ok(done.into_iter().map(|(_, result)| result).collect())
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

    #[test]
    fn results_come_in_the_order_of_items() {
        let items: Vec<usize> = (0..50).collect();
        let doubled = side_by_side(&items, |item| Ok::<_, ()>(2 * item));
        assert_eq!(doubled, Ok((0..50).map(|item| 2 * item).collect()));
        assert_eq!(side_by_side(&[0; 0], |item| Ok::<i32, ()>(*item)), Ok(Vec::new()));
    }

    #[test]
    fn an_error_ends_it() {
        let calls = AtomicUsize::new(0);
        let items: Vec<usize> = (0..1000).collect();
        let result = side_by_side(&items, |item| {
            calls.fetch_add(1, Ordering::Relaxed);
            if *item == 3 { Err(*item) } else { Ok(()) }
        });
        assert_eq!(result, Err(3));
        assert!(calls.load(Ordering::Relaxed) < 1000);
    }
}
