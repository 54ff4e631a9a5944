"""The shared library: where it is, and the declarations of include/urlsph.h for ctypes."""

from __future__ import annotations

import ctypes
import os
import sys
from ctypes import (
    CFUNCTYPE,
    POINTER,
    Structure,
    c_char,
    c_char_p,
    c_double,
    c_int32,
    c_size_t,
    c_uint8,
    c_uint32,
    c_uint64,
    c_void_p,
)
from pathlib import Path

from . import _errors
from ._errors import LibraryError, Status

#: The binary interface that the declarations below describe.
ABI_VERSION = 0


class ErrorStruct(Structure):
    _fields_ = [
        ("code", c_int32),
        ("has_particle", c_int32),
        ("has_position", c_int32),
        ("has_time", c_int32),
        ("particle", c_uint64),
        ("position", c_double * 3),
        ("time", c_double),
        ("text", c_char * 2048),
        ("path", c_char * 512),
        ("boundary", c_char * 256),
        ("field", c_char * 64),
    ]

    def exception(self) -> _errors.Error:
        """The exception that says the same."""
        return _errors.make(
            self.code,
            self.text.decode(),
            path=self.path.decode() or None,
            boundary=self.boundary.decode() or None,
            field=self.field.decode() or None,
            particle=self.particle if self.has_particle else None,
            position=tuple(self.position) if self.has_position else None,
            time=self.time if self.has_time else None,
        )


class OptionsStruct(Structure):
    _fields_ = [
        ("overrides", POINTER(c_char_p)),
        ("override_count", c_size_t),
        ("threads", c_size_t),
    ]


class ProgressStruct(Structure):
    _fields_ = [
        ("time", c_double),
        ("end", c_double),
        ("dt", c_double),
        ("steps", c_uint64),
        ("start", c_double),
        ("reference_updates", c_uint64),
    ]


class LogRecordStruct(Structure):
    _fields_ = [
        ("level", c_int32),
        ("event", c_int32),
        ("message", c_char_p),
        ("error", POINTER(ErrorStruct)),
        ("time", c_double),
        ("steps", c_uint64),
    ]


LogCallback = CFUNCTYPE(None, POINTER(LogRecordStruct), c_void_p)
ProgressCallback = CFUNCTYPE(None, POINTER(ProgressStruct), c_void_p)
CancelCallback = CFUNCTYPE(c_int32, c_void_p)


class CallbacksStruct(Structure):
    _fields_ = [
        ("user_data", c_void_p),
        ("log", LogCallback),
        ("progress", ProgressCallback),
        ("cancel", CancelCallback),
    ]


class CountsStruct(Structure):
    _fields_ = [
        ("particles", c_size_t),
        ("pairs", c_size_t),
        ("patches", c_size_t),
        ("fields", c_size_t),
        ("probes", c_size_t),
        ("inputs", c_size_t),
        ("threads", c_size_t),
        ("steps", c_uint64),
        ("contacts", c_size_t),
    ]


class PatchInfoStruct(Structure):
    _fields_ = [("name", c_char_p), ("particles", c_size_t), ("area", c_double)]


class FieldInfoStruct(Structure):
    _fields_ = [
        ("name", c_char_p),
        ("unit", c_char_p),
        ("description", c_char_p),
        ("components", c_size_t),
        ("configuration", c_int32),
        ("has_view", c_int32),
        ("is_present", c_int32),
        ("reserved", c_int32),
    ]


class ProbeInfoStruct(Structure):
    _fields_ = [("name", c_char_p), ("position", c_double * 3)]


class InputInfoStruct(Structure):
    _fields_ = [
        ("patch", c_size_t),
        ("particles", c_size_t),
        ("components", c_size_t),
        ("quantity", c_int32),
        ("per_particle", c_int32),
    ]


class ViewStruct(Structure):
    _fields_ = [
        ("data", c_void_p),
        ("order", c_void_p),
        ("component_stride", c_size_t),
        ("components", c_size_t),
        ("particles", c_size_t),
        ("generation", c_uint64),
    ]


