//! Handles: the table of live ones, the lock of each, and the guard of every call.

use std::collections::BTreeMap;
use std::ffi::CString;
use std::ptr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use super::callbacks::Callbacks;
use super::panic;
use super::types::{urlsph_simulation, urlsph_status};
use crate::error::{Code, Error, Result};
use crate::fields::FIELDS;
use crate::simulation::Simulation;

/// What a handle stands for.
pub(super) struct Session {
    /// `None` once destroyed: a call that found the handle just before gets here too late.
    simulation: Option<Simulation>,
    /// Texts that the host borrows until it destroys the handle.
    pub(super) names: Names,
    pub(super) callbacks: Callbacks,
    /// Of the last call that failed.
    pub(super) error: Option<Error>,
    /// The bytes of the present state, kept between the query of their size and the copy.
    snapshot: Option<Vec<u8>>,
}

/// NUL-terminated copies of the names that the host may ask for.
pub(super) struct Names {
    pub(super) title: CString,
    pub(super) patches: Vec<CString>,
    pub(super) contacts: Vec<CString>,
    pub(super) probes: Vec<CString>,
    pub(super) fields: Vec<FieldNames>,
}

/// Texts of one field.
pub(super) struct FieldNames {
    pub(super) name: CString,
    pub(super) unit: CString,
    pub(super) description: CString,
}

impl Names {
    fn new(simulation: &Simulation) -> Result<Self> {
        let text = |path: &str, s: &str| {
            CString::new(s).map_err(|_| {
                Error::scene(
                    path,
                    "a text must not contain the character U+0000: remove it",
                )
            })
        };
        Ok(Self {
            title: text("title", &simulation.scene().title)?,
            patches: simulation
                .patches()
                .iter()
                .map(|p| text("patches", &p.name))
                .collect::<Result<_>>()?,
            contacts: simulation
                .contact_names()
                .map(|name| text("contact", name))
                .collect::<Result<_>>()?,
            probes: simulation
                .probe_names()
                .iter()
                .map(|name| text("probes", name))
                .collect::<Result<_>>()?,
            fields: FIELDS
                .iter()
                .map(|f| {
                    Ok(FieldNames {
                        name: text("output.fields", f.name)?,
                        unit: text("output.fields", f.unit)?,
                        description: text("output.fields", f.description)?,
                    })
                })
                .collect::<Result<_>>()?,
        })
    }
}

impl Session {
    /// The simulation, to be read.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`] once destroyed.
    pub(super) fn simulation(&self) -> Result<&Simulation> {
        self.simulation.as_ref().ok_or_else(destroyed)
    }

    /// The simulation, to be changed: what was derived from its state is dropped.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`] once destroyed.
    pub(super) fn simulation_mut(&mut self) -> Result<&mut Simulation> {
        self.snapshot = None;
        self.simulation.as_mut().ok_or_else(destroyed)
    }

    /// The bytes of a snapshot of the present state.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`] once destroyed.
    pub(super) fn snapshot(&mut self) -> Result<&[u8]> {
        if self.snapshot.is_none() {
            self.snapshot = Some(self.simulation()?.snapshot().to_bytes());
        }
        Ok(self.snapshot.as_deref().unwrap_or_default())
    }

    /// Gives the memory of [`snapshot`](Self::snapshot) back.
    pub(super) fn forget_snapshot(&mut self) {
        self.snapshot = None;
    }

    fn fail(&mut self, error: Error) -> urlsph_status {
        let status = error.code().into();
        if let Some(simulation) = &self.simulation {
            self.callbacks.complain(&error, simulation);
        }
        self.error = Some(error);
        status
    }
}

fn destroyed() -> Error {
    Error::argument("the simulation was destroyed during the call: let its users end first")
}

/// The live handles. Ids count up and are never used again: a stale handle cannot meet a newer one.
struct Table {
    last_id: usize,
    live: BTreeMap<usize, Arc<Mutex<Session>>>,
}

static TABLE: Mutex<Table> = Mutex::new(Table {
    last_id: 0,
    live: BTreeMap::new(),
});

/// Ids are shifted by this, so that handles look aligned to those who look at them.
const ID_SHIFT: u32 = 4;

fn table() -> MutexGuard<'static, Table> {
    // Nothing panics while the table is locked.
    TABLE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn find(handle: *const urlsph_simulation) -> Option<Arc<Mutex<Session>>> {
    let address = handle.addr();
    if address & ((1 << ID_SHIFT) - 1) != 0 {
        return None;
    }
    table().live.get(&(address >> ID_SHIFT)).cloned()
}

