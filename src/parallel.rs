//! The only file that names rayon: a pool per simulation, work on slabs, sums in a fixed order.
//!
//! Slabs depend on the number of particles alone, so that every sum has the same order, and the
//! results the same bits, whatever the number of threads.

use rayon::prelude::*;

use crate::error::{Code, Error, Result};

/// Threads of one simulation. A pool of its own lives and dies with it: a global pool would leak
/// threads into a host that loads and unloads the library.
#[derive(Debug)]
pub struct Pool(rayon::ThreadPool);

impl Pool {
    /// A pool of `threads` threads; 0 means as many as the machine has cores.
    pub fn new(threads: usize) -> Result<Self> {
        const MOST: usize = 1024;
        if threads > MOST {
            return Err(Error::argument(format!(
                "{threads} threads asked for, at most {MOST} are possible: give 0 for one per core"
            )));
        }
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("urlsph-{i}"))
            .build()
            .map(Self)
            .map_err(|e| {
                Error::new(
                    Code::OutOfMemory,
                    format!("the thread pool did not start: {e}"),
                )
            })
    }

    /// Number of threads.
    pub fn threads(&self) -> usize {
        self.0.current_num_threads()
    }

    /// Runs `work` inside the pool; parallel calls below it use the pool's threads.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.0.install(work)
    }
}

/// Calls `work(index, item)` for all items in parallel; results in the order of the items.
pub fn map_slabs<I: Send, R: Send>(
    slabs: Vec<I>,
    work: impl Fn(usize, I) -> R + Sync + Send,
) -> Vec<R> {
    slabs
        .into_par_iter()
        .enumerate()
        .map(|(i, slab)| work(i, slab))
        .collect()
}

/// Fills a vector from its index, in parallel.
pub fn fill<R: Send>(count: usize, value: impl Fn(usize) -> R + Sync + Send) -> Vec<R> {
    (0..count)
        .into_par_iter()
        .with_min_len(256)
        .map(value)
        .collect()
}

/// Calls `work(row, values)` for all rows of a row-major table.
pub fn for_each_row(
    table: &mut [f64],
    columns: usize,
    work: impl Fn(usize, &mut [f64]) + Sync + Send,
) {
    table
        .par_chunks_exact_mut(columns)
        .with_min_len(256)
        .enumerate()
        .for_each(|(i, row)| work(i, row));
}
