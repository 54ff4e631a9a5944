//! Snapshots: the complete state in memory, and as bytes with a version and a checksum.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::Path;

use xxhash_rust::xxh3::{Xxh3, xxh3_64};

use crate::boundary::{InputValues, WallState};
use crate::error::{Code, Error, Result};
use crate::formulation::url::State;
use crate::layout::{Array, Layout};
use crate::ledger::Accounts;
use crate::material::VIRGIN;
use crate::math::{IDENTITY, flat};
use crate::output::{io_error, replace_file_durably};
use crate::reference::Updated;
use crate::scene::Scene;

/// A complete state: restoring it and stepping gives the same bits as never having left.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    pub(crate) scene_hash: u64,
    pub(crate) time: f64,
    pub(crate) steps: u64,
    pub(crate) accounts: Accounts,
    pub(crate) inputs: InputValues,
    pub(crate) walls: Vec<WallState>,
    pub(crate) state: State,
    pub(crate) updated: Option<Updated>,
}

const MAGIC: &[u8; 8] = b"URLSPHSN";
/// Raised whenever the layout below changes.
const FORMAT: u32 = 2;

/// Hash of everything that determines the meaning of a state: not of what a run writes, nor of how
/// long it lasts.
pub(crate) fn scene_hash(scene: &Scene) -> u64 {
    let mut scene = scene.of_content();
    scene.title.clear();
    scene.probes.clear();
    scene.output = crate::scene::Output::default();
    scene.time.end = 0.0;
    let text = serde_json::to_string(&scene).expect("a scene is plain data");
    xxh3_64(text.as_bytes())
}

/// Takes the parts of a snapshot in a fixed order: the writer, the hasher and the reader walk the same path.
trait Walk {
    fn word(&mut self, value: &mut u64) -> Result<()>;
    fn numbers(&mut self, values: &mut [f64]) -> Result<()>;
    /// How many items follow, of at least eight bytes each.
    fn length(&mut self, present: usize) -> Result<usize> {
        self.word(&mut (present as u64))?;
        Ok(present)
    }

    fn number(&mut self, value: &mut f64) -> Result<()> {
        self.numbers(std::slice::from_mut(value))
    }
    fn array<const N: usize>(&mut self, array: &mut Array<N>) -> Result<()> {
        let (stride, particles) = (array.component_stride(), array.particles());
        for component in array.flat_mut().chunks_exact_mut(stride) {
            self.numbers(&mut component[Layout::FIRST..Layout::FIRST + particles])?;
        }
        Ok(())
    }
    fn optional<const N: usize>(
        &mut self,
        array: &mut Option<Array<N>>,
        (layout, dummy): (Layout, [f64; N]),
    ) -> Result<()> {
        let mut present = u64::from(array.is_some());
        self.word(&mut present)?;
        match present {
            0 => *array = None,
            1 => self.array(array.get_or_insert_with(|| Array::new(layout, dummy)))?,
            _ => return Err(damaged("it has an unknown flag")),
        }
        Ok(())
    }
}

impl Snapshot {
    fn walk(&mut self, walk: &mut impl Walk) -> Result<()> {
        walk.word(&mut self.scene_hash)?;
        walk.number(&mut self.time)?;
        walk.word(&mut self.steps)?;
        let a = &mut self.accounts;
        for value in [
            &mut a.initial,
            &mut a.heat_in,
            &mut a.plastic.work,
            &mut a.plastic.heat,
            &mut a.plastic.entropy,
            &mut a.conduction,
            &mut a.external_work,
            &mut a.dissipation,
            &mut a.contact,
            &mut a.projection,
        ] {
            walk.number(value)?;
        }
        let inputs = walk.length(self.inputs.len())?;
        self.inputs.resize_with(inputs, Vec::new);
        for values in &mut self.inputs {
            let length = walk.length(values.len())?;
            values.resize(length, 0.0);
            walk.numbers(values)?;
        }
        let walls = walk.length(self.walls.len())?;
        self.walls.resize_with(walls, WallState::default);
        for wall in &mut self.walls {
            walk.number(&mut wall.displacement)?;
            walk.number(&mut wall.impulse)?;
        }
        let layout = self.state.x.layout();
        walk.array(&mut self.state.x)?;
        walk.array(&mut self.state.v)?;
        walk.array(&mut self.state.f)?;
        // Dummies are undeformed, at zero entropy and virgin: what the passes make of them must be finite.
        walk.optional(&mut self.state.h, (layout, flat(&IDENTITY)))?;
        walk.optional(&mut self.state.j, (layout, [1.0]))?;
        walk.optional(&mut self.state.eta, (layout, [0.0]))?;
        walk.optional(&mut self.state.history, (layout, VIRGIN))?;
        let mut updated = u64::from(self.updated.is_some());
        walk.word(&mut updated)?;
        if updated == 1 {
            let u = self.updated.get_or_insert_with(|| Updated {
                chi: Array::new(layout, [0.0; 3]),
                f_chi: Array::new(layout, flat(&IDENTITY)),
                j_chi: Array::new(layout, [1.0]),
                h_chi: None,
                half_mu: None,
            });
            walk.array(&mut u.chi)?;
            walk.array(&mut u.f_chi)?;
            walk.array(&mut u.j_chi)?;
            walk.optional(&mut u.h_chi, (layout, flat(&IDENTITY)))?;
            walk.optional(&mut u.half_mu, (layout, [0.0; 3]))?;
        }
        Ok(())
    }