/// Registers a simulation.
///
/// # Errors
/// [`Code::InvalidScene`] if a name cannot be a C string; [`Code::OutOfMemory`] once all ids are used.
pub(super) fn register(simulation: Simulation) -> Result<*mut urlsph_simulation> {
    let session = Session {
        names: Names::new(&simulation)?,
        simulation: Some(simulation),
        callbacks: Callbacks::default(),
        error: None,
        snapshot: None,
    };
    let mut table = table();
    let id = table.last_id + 1;
    if id > usize::MAX >> ID_SHIFT {
        return Err(Error::new(
            Code::OutOfMemory,
            "no handle is left; restart the process",
        ));
    }
    table.last_id = id;
    table.live.insert(id, Arc::new(Mutex::new(session)));
    Ok(ptr::without_provenance_mut(id << ID_SHIFT))
}

/// Runs `f` as the one user of a handle.
pub(super) fn with(
    handle: *const urlsph_simulation,
    f: impl FnOnce(&mut Session) -> Result<()>,
) -> urlsph_status {
    let Some(session) = find(handle) else {
        return urlsph_status::URLSPH_INVALID_ARGUMENT;
    };
    let call = || match session.try_lock() {
        Ok(mut session) => match f(&mut session) {
            Ok(()) => urlsph_status::URLSPH_OK,
            Err(error) => session.fail(error),
        },
        Err(TryLockError::WouldBlock) => urlsph_status::URLSPH_BUSY,
        Err(TryLockError::Poisoned(_)) => urlsph_status::URLSPH_INTERNAL,
    };
    panic::catch(call).unwrap_or_else(|report| {
        let mut session = session.lock().unwrap_or_else(PoisonError::into_inner);
        session.fail(internal(&report))
    })
}

/// Runs `f` without a handle; `Err` says what is wrong.
pub(super) fn without<T>(f: impl FnOnce() -> Result<T>) -> Result<T> {
    panic::catch(f).unwrap_or_else(|report| Err(internal(&report)))
}

fn internal(report: &str) -> Error {
    Error::new(
        Code::Internal,
        format!(
            "internal error: {report}; the simulation can only be destroyed now; please report this bug"
        ),
    )
}

/// The error of the last call that failed; this works on a poisoned handle too.
pub(super) fn last_error(
    handle: *const urlsph_simulation,
    read: impl FnOnce(Option<&Error>) -> Result<()>,
) -> urlsph_status {
    let Some(session) = find(handle) else {
        return urlsph_status::URLSPH_INVALID_ARGUMENT;
    };
    let session = match session.try_lock() {
        Ok(session) => session,
        Err(TryLockError::Poisoned(session)) => session.into_inner(),
        Err(TryLockError::WouldBlock) => return urlsph_status::URLSPH_BUSY,
    };
    match read(session.error.as_ref()) {
        Ok(()) => urlsph_status::URLSPH_OK,
        Err(error) => error.code().into(),
    }
}

/// Destroys what a handle stands for, poisoned or not.
pub(super) fn destroy(handle: *mut urlsph_simulation) -> urlsph_status {
    if handle.is_null() {
        return urlsph_status::URLSPH_OK;
    }
    let Some(cell) = find(handle) else {
        return urlsph_status::URLSPH_INVALID_ARGUMENT;
    };
    let simulation = {
        let mut session = match cell.try_lock() {
            Ok(session) => session,
            Err(TryLockError::Poisoned(session)) => session.into_inner(),
            Err(TryLockError::WouldBlock) => return urlsph_status::URLSPH_BUSY,
        };
        table().live.remove(&(handle.addr() >> ID_SHIFT));
        session.callbacks = Callbacks::default();
        session.snapshot = None;
        session.simulation.take()
    };
    match panic::catch(move || drop(simulation)) {
        Ok(()) => urlsph_status::URLSPH_OK,
        Err(_) => urlsph_status::URLSPH_INTERNAL,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_that_comes_too_late_is_told() {
        let scene = crate::scene::Scene::from_json(include_str!("../../ffi-tests/scene.json"), &[]);
        let simulation = Simulation::with_threads(scene.expect("a scene"), 1).expect("a body");
        let handle = register(simulation).expect("a handle");
        let found = find(handle).expect("live");
        assert_eq!(destroy(handle), urlsph_status::URLSPH_OK);
        let error = found.lock().expect("not poisoned").simulation().err();
        let error = error.expect("it is gone");
        assert_eq!(error.code(), Code::InvalidArgument);
        let text = "the simulation was destroyed during the call";
        assert!(error.message().starts_with(text), "{error}");
    }
}
