//! The state of an instance outside of it: what an importer keeps for a rollback, and as bytes.

use xxhash_rust::xxh3::xxh3_64;

use super::instance::Phase;
use crate::error::{Code, Error, Result};
use crate::snapshot::Snapshot;

/// First bytes of a serialised state; the digit is the version of the layout.
const MAGIC: &[u8; 16] = b"urlsph-fmustate1";

/// Everything that an instance needs to go on from here.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct State {
    /// Token of the FMU that made it.
    pub token: String,
    pub phase: Phase,
    /// Importer's time at the simulation's time 0 [s].
    pub start: f64,
    /// Importer's time beyond which no step may go [s].
    pub stop: Option<f64>,
    pub parameters: Vec<f64>,
    pub inputs: Vec<Vec<f64>>,
    pub snapshot: Snapshot,
}

impl State {
    /// Little-endian bytes with a checksum at the end.
    pub fn to_bytes(&self) -> Vec<u8> {
        let snapshot = self.snapshot.to_bytes();
        let mut out = Vec::with_capacity(snapshot.len() + 1024);
        out.extend_from_slice(MAGIC);
        put_bytes(&mut out, self.token.as_bytes());
        out.push(self.phase as u8);
        put_numbers(&mut out, &[self.start]);
        put_numbers(&mut out, self.stop.as_slice());
        put_numbers(&mut out, &self.parameters);
        put_length(&mut out, self.inputs.len());
        for input in &self.inputs {
            put_numbers(&mut out, input);
        }
        put_bytes(&mut out, &snapshot);
        let checksum = xxh3_64(&out);
        out.extend_from_slice(&checksum.to_le_bytes());
        out
    }

    /// Reads what [`to_bytes`](Self::to_bytes) wrote.
    ///
    /// # Errors
    /// [`Code::Snapshot`] if truncated, damaged or of another version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let damaged = || {
            Error::new(
                Code::Snapshot,
                "the serialised FMU state is truncated, damaged or of another version of urlsph: \
                 serialise it again",
            )
        };
        let (body, checksum) = bytes.split_last_chunk::<8>().ok_or_else(damaged)?;
        if xxh3_64(body) != u64::from_le_bytes(*checksum) {
            return Err(damaged());
        }
        let mut input = Input(body);
        let state = input.state().ok_or_else(damaged)??;
        if input.0.is_empty() {
            Ok(state)
        } else {
            Err(damaged())
        }
    }
}

fn put_length(out: &mut Vec<u8>, length: usize) {
    out.extend_from_slice(&(length as u64).to_le_bytes());
}

fn put_bytes(out: &mut Vec<u8>, bytes: &[u8]) {
    put_length(out, bytes.len());
    out.extend_from_slice(bytes);
}

fn put_numbers(out: &mut Vec<u8>, numbers: &[f64]) {
    put_length(out, numbers.len());
    out.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
}

/// What is left to read.
struct Input<'a>(&'a [u8]);

impl<'a> Input<'a> {
    fn state(&mut self) -> Option<Result<State>> {
        if self.take(MAGIC.len())? != MAGIC {
            return None;
        }
        let token = String::from_utf8(self.bytes()?.to_vec()).ok()?;
        let phase = Phase::from_number(self.take(1)?[0])?;
        let [start] = self.numbers()?[..] else {
            return None;
        };
        let stop = match self.numbers()?[..] {
            [] => None,
            [stop] => Some(stop),
            _ => return None,
        };
        let parameters = self.numbers()?;
        let inputs = (0..self.length()?)
            .map(|_| self.numbers())
            .collect::<Option<_>>()?;
        let snapshot = self.bytes()?;
        Some(Snapshot::from_bytes(snapshot).map(|snapshot| State {
            token,
            phase,
            start,
            stop,
            parameters,
            inputs,
            snapshot,
        }))
    }
    fn take(&mut self, length: usize) -> Option<&'a [u8]> {
        let (head, tail) = self.0.split_at_checked(length)?;
        self.0 = tail;
        Some(head)
    }
    fn length(&mut self) -> Option<usize> {
        let bytes = self.take(8)?.try_into().ok()?;
        usize::try_from(u64::from_le_bytes(bytes)).ok()
    }
    fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = self.length()?;
        self.take(length)
    }
    fn numbers(&mut self) -> Option<Vec<f64>> {
        let length = self.length()?.checked_mul(8)?;
        let (chunks, _) = self.take(length)?.as_chunks::<8>();
        Some(chunks.iter().map(|c| f64::from_le_bytes(*c)).collect())
    }
}
