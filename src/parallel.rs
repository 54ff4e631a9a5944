//! The only file that names rayon: a pool per simulation, work on slabs, sums in a fixed order.
//!
//! Slabs depend on the number of particles alone, so that every sum has the same order, and the
//! results the same bits, whatever the number of threads.

use std::sync::{Mutex, PoisonError, mpsc};
use std::thread::{self, JoinHandle};

use rayon::prelude::*;

use crate::aside::aside;
use crate::error::{Code, Error, Result};

/// Beginning of the names of the pools' threads.
pub const THREAD_NAME_PREFIX: &str = "urlsph-";

/// Threads of one simulation. A pool of its own lives and dies with it: a global pool would leak
/// threads into a host that loads and unloads the library.
#[derive(Debug)]
pub struct Pool {
    /// `None` only while the pool is dropped.
    pool: Option<rayon::ThreadPool>,
    threads: Vec<JoinHandle<()>>,
}

impl Pool {
    /// A pool of `threads` threads; 0 means as many as the machine has cores.
    pub fn new(threads: usize) -> Result<Self> {
        const MOST: usize = 1024;
        const DIED: &str = "a thread died at its start";
        if threads > MOST {
            return Err(Error::argument(format!(
                "{threads} threads asked for, at most {MOST} are possible: give 0 for one per core"
            )));
        }
        let mut this = Self {
            pool: None,
            threads: Vec::new(),
        };
        // Not from the caller's thread, so that a host can unload the library.
        this.pool = Some(aside(|| {
            let (alive, all_alive) = mpsc::channel();
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .spawn_handler(|thread| {
                    let name = format!("{THREAD_NAME_PREFIX}{}", thread.index());
                    let builder = thread::Builder::new().name(name);
                    let alive = alive.clone();
                    this.threads.push(builder.spawn(move || {
                        // Nobody waits any more if another thread did not start.
                        let _ = alive.send(());
                        drop(alive);
                        thread.run();
                    })?);
                    Ok(())
                })
                .build()
                .map_err(not_started)?;
            // Where memory ends, a thread can start and die before it takes any work, which would wait for it for ever.
            drop(alive);
            for _ in &this.threads {
                all_alive.recv().map_err(|_| not_started(DIED))?;
            }
            Ok(pool)
        })?);
        Ok(this)
    }

    fn pool(&self) -> &rayon::ThreadPool {
        self.pool.as_ref().expect("there until the pool is dropped")
    }

    /// Number of threads.
    pub fn threads(&self) -> usize {
        self.pool().current_num_threads()
    }

    /// Runs `work` inside the pool; parallel calls below it use the pool's threads.
    ///
    /// A worker of a host's own pool would do the host's other work while it waits, which may come here again: calls
    /// within calls, until its stack is full. So a thread of its own waits in its place, which takes
    /// 20 microseconds.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        let pool = self.pool();
        if rayon::current_thread_index().is_none() || pool.current_thread_index().is_some() {
            return pool.install(work);
        }
        aside(|| pool.install(work))
    }
}

fn not_started(reason: impl std::fmt::Display) -> Error {
    Error::new(
        Code::OutOfMemory,
        format!("the thread pool did not start: {reason}; ask for fewer threads"),
    )
}

impl Drop for Pool {
    /// Waits for the threads: a host may unload the library, with the code that they run, right after
    /// it has destroyed its last simulation.
    fn drop(&mut self) {
        self.pool = None;
        for thread in self.threads.drain(..) {
            // A panic on it was reported where its work was awaited.
            let _ = thread.join();
        }
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

/// Scratch of each thread of a pool.
#[derive(Debug)]
pub struct PerThread<S>(Vec<Mutex<S>>);

impl<S: Send> PerThread<S> {
    /// For the threads of the pool that it is called in.
    pub fn new(scratch: impl Fn() -> S) -> Self {
        let threads = rayon::current_num_threads();
        Self((0..threads).map(|_| Mutex::new(scratch())).collect())
    }
    /// As [`map_slabs`] with the scratch of the thread that the work runs on. The work must leave nothing
    /// there for later, and calls nothing parallel.
    pub fn map<I: Send, R: Send>(
        &self,
        slabs: Vec<I>,
        work: impl Fn(&mut S, usize, I) -> R + Sync + Send,
    ) -> Vec<R> {
        map_slabs(slabs, |i, slab| {
            // Another pool than that of `new` may have more threads.
            let thread = rayon::current_thread_index().unwrap_or(0) % self.0.len();
            // Whatever a panic left there is overwritten.
            let mut scratch = self.0[thread]
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            work(&mut scratch, i, slab)
        })
    }
    /// Sum over the threads.
    pub fn sum(&self, of: impl Fn(&S) -> usize) -> usize {
        let all = self.0.iter();
        all.map(|s| of(&s.lock().unwrap_or_else(PoisonError::into_inner)))
            .sum()
    }
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