class EnergiesStruct(Structure):
    _fields_ = [
        ("kinetic", c_double),
        ("strain", c_double),
        ("external_work", c_double),
        ("numerical_dissipation", c_double),
        ("projection", c_double),
        ("closure_error", c_double),
        ("thermal", c_double),
        ("heat_in", c_double),
        ("plastic_work", c_double),
        ("ballistic", c_double),
        ("entropy", c_double),
        ("entropy_production", c_double),
        ("contact_dissipation", c_double),
    ]


class MomentaStruct(Structure):
    _fields_ = [("linear", c_double * 3), ("angular", c_double * 3)]


class ResultantStruct(Structure):
    _fields_ = [
        ("force", c_double * 3),
        ("moment", c_double * 3),
        ("mean_displacement", c_double * 3),
        ("mean_velocity", c_double * 3),
    ]


class HeatResultantStruct(Structure):
    _fields_ = [
        ("heat_flow", c_double),
        ("mean_temperature", c_double),
        ("maximum_temperature", c_double),
    ]


class ContactInfoStruct(Structure):
    _fields_ = [("name", c_char_p), ("point", c_double * 3), ("normal", c_double * 3)]


class ContactResultantStruct(Structure):
    _fields_ = [
        ("force", c_double * 3),
        ("impulse", c_double * 3),
        ("displacement", c_double),
        ("particles", c_size_t),
    ]


class ProbeMotionStruct(Structure):
    _fields_ = [
        ("displacement", c_double * 3),
        ("velocity", c_double * 3),
        ("temperature", c_double),
    ]


_HANDLE = c_void_p
_CREATE = [
    c_char_p,
    POINTER(OptionsStruct),
    c_size_t,
    POINTER(_HANDLE),
    POINTER(ErrorStruct),
    c_size_t,
]
_SET = [_HANDLE, c_size_t, POINTER(c_double), c_size_t]
_FIND = [_HANDLE, c_char_p, POINTER(c_size_t)]


def _get(struct, *index):
    return [_HANDLE, *index, POINTER(struct), c_size_t]


#: Parameters of the functions that return a status.
_SIGNATURES = {
    "urlsph_create_from_json": _CREATE,
    "urlsph_create_from_file": _CREATE,
    "urlsph_destroy": [_HANDLE],
    "urlsph_get_last_error": _get(ErrorStruct),
    "urlsph_set_callbacks": _get(CallbacksStruct),
    "urlsph_get_title": [_HANDLE, POINTER(c_char_p)],
    "urlsph_get_counts": _get(CountsStruct),
    "urlsph_get_time": [_HANDLE, POINTER(c_double)],
    "urlsph_get_end_time": [_HANDLE, POINTER(c_double)],
    "urlsph_get_stable_step": [_HANDLE, POINTER(c_double)],
    "urlsph_get_energies": _get(EnergiesStruct),
    "urlsph_get_momenta": _get(MomentaStruct),
    "urlsph_find_patch": _FIND,
    "urlsph_get_patch_info": _get(PatchInfoStruct, c_size_t),
    "urlsph_read_patch_particles": [_HANDLE, c_size_t, POINTER(c_size_t), c_size_t],
    "urlsph_read_patch_areas": _SET,
    "urlsph_read_patch_normals": _SET,
    "urlsph_get_resultant": _get(ResultantStruct, c_size_t),
    "urlsph_get_heat_resultant": _get(HeatResultantStruct, c_size_t),
    "urlsph_find_contact": _FIND,
    "urlsph_get_contact_info": _get(ContactInfoStruct, c_size_t),
    "urlsph_get_contact_resultant": _get(ContactResultantStruct, c_size_t),
    "urlsph_find_field": _FIND,
    "urlsph_get_field_info": _get(FieldInfoStruct, c_size_t),
    "urlsph_read_field": _SET,
    "urlsph_get_view": _get(ViewStruct, c_size_t),
    "urlsph_get_generation": [_HANDLE, POINTER(c_uint64)],
    "urlsph_find_probe": _FIND,
    "urlsph_get_probe_info": _get(ProbeInfoStruct, c_size_t),
    "urlsph_get_probe_motion": _get(ProbeMotionStruct, c_size_t),
    "urlsph_get_input_info": _get(InputInfoStruct, c_size_t),
    "urlsph_set_traction": _SET,
    "urlsph_set_pressure": _SET,
    "urlsph_set_velocity": _SET,
    "urlsph_set_heat_flux": _SET,
    "urlsph_set_temperature": _SET,
    "urlsph_set_convection": [*_SET, POINTER(c_double), c_size_t],
    "urlsph_read_input": [
        _HANDLE,
        c_size_t,
        c_int32,
        POINTER(c_double),
        c_size_t,
        POINTER(c_size_t),
    ],
    "urlsph_step": [_HANDLE, c_double],
    "urlsph_advance_to": [_HANDLE, c_double],
    "urlsph_get_snapshot_size": [_HANDLE, POINTER(c_size_t)],
    "urlsph_save_snapshot": [_HANDLE, POINTER(c_uint8), c_size_t, POINTER(c_size_t)],
    "urlsph_restore_snapshot": [_HANDLE, c_char_p, c_size_t],
    "urlsph_save_snapshot_to_file": [_HANDLE, c_char_p],
    "urlsph_restore_snapshot_from_file": [_HANDLE, c_char_p],
    "urlsph_get_state_hash": [_HANDLE, POINTER(c_uint64)],
}


