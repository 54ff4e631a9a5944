//! The C ABI: `include/urlsph.h`.
//!
//! Every export is a guard and one call. [`handle::with`] is the guard: it finds the handle, takes
//! its lock without waiting, catches panics, keeps the error, and turns the outcome into a status.
//! [`args`] turns the caller's pointers into checked Rust values.
//!
//! # Promises to the host
//!
//! - A handle is a number in the shape of a pointer, never dereferenced: NULL, stale and foreign
//!   handles are found out by a look into the table of live handles and get a status. That table is
//!   the only process-wide datum, and no simulation can see another through it.
//! - A handle is used by one call at a time; a second call at that moment, from another thread or
//!   from a callback, gets `URLSPH_BUSY` and changes nothing.
//! - A panic is a bug of ours. It is caught, prints nothing, and poisons its handle only.
//! - Structs cross the boundary with their size, so that they can grow at the end: an old caller
//!   gets the fields that it knows.
//!
//! # What the caller owes
//!
//! A pointer that is not NULL is valid for the length that its documentation states, for the time of
//! the call. The exports are `unsafe fn` for this reason only; the header's preamble is their
//! contract, hence no `# Safety` section on each.

#![allow(unsafe_code)]
// Names and spelling are those of the C header.
#![allow(non_camel_case_types)]
#![allow(clippy::missing_safety_doc)]

mod args;
mod callbacks;
mod create;
mod drive;
mod handle;
pub(crate) mod panic;
mod query;
mod state;
mod types;

#[cfg(test)]
mod tests;

pub use create::*;
pub use drive::*;
pub use query::*;
pub use state::*;
pub use types::*;