    /// Bytes, versioned and checksummed, little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut writer = Writer(Vec::new());
        writer.0.extend_from_slice(MAGIC);
        writer.0.extend_from_slice(&FORMAT.to_le_bytes());
        writer
            .0
            .extend_from_slice(&(self.state.x.particles() as u32).to_le_bytes());
        self.clone()
            .walk(&mut writer)
            .expect("writing to memory does not fail");
        let sum = xxh3_64(&writer.0);
        writer.0.extend_from_slice(&sum.to_le_bytes());
        writer.0
    }

    /// Writes the bytes to a file, under its name only when all of them are on the disk: neither a full disk nor a
    /// killed process or a loss of power leaves half a file there, or takes away the one before.
    ///
    /// # Errors
    /// [`Code::Io`] naming the file.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<()> {
        let bytes = self.to_bytes();
        replace_file_durably(path.as_ref(), |out| out.write_all(&bytes))
    }

    /// Reads a file that [`write`](Self::write) wrote.
    ///
    /// # Errors
    /// [`Code::Io`] naming the file; [`Code::Snapshot`] as [`from_bytes`](Self::from_bytes).
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let failed = |cause: std::io::Error| io_error("read", path, &cause);
        let file = File::open(path).map_err(failed)?;
        let about = file.metadata().map_err(failed)?;
        if !about.is_file() {
            return Err(Error::new(
                Code::Io,
                format!(
                    "cannot read `{}`: it is no file; name the file of a snapshot",
                    path.display()
                ),
            ));
        }
        let mut bytes = Vec::new();
        let length = usize::try_from(about.len()).unwrap_or(usize::MAX);
        bytes.try_reserve_exact(length).map_err(|_| {
            Error::new(
                Code::OutOfMemory,
                format!(
                    "the snapshot `{}` has {length} bytes, more than there is memory for: is it the file \
                     that was meant?",
                    path.display()
                ),
            )
        })?;
        file.take(about.len())
            .read_to_end(&mut bytes)
            .map_err(failed)?;
        Self::from_bytes(&bytes).map_err(|e| e.with_note(&format!("in {}", path.display())))
    }

    /// Reads what [`to_bytes`](Self::to_bytes) wrote.
    ///
    /// # Errors
    /// [`Code::Snapshot`] if truncated, damaged or of another version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        const HEAD: usize = 16;
        if bytes.len() < HEAD + 8 || &bytes[..8] != MAGIC {
            return Err(damaged("it does not start like one"));
        }
        let word =
            |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
        if word(8) != FORMAT {
            return Err(Error::new(
                Code::Snapshot,
                format!(
                    "the snapshot has format {}, this library reads format {FORMAT}: use the \
                     version of the library that wrote it",
                    word(8)
                ),
            ));
        }
        let (body, sum) = bytes.split_at(bytes.len() - 8);
        if xxh3_64(body).to_le_bytes() != sum {
            return Err(damaged("its checksum does not match"));
        }
        let particles = word(12) as usize;
        // Position, velocity and f of every particle must be there before memory is taken for them.
        if particles == 0 || body.len() < particles * 15 * 8 {
            return Err(damaged("it is too short for its particles"));
        }
        let layout = Layout::new(particles);
        let mut snapshot = Self {
            scene_hash: 0,
            time: 0.0,
            steps: 0,
            accounts: Accounts::default(),
            inputs: Vec::new(),
            walls: Vec::new(),
            state: State {
                x: Array::new(layout, [0.0; 3]),
                v: Array::new(layout, [0.0; 3]),
                f: Array::new(layout, flat(&IDENTITY)),
                h: None,
                j: None,
                eta: None,
                history: None,
            },
            updated: None,
        };
        let mut reader = Reader(&body[HEAD..]);
        snapshot.walk(&mut reader)?;
        if reader.0.is_empty() {
            Ok(snapshot)
        } else {
            Err(damaged("it is too long"))
        }
    }

    /// Hash of the content.
    pub fn hash(&self) -> u64 {
        let mut hasher = Hasher(Xxh3::new());
        self.clone()
            .walk(&mut hasher)
            .expect("hashing does not fail");
        hasher.0.digest()
    }
}

