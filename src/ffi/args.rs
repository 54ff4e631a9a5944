//! The caller's pointers, checked: NULL, alignment, length and UTF-8.
//!
//! Whether a pointer that passes these checks really leads to that much memory is the caller's word;
//! every `unsafe fn` here has this as its only precondition.

use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;
use std::ptr;

use crate::error::{Error, Result};

/// NULL and alignment.
pub(super) fn check<T>(pointer: *const T, name: &str) -> Result<()> {
    if pointer.is_null() {
        return Err(Error::argument(format!(
            "`{name}` is NULL: pass a valid pointer"
        )));
    }
    if !pointer.is_aligned() {
        return Err(Error::argument(format!(
            "`{name}` is not aligned to {} bytes: pass a pointer to a variable of its type",
            align_of::<T>()
        )));
    }
    Ok(())
}

/// A NUL-terminated UTF-8 text.
pub(super) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<&'a str> {
    check(pointer, name)?;
    // SAFETY: not NULL; the caller vouches for the terminating NUL.
    let bytes = unsafe { CStr::from_ptr(pointer) };
    bytes.to_str().map_err(|e| {
        Error::argument(format!(
            "`{name}` is not UTF-8: byte {} does not fit; convert the text",
            e.valid_up_to()
        ))
    })
}

/// An array to be read; NULL is fine for an empty one.
pub(super) unsafe fn array<'a, T>(pointer: *const T, count: usize, name: &str) -> Result<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    check(pointer, name)?;
    if count > isize::MAX as usize / size_of::<T>() {
        return Err(Error::argument(format!(
            "`{name}`: {count} elements exceed the address space; check the count"
        )));
    }
    // SAFETY: not NULL, aligned, of a possible size; the caller vouches for the memory.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// A buffer of `capacity` elements of which the first `needed` will be written.
///
/// They are set to zero first: the caller's memory may be uninitialised, a slice may not.
pub(super) unsafe fn buffer<'a, T: bytemuck::Zeroable>(
    pointer: *mut T,
    capacity: usize,
    needed: usize,
    name: &str,
) -> Result<&'a mut [T]> {
    if capacity < needed {
        return Err(Error::argument(format!(
            "`{name}` has room for {capacity} elements, but {needed} are needed: pass a larger buffer"
        )));
    }
    if needed == 0 {
        return Ok(&mut []);
    }
    check(pointer, name)?;
    // SAFETY: not NULL, aligned; the caller vouches for `capacity >= needed` elements; zeros are a
    // value of `T`.
    unsafe {
        ptr::write_bytes(pointer, 0, needed);
        Ok(std::slice::from_raw_parts_mut(pointer, needed))
    }
}

/// Writes one value.
pub(super) unsafe fn put<T>(pointer: *mut T, value: T, name: &str) -> Result<()> {
    check(pointer, name)?;
    // SAFETY: not NULL, aligned; the caller vouches for the memory.
    unsafe { pointer.write(value) };
    Ok(())
}

/// A struct that may grow at its end in later versions.
///
/// # Safety
/// All zeros, and any bytes that a C compiler can put there, are a value of the type.
pub(super) unsafe trait Versioned: Copy {
    /// Size of the first version: no caller's struct is smaller.
    const FIRST_SIZE: usize;
}

fn check_size<T: Versioned>(size: usize, name: &str) -> Result<()> {
    // No struct will ever be this large: a size beyond it is not one, and not to be written to.
    const LARGEST: usize = 1 << 16;
    if (T::FIRST_SIZE..=LARGEST).contains(&size) {
        return Ok(());
    }
    Err(Error::argument(format!(
        "`{name}_size` is {size}; pass the size of the struct, {} bytes in this version",
        size_of::<T>()
    )))
}

/// Writes as much of a struct as the caller knows of, and zeros where the caller knows more.
pub(super) unsafe fn put_struct<T: Versioned>(
    pointer: *mut T,
    size: usize,
    value: &T,
    name: &str,
) -> Result<()> {
    check(pointer, name)?;
    check_size::<T>(size, name)?;
    let known = size.min(size_of::<T>());
    // SAFETY: the caller vouches for `size` bytes; `known` of them come from a whole `T`, and the
    // two do not overlap because `value` is ours.
    unsafe {
        let bytes = pointer.cast::<u8>();
        ptr::copy_nonoverlapping(ptr::from_ref(value).cast::<u8>(), bytes, known);
        ptr::write_bytes(bytes.add(known), 0, size - known);
    }
    Ok(())
}

/// Reads a struct: what the caller does not know of is zero; what we do not know of must be.
pub(super) unsafe fn get_struct<T: Versioned>(
    pointer: *const T,
    size: usize,
    name: &str,
) -> Result<T> {
    check(pointer, name)?;
    check_size::<T>(size, name)?;
    let known = size.min(size_of::<T>());
    let mut value = MaybeUninit::<T>::zeroed();
    // SAFETY: the caller vouches for `size` initialised bytes; `known` of them fit into `value`,
    // and zeros and the caller's bytes are a value of `T` by the contract of `Versioned`.
    let (value, rest) = unsafe {
        let bytes = pointer.cast::<u8>();
        ptr::copy_nonoverlapping(bytes, value.as_mut_ptr().cast::<u8>(), known);
        let rest = std::slice::from_raw_parts(bytes.add(known), size - known);
        (value.assume_init(), rest)
    };
    if rest.iter().any(|&b| b != 0) {
        return Err(Error::argument(format!(
            "`{name}` asks for something that library version {} does not know; update the library",
            crate::VERSION
        )));
    }
    Ok(value)
}
