//! What the programs of `ffi-tests` cannot bring about: a bug of ours.

use std::ffi::{CStr, CString};
use std::mem::MaybeUninit;
use std::ptr;

use super::handle::{self, with};
use super::*;

const SCENE: &str = include_str!("../../ffi-tests/scene.json");

fn create() -> *mut urlsph_simulation {
    let json = CString::new(SCENE).expect("no NUL in a scene");
    let mut handle = ptr::null_mut();
    // SAFETY: valid pointers, NULL where it is allowed.
    let status = unsafe {
        urlsph_create_from_json(
            json.as_ptr(),
            ptr::null(),
            0,
            &mut handle,
            ptr::null_mut(),
            0,
        )
    };
    assert_eq!(status, urlsph_status::URLSPH_OK);
    handle
}

fn last_error(handle: *const urlsph_simulation) -> (urlsph_status, String) {
    let mut error = MaybeUninit::<urlsph_error>::uninit();
    // SAFETY: a valid pointer and its size; it is written when the call succeeds.
    let error = unsafe {
        let status = urlsph_get_last_error(handle, error.as_mut_ptr(), size_of::<urlsph_error>());
        assert_eq!(status, urlsph_status::URLSPH_OK);
        error.assume_init()
    };
    // SAFETY: the text ends with NUL inside its array.
    let text = unsafe { CStr::from_ptr(error.text.as_ptr()) };
    (error.code, text.to_str().expect("UTF-8").to_owned())
}

fn time(handle: *const urlsph_simulation) -> urlsph_status {
    let mut time = 0.0;
    // SAFETY: a valid pointer.
    unsafe { urlsph_get_time(handle, &mut time) }
}

#[test]
fn a_panic_poisons_its_handle_and_no_other() {
    let (poisoned, other) = (create(), create());
    let status = with(poisoned, |_| panic!("deliberately"));
    assert_eq!(status, urlsph_status::URLSPH_INTERNAL);
    let (code, text) = last_error(poisoned);
    assert_eq!(code, urlsph_status::URLSPH_INTERNAL);
    // The message, and where in our source.
    assert!(text.contains("deliberately"), "{text}");
    assert!(text.contains("tests.rs:"), "{text}");

    // Nothing but the error and the end is left.
    assert_eq!(time(poisoned), urlsph_status::URLSPH_INTERNAL);
    // SAFETY: handles may be anything.
    unsafe {
        assert_eq!(urlsph_step(poisoned, 1e-3), urlsph_status::URLSPH_INTERNAL);
        assert_eq!(last_error(poisoned).1, text);
        assert_eq!(urlsph_destroy(poisoned), urlsph_status::URLSPH_OK);
        assert_eq!(
            urlsph_destroy(poisoned),
            urlsph_status::URLSPH_INVALID_ARGUMENT
        );
        assert_eq!(time(other), urlsph_status::URLSPH_OK);
        assert_eq!(urlsph_destroy(other), urlsph_status::URLSPH_OK);
    }
}

#[test]
fn a_panic_on_a_thread_of_the_pool_is_caught_too() {
    let handle = create();
    let status = with(handle, |_| {
        crate::parallel::Pool::new(2)?.install(|| panic!("far away"))
    });
    assert_eq!(status, urlsph_status::URLSPH_INTERNAL);
    assert!(last_error(handle).1.contains("far away"));
    // SAFETY: handles may be anything.
    assert_eq!(unsafe { urlsph_destroy(handle) }, urlsph_status::URLSPH_OK);
}

#[test]
fn a_panic_without_a_handle_is_an_error() {
    let error = handle::without::<()>(|| panic!("while creating")).expect_err("it panicked");
    assert_eq!(error.code(), crate::Code::Internal);
    assert!(error.message().contains("while creating"));
}

/// The test runs itself again, to see what the process prints.
#[test]
fn a_caught_panic_prints_nothing_and_others_print_as_before() {
    const ROLE: &str = "URLSPH_TEST_OF_SILENCE";
    if std::env::var_os(ROLE).is_some() {
        let handle = create();
        let _ = with(handle, |_| panic!("hidden from the caller"));
        let _ = with(create(), |_| {
            crate::parallel::Pool::new(2)?.install(|| panic!("hidden in the pool"))
        });
        let _ = std::panic::catch_unwind(|| panic!("for everybody to see"));
        return;
    }
    let output = std::process::Command::new(std::env::current_exe().expect("this test"))
        .args([
            "--exact",
            "ffi::tests::a_caught_panic_prints_nothing_and_others_print_as_before",
            "--nocapture",
        ])
        .env(ROLE, "1")
        .output()
        .expect("this test runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(!said.contains("hidden"), "{said}");
    assert!(said.contains("for everybody to see"), "{said}");
}

#[test]
fn handles_are_never_used_again() {
    let first = create();
    // SAFETY: handles may be anything.
    unsafe {
        assert_eq!(urlsph_destroy(first), urlsph_status::URLSPH_OK);
        let second = create();
        assert_ne!(first, second);
        assert_eq!(time(first), urlsph_status::URLSPH_INVALID_ARGUMENT);
        assert_eq!(urlsph_destroy(second), urlsph_status::URLSPH_OK);
    }
}

/// What the interface tells about contact is what the library itself has, to the bit.
#[test]
fn contact_is_that_of_the_library() {
    let json = CString::new(include_str!("../../ffi-tests/contact.json")).expect("no NUL in it");
    let mut handle = ptr::null_mut();
    let mut contact = usize::MAX;
    let mut force = MaybeUninit::<urlsph_contact_resultant>::uninit();
    let mut counts = MaybeUninit::<urlsph_counts>::uninit();
    // SAFETY: valid pointers with their sizes; the structs are written when the calls succeed.
    let (counts, r) = unsafe {
        let no_error = ptr::null_mut();
        let json = json.as_ptr();
        let status = urlsph_create_from_json(json, ptr::null(), 0, &mut handle, no_error, 0);
        assert_eq!(status, urlsph_status::URLSPH_OK);
        assert_eq!(urlsph_step(handle, 4e-3), urlsph_status::URLSPH_OK);
        let size = size_of::<urlsph_counts>();
        let status = urlsph_get_counts(handle, counts.as_mut_ptr(), size);
        assert_eq!(status, urlsph_status::URLSPH_OK);
        let status = urlsph_find_contact(handle, c"piston".as_ptr(), &mut contact);
        assert_eq!(status, urlsph_status::URLSPH_OK);
        let size = size_of::<urlsph_contact_resultant>();
        let status = urlsph_get_contact_resultant(handle, contact, force.as_mut_ptr(), size);
        assert_eq!(status, urlsph_status::URLSPH_OK);
        (counts.assume_init(), force.assume_init())
    };
    let status = with(handle, |session| {
        let simulation = session.simulation()?;
        let names: Vec<&str> = simulation.contact_names().collect();
        assert_eq!(names, ["floor", "piston"]);
        assert_eq!((counts.contacts, contact), (2, 1));
        let direct = simulation.contact(contact);
        assert_eq!((r.force, r.impulse), (direct.force, direct.impulse));
        assert_eq!(
            (r.displacement, r.particles),
            (direct.displacement, direct.particles)
        );
        assert!(r.force[1] < 0.0 && r.particles == 9);
        Ok(())
    });
    assert_eq!(status, urlsph_status::URLSPH_OK, "{:?}", last_error(handle));
    // SAFETY: handles may be anything.
    assert_eq!(unsafe { urlsph_destroy(handle) }, urlsph_status::URLSPH_OK);
}