def _names() -> "tuple[str, str]":
    """File name of the bundled library, and the name that the system's loader knows."""
    if sys.platform == "darwin":
        return "liburlsph.dylib", f"liburlsph.{ABI_VERSION}.dylib"
    if sys.platform == "win32":
        return "urlsph.dll", "urlsph.dll"
    return "liburlsph.so", f"liburlsph.so.{ABI_VERSION}"


def _find() -> str:
    bundled, system = _names()
    beside = Path(__file__).with_name(bundled)
    if beside.exists():
        return str(beside)
    return os.environ.get("URLSPH_LIBRARY") or system


def _load() -> "tuple[ctypes.CDLL, str]":
    path = _find()
    try:
        library = ctypes.CDLL(path)
    except OSError as e:
        raise LibraryError(
            f"cannot load the urlsph library ({e}): install the wheel that brings it along, "
            "set URLSPH_LIBRARY to its file, or install it where the system's loader looks"
        ) from e
    try:
        library.urlsph_abi_version.restype = c_uint32
        found = library.urlsph_abi_version()
        if found != ABI_VERSION:
            raise LibraryError(
                f"{path} has binary interface {found}, but this module needs {ABI_VERSION}: "
                "install matching versions"
            )
        library.urlsph_version.restype = c_char_p
        library.urlsph_status_text.restype = c_char_p
        library.urlsph_status_text.argtypes = [c_int32]
        for name, parameters in _SIGNATURES.items():
            function = getattr(library, name)
            function.restype = c_int32
            function.argtypes = parameters
    except AttributeError as e:
        raise LibraryError(f"{path} is not a urlsph library, or an older one: {e}") from e
    return library, path


lib, _PATH = _load()


def library_version() -> str:
    """Version of the loaded library."""
    return lib.urlsph_version().decode()


def library_path() -> str:
    """File, or name for the system's loader, from which the library was loaded."""
    return _PATH


def check(status: int, handle) -> None:
    """Raises what a failed call with this handle left behind."""
    if status == Status.OK:
        return
    # A busy or a wrong handle leaves no error behind: then the status is all there is.
    if status != Status.BUSY:
        error = ErrorStruct()
        asked = lib.urlsph_get_last_error(handle, error, ctypes.sizeof(error))
        if asked == Status.OK and error.code == status:
            raise error.exception()
    raise _errors.make(status, lib.urlsph_status_text(status).decode())