fn damaged(what: &str) -> Error {
    Error::new(
        Code::Snapshot,
        format!("not a usable snapshot, {what}: take it again from a running simulation"),
    )
}

struct Writer(Vec<u8>);

impl Walk for Writer {
    fn word(&mut self, value: &mut u64) -> Result<()> {
        self.0.extend_from_slice(&value.to_le_bytes());
        Ok(())
    }
    fn numbers(&mut self, values: &mut [f64]) -> Result<()> {
        self.0.reserve(8 * values.len());
        for v in values {
            self.0.extend_from_slice(&v.to_le_bytes());
        }
        Ok(())
    }
}

struct Hasher(Xxh3);

impl Walk for Hasher {
    fn word(&mut self, value: &mut u64) -> Result<()> {
        self.0.update(&value.to_le_bytes());
        Ok(())
    }
    fn numbers(&mut self, values: &mut [f64]) -> Result<()> {
        for v in values {
            self.0.update(&v.to_le_bytes());
        }
        Ok(())
    }
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take(&mut self, length: usize) -> Result<&[u8]> {
        let (head, rest) = self
            .0
            .split_at_checked(length)
            .ok_or_else(|| damaged("it ends too early"))?;
        self.0 = rest;
        Ok(head)
    }
}

impl Walk for Reader<'_> {
    fn word(&mut self, value: &mut u64) -> Result<()> {
        *value = u64::from_le_bytes(self.take(8)?.try_into().expect("eight bytes"));
        Ok(())
    }
    /// Lengths come before their data: a damaged one must not ask for all the memory there is.
    fn length(&mut self, _: usize) -> Result<usize> {
        let mut length = 0;
        self.word(&mut length)?;
        usize::try_from(length)
            .ok()
            .filter(|&n| n <= self.0.len() / 8)
            .ok_or_else(|| damaged("a length in it is absurd"))
    }
    fn numbers(&mut self, values: &mut [f64]) -> Result<()> {
        let bytes = self.take(8 * values.len())?;
        for (v, b) in values.iter_mut().zip(bytes.chunks_exact(8)) {
            *v = f64::from_le_bytes(b.try_into().expect("eight bytes"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::Simulation;

    const CUBE: &str = r#"{
        "geometry": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.5}},
        "material": {"neo_hookean": {"density": 1, "youngs_modulus": 1, "poisson_ratio": 0}},
        "numerics": {"reference_update": "every_step", "operators": "kernel", "kernel_option": 3},
        "time": {"end": 1}
    }"#;

    #[test]
    fn parts_that_do_not_fit_are_told_with_the_remedy() {
        let scene = Scene::from_json(CUBE, &[]).unwrap();
        let mut simulation = Simulation::with_threads(scene, 1).unwrap();
        simulation.advance(0.1).unwrap();
        let good = simulation.snapshot();
        let mut told = |change: fn(&mut Snapshot)| {
            let mut bad = good.clone();
            change(&mut bad);
            let error = simulation.restore(&bad).unwrap_err();
            assert_eq!(error.code(), Code::Snapshot);
            error
        };
        let error = told(|bad| bad.walls.push(WallState::default()));
        assert!(
            error
                .message()
                .contains("does not have the fields of its scene")
        );
        let error = told(|bad| {
            let updated = bad.updated.as_mut().unwrap();
            updated.chi = Array::new(updated.chi.layout(), [0.0; 3]);
        });
        assert!(
            error
                .message()
                .contains("reference configuration of the snapshot is damaged")
        );
        assert!(error.place().particle.is_some());
        assert_eq!(simulation.state_hash(), good.hash(), "nothing has changed");

        // Every word of the head in turn, under a checksum that is right.
        let bytes = good.to_bytes();
        let mut texts = String::new();
        for at in (16..bytes.len() - 16).step_by(8) {
            let mut bad = bytes[..bytes.len() - 8].to_vec();
            bad[at..at + 8].fill(0xff);
            let sum = xxh3_64(&bad);
            bad.extend_from_slice(&sum.to_le_bytes());
            if let Err(error) = Snapshot::from_bytes(&bad) {
                texts += error.message();
            }
        }
        assert!(texts.contains("a length in it is absurd"), "{texts}");
        assert!(texts.contains("it has an unknown flag"), "{texts}");
    }
}
