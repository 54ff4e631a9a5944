//! What importers are told: every call that is wrong, and what the log says of it.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ptr::{null, null_mut};

use super::FmiVersion::{self, V2, V3};
use super::handle::{self, Arguments, Logger};
use super::instance::Instance;
use super::state::State;
use super::table::{Kind, Table};
use crate::error::{Code, Result};
use crate::scene::Scene;
use crate::simulation::Simulation;

const SCENE: &str = r#"{
    "geometry": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.5}},
    "material": {"neo_hookean": {"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}},
    "boundary": {"y_min": {"support": "clamped"}, "y_max": {"pressure": {"external": 0}}},
    "time": {"end": 0.05}
}"#;

thread_local! {
    static LOG: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

unsafe extern "C" fn keep(_: *mut c_void, _: i32, _: *const c_char, message: *const c_char) {
    // SAFETY: the message ends with NUL.
    let text = unsafe { CStr::from_ptr(message) }
        .to_string_lossy()
        .into_owned();
    LOG.with_borrow_mut(|log| log.push(text));
}

/// What the log says since the last time.
fn logged() -> String {
    LOG.with_borrow_mut(std::mem::take).join("\n")
}

fn table(version: FmiVersion) -> Table {
    let scene = Scene::from_json(SCENE, &[]).unwrap();
    Table::new(&Simulation::with_threads(scene, 1).unwrap(), version).unwrap()
}

fn instance(version: FmiVersion) -> Instance {
    let token = table(version).token;
    Instance::new(version, SCENE.to_owned(), "".as_ref(), &token).unwrap()
}

fn reference(name: &str) -> u32 {
    let table = table(V3);
    let found = table.variables.iter().find(|v| v.name == name);
    found.unwrap_or_else(|| panic!("no {name}")).reference
}

/// An instance behind a pointer, whose resources are a folder with the scene.
fn pointer(version: FmiVersion, token: Option<&str>, refusal: Option<&str>) -> *mut c_void {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.json"), SCENE).unwrap();
    let resources = CString::new(folder.path().to_string_lossy().into_owned()).unwrap();
    let token = token.map(|token| CString::new(token).unwrap());
    let arguments = Arguments {
        version,
        name: c"body".as_ptr(),
        token: token.as_ref().map_or(null(), |token| token.as_ptr()),
        resources: resources.as_ptr(),
        logging: false,
        logger: Logger::V3(keep, null_mut()),
    };
    // SAFETY: the texts end with NUL.
    unsafe { handle::instantiate(arguments, refusal) }
}

#[track_caller]
fn is<T>(outcome: Result<T>, code: Code, text: &str) {
    let error = outcome.err().unwrap_or_else(|| panic!("no error: {text}"));
    println!("{error}");
    assert_eq!(error.code(), code, "{error}");
    assert!(error.message().contains(text), "no {text:?} in: {error}");
}

unsafe extern "C" {
    fn fmi2Instantiate(
        name: *const c_char,
        kind: c_int,
        token: *const c_char,
        resources: *const c_char,
        functions: *const c_void,
        visible: c_int,
        logging: c_int,
    ) -> *mut c_void;
    fn fmi2GetRealStatus(instance: *mut c_void, kind: c_int, value: *mut f64) -> c_int;
    fn fmi2GetBooleanStatus(instance: *mut c_void, kind: c_int, value: *mut c_int) -> c_int;
    fn fmi3InstantiateCoSimulation(
        name: *const c_char,
        token: *const c_char,
        resources: *const c_char,
        visible: bool,
        logging: bool,
        event_mode: bool,
        early_return: bool,
        intermediate: *const u32,
        intermediate_count: usize,
        environment: *mut c_void,
        log: Option<handle::Logger3>,
        update: *mut c_void,
    ) -> *mut c_void;
}

#[test]
fn what_is_wrong_with_a_call_is_told_with_the_remedy() {
    use Code::{InvalidArgument as A, Snapshot as N};
    let fresh = || instance(V3);
    let stepping = || {
        let mut i = fresh();
        i.setup(0.0, Some(0.01)).unwrap();
        i.enter_initialization().unwrap();
        i.exit_initialization().unwrap();
        i
    };
    let pressure = reference("boundary.y_max.pressure");
    let density = reference("material.density");
    let threads = reference("threads");
    let momentum = reference("momentum.linear");

    let other = Instance::new(V3, SCENE.to_owned(), "".as_ref(), "{0}");
    is(
        other,
        A,
        "the description, the scene and the library are not of one FMU",
    );
    is(
        fresh().setup(f64::NAN, None),
        A,
        "the start time is NaN: it must be finite",
    );
    is(
        fresh().setup(1.0, Some(0.0)),
        A,
        ": it must be finite and not before the start time ",
    );
    is(
        fresh().step(0.0, 1e-3),
        A,
        ", which is allowed only after initialisation",
    );
    is(
        stepping().step(0.0, 0.0),
        A,
        ": it must be finite and more than 0",
    );
    is(
        stepping().step(0.1, 1e-3),
        A,
        " s, but the last step ended at 0 s: continue there",
    );
    is(
        stepping().step(0.0, 1.0),
        A,
        "make it shorter, or set a later stop time",
    );
    is(
        fresh().set(Kind::Real, &[pressure], &[f64::NAN]),
        A,
        ": values must be finite",
    );
    is(
        fresh().set(Kind::Integer, &[threads], &[-1.0]),
        A,
        ": it must be 0 or more",
    );
    is(
        fresh().set(Kind::Real, &[0], &[1.0]),
        A,
        " is computed and cannot be set: set parameters and inputs only",
    );
    is(
        stepping().set(Kind::Real, &[density], &[1.0]),
        A,
        "which is allowed only before initialisation",
    );
    is(
        fresh().get(Kind::Real, &[u32::MAX], &mut [0.0]),
        A,
        "there is no variable with the value reference ",
    );
    is(
        fresh().get(Kind::Integer, &[density], &mut [0.0]),
        A,
        ") is of another type: modelDescription.xml tells which",
    );
    is(
        fresh().get(Kind::Real, &[momentum], &mut [0.0]),
        A,
        "momentum.linear has 3 values, but 1 are given: pass all of them",
    );
    is(
        fresh().get(Kind::Real, &[momentum, density], &mut [0.0]),
        A,
        "the 2 variables have 4 values together, but 1 are given: pass all of them",
    );
    let mut elsewhere = fresh().state().unwrap();
    elsewhere.token = "{0}".to_owned();
    is(
        fresh().restore(&elsewhere),
        N,
        "the FMU state belongs to another FMU: use one that this FMU has made",
    );
    is(
        State::from_bytes(b"no state"),
        N,
        "the serialised FMU state is truncated, damaged or of another version of urlsph: serialise it again",
    );

    // Through the pointers of the standards: the log tells.
    assert!(pointer(V3, None, None).is_null());
    let said = logged();
    assert!(said.contains("instantiation failed: "), "{said}");
    assert!(
        said.contains("the token is NULL: pass the one of modelDescription.xml"),
        "{said}"
    );
    // SAFETY: valid or NULL pointers, as the standard allows.
    unsafe {
        let no = null();
        assert!(
            fmi3InstantiateCoSimulation(
                no,
                no,
                no,
                false,
                false,
                false,
                false,
                &0,
                1,
                null_mut(),
                Some(keep),
                null_mut()
            )
            .is_null()
        );
        let said = logged();
        assert!(
            said.contains("this FMU has no intermediate update: require no intermediate variables"),
            "{said}"
        );
        // FMI 2.0 logs through a variadic function, which Rust cannot define: that of FMI 3.0 gets the text.
        let model_exchange = 0;
        assert!(fmi2Instantiate(no, model_exchange, no, no, no.cast(), 0, 0).is_null());
        assert!(pointer(V2, None, Some(super::fmi2::NOT_CO_SIMULATION)).is_null());
        assert!(
            logged()
                .contains("this FMU is for co-simulation: instantiate it with fmi2CoSimulation")
        );

        let i = pointer(V3, Some(&table(V3).token), None);
        assert!(!i.is_null());
        let mut state = null_mut();
        let said = |status: handle::Status, text: &str| {
            assert!(status != handle::Status::Ok, "{text}");
            let said = logged();
            println!("{said}");
            assert!(said.contains(text), "no {text:?} in: {said}");
        };
        said(
            handle::set_state(i, V3, "set", state),
            "the FMU state is NULL: get one first",
        );
        said(
            handle::set_logging(i, V3, "log", true, 1, null()),
            "an array is NULL, not aligned, or longer than memory can be: pass one of the given length",
        );
        let category = c"logColours".as_ptr();
        said(
            handle::set_logging(i, V3, "log", true, 1, &category),
            "there is no log category ",
        );
        said(
            handle::unsupported(i, V3, "no", 1, "steps are made at once"),
            "not supported: steps are made at once",
        );
        assert!(handle::get_state(i, V3, "get", &mut state) == handle::Status::Ok);
        said(
            handle::write_state(i, V3, "write", state, [0; 3].as_mut_ptr(), 3),
            ": ask for its size first",
        );
        assert!(handle::free_state(i, V3, &mut state) == handle::Status::Ok);
        // The logger comes back while the call goes on.
        let status = handle::call(i, V3, "outer", |_| {
            let inner = handle::call(i, V3, "inner", |_| Ok(()));
            assert!(inner != handle::Status::Ok);
            Ok(())
        });
        assert!(status == handle::Status::Ok);
        assert!(logged().contains(
            "another thread uses this instance: calls on one instance must follow one another"
        ));
        handle::free(i, V3);
    }
    let i = pointer(V2, Some(&table(V2).token), None);
    // SAFETY: valid pointers.
    unsafe {
        assert!(fmi2GetRealStatus(i, 0, &mut 0.0) != 0);
        assert!(logged().contains("there is no such real status: ask for fmi2LastSuccessfulTime"));
        assert!(fmi2GetBooleanStatus(i, 0, &mut 0) != 0);
        assert!(logged().contains("there is no such boolean status: ask for fmi2Terminated"));
        handle::free(i, V2);
    }
}

#[test]
fn a_panic_loses_its_instance() {
    let i = pointer(V3, Some(&table(V3).token), None);
    // SAFETY: a pointer from the instantiation.
    unsafe {
        let status = handle::call(i, V3, "fmi3DoStep", |_| -> Result<()> {
            panic!("deliberately")
        });
        assert!(status == handle::Status::Fatal);
        let said = logged();
        assert!(
            said.contains("internal error, please report it with the scene: deliberately"),
            "{said}"
        );
        let status = handle::call(i, V3, "fmi3DoStep", |_| Ok(()));
        assert!(status == handle::Status::Fatal);
        assert!(logged().contains("the instance is lost after an internal error: free it"));
        handle::free(i, V3);
    }
}
