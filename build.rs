//! Gives the shared library the name under which programs find it at run time.

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
}
