//! Gives the shared library the name under which programs find it at run time, and its own way to make keys
//! of thread-local storage.

use std::env::var;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // The first number of the version changes with the binary interface; it is the soname's.
    let major = var("CARGO_PKG_VERSION_MAJOR").expect("set by cargo");
    let os = var("CARGO_CFG_TARGET_OS").expect("set by cargo");
    let family = var("CARGO_CFG_TARGET_FAMILY").unwrap_or_default();
    if os == "macos" {
        println!("cargo::rustc-cdylib-link-arg=-Wl,-install_name,@rpath/liburlsph.{major}.dylib");
    } else if family.split(',').any(|f| f == "unix") {
        println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,liburlsph.so.{major}");
    }
    // `src/keys.rs`
    println!("cargo::rustc-check-cfg=cfg(keys)");
    let is = |name: &str, of: &[&str]| var(name).is_ok_and(|value| of.contains(&value.as_str()));
    if os == "linux"
        && is("CARGO_CFG_TARGET_ENV", &["gnu"])
        && is("CARGO_CFG_TARGET_ARCH", &["x86_64", "aarch64"])
    {
        println!("cargo::rustc-cfg=keys");
        println!("cargo::rustc-cdylib-link-arg=-Wl,--wrap=pthread_key_create");
    }
}
