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
    assert!(text.starts_with("internal error: deliberately"), "{text}");
    assert!(text.contains("please report this bug"), "{text}");
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

#[test]
fn what_is_wrong_with_a_call_is_told_with_the_remedy() {
    let s = create();
    let told = |status: urlsph_status, text: &str| {
        let (code, message) = last_error(s);
        println!("{message}");
        assert_eq!(status, code, "{message}");
        assert_eq!(code, urlsph_status::URLSPH_INVALID_ARGUMENT, "{message}");
        assert!(message.contains(text), "no {text:?} in: {message}");
    };
    let (mut index, mut number, mut many) = (0, 0.0, [0.0; 8]);
    let (latin, none) = (c"t\xf6p".as_ptr(), ptr::null());
    let odd = ptr::from_mut(&mut many)
        .cast::<u8>()
        .wrapping_add(1)
        .cast::<f64>();
    let field = std::mem::size_of::<urlsph_field_info>();
    let mut info = MaybeUninit::<urlsph_field_info>::uninit();
    let mut view = MaybeUninit::<urlsph_view>::uninit();
    let mut heat = MaybeUninit::<urlsph_heat_resultant>::uninit();
    let mut callbacks = [0_u8; 2 * size_of::<urlsph_callbacks>()];
    callbacks[size_of::<urlsph_callbacks>()] = 1;
    let callbacks = callbacks.as_ptr_range();
    // SAFETY: valid pointers, or such as the call refuses.
    unsafe {
        told(
            urlsph_get_time(s, ptr::null_mut()),
            "`time` is NULL: pass a valid pointer",
        );
        told(
            urlsph_get_time(s, odd),
            "`time` is not aligned to 8 bytes: pass a pointer to a variable of its type",
        );
        told(
            urlsph_find_patch(s, latin, &mut index),
            "`name` is not UTF-8: byte 1 does not fit; convert the text",
        );
        told(
            urlsph_find_patch(s, c"lid".as_ptr(), &mut index),
            "there is no patch `lid`; there are",
        );
        told(
            urlsph_find_field(s, c"colour".as_ptr(), &mut index),
            "there is no field `colour`; there are: ",
        );
        told(
            urlsph_find_patch(s, none, &mut index),
            "`name` is NULL: pass a valid pointer",
        );
        told(
            urlsph_set_traction(s, 0, many.as_ptr(), usize::MAX),
            " elements exceed the address space; check the count",
        );
        told(
            urlsph_read_field(s, 0, many.as_mut_ptr(), 1),
            " are needed: pass a larger buffer",
        );
        told(
            urlsph_get_field_info(s, 0, info.as_mut_ptr(), 1),
            "`info_size` is 1; pass the size of the struct, ",
        );
        told(
            urlsph_get_field_info(s, 999, info.as_mut_ptr(), field),
            "there is no field 999: there are ",
        );
        told(
            urlsph_set_pressure(s, 999, &1.0, 1),
            "there is no patch 999: there are ",
        );
        told(
            urlsph_set_callbacks(s, callbacks.start.cast(), 2 * size_of::<urlsph_callbacks>()),
            "`callbacks` asks for something that library version ",
        );
        told(
            urlsph_read_input(s, 0, 99, &mut number, 1, &mut index),
            "99 is not a quantity: give one of urlsph_quantity, such as URLSPH_TRACTION",
        );
        told(
            urlsph_get_heat_resultant(s, 0, heat.as_mut_ptr(), size_of::<urlsph_heat_resultant>()),
            "no heat flows here: the body has no temperature; add a section `heat` to the scene",
        );
        assert_eq!(
            urlsph_find_field(s, c"pressure".as_ptr(), &mut index),
            urlsph_status::URLSPH_OK
        );
        told(
            urlsph_get_view(s, index, view.as_mut_ptr(), size_of::<urlsph_view>()),
            "it is computed on demand and has no memory to look at: copy it with urlsph_read_field",
        );
        told(
            urlsph_set_convection(s, 0, ptr::null(), 0, ptr::null(), 0),
            "there is nothing to set: give `coefficients`, `ambient_temperatures`, or both",
        );
        told(urlsph_step(s, -1.0), " s; it must be finite and positive");
        assert_eq!(urlsph_step(s, 1e-6), urlsph_status::URLSPH_OK);
        told(
            urlsph_step(s, 1e-300),
            " s, too small to change the time in double precision",
        );
        assert_eq!(urlsph_destroy(s), urlsph_status::URLSPH_OK);
    }
    // JSON can name the character that ends a text in C.
    let scene = crate::Scene::from_json(SCENE, &[r#"title="a\u0000b""#.to_owned()]);
    let simulation = crate::Simulation::with_threads(scene.expect("a scene"), 1).expect("a body");
    let error = handle::register(simulation).expect_err("no C string");
    assert_eq!(error.code(), crate::Code::InvalidScene);
    assert!(
        error
            .message()
            .contains("a text must not contain the character U+0000: remove it")
    );
}
