"""Exceptions: what is wrong, where, and what to do about it."""

from __future__ import annotations

import enum
from typing import Optional, Tuple


class Status(enum.IntEnum):
    """Outcome of a call of the library; the numbers of ``urlsph_status``."""

    OK = 0
    INVALID_ARGUMENT = 1
    PARSE = 2
    INVALID_SCENE = 3
    IO = 4
    OUT_OF_MEMORY = 5
    DIVERGED = 6
    CANCELLED = 7
    SNAPSHOT = 8
    BUSY = 9
    INTERNAL = 10


class LibraryError(ImportError):
    """The shared library is missing, or its binary interface is another one."""


class StaleViewError(RuntimeError):
    """The state has changed since the view was taken: take a new one."""


class Error(Exception):
    """A failed call.

    Attributes that are not known are None.
    """

    #: Status of the call; an int if this module does not know it.
    code: int
    #: JSON path in the scene.
    path: Optional[str]
    #: Name of the boundary (patch).
    boundary: Optional[str]
    #: Name of the field.
    field: Optional[str]
    #: Particle, 0-based.
    particle: Optional[int]
    #: Current position of that particle [m].
    position: Optional[Tuple[float, float, float]]
    #: Simulated time [s].
    time: Optional[float]

    def __init__(
        self,
        code: int,
        text: str,
        *,
        path: Optional[str] = None,
        boundary: Optional[str] = None,
        field: Optional[str] = None,
        particle: Optional[int] = None,
        position: Optional[Tuple[float, float, float]] = None,
        time: Optional[float] = None,
    ) -> None:
        super().__init__(text)
        self.code = code
        self.path = path
        self.boundary = boundary
        self.field = field
        self.particle = particle
        self.position = position
        self.time = time


class InvalidArgumentError(Error, ValueError):
    """An argument is wrong."""


class SceneError(Error, ValueError):
    """The scene is not well formed, or a value in it is not admissible."""


class SceneFileError(Error, OSError):
    """The file of the scene could not be read."""


class OutOfMemoryError(Error, MemoryError):
    """More memory is needed than there is."""


class DivergedError(Error, ArithmeticError):
    """The solution diverged; the last good state can still be read."""


class CancelledError(Error):
    """A callback cancelled the call."""


class SnapshotError(Error, ValueError):
    """The snapshot is truncated, damaged, or of another scene or version."""


class BusyError(Error, RuntimeError):
    """The simulation is used by another thread, or by the call whose callback this is."""


class InternalError(Error, RuntimeError):
    """A bug in the library: the simulation can only be closed."""


_CLASSES = {
    Status.INVALID_ARGUMENT: InvalidArgumentError,
    Status.PARSE: SceneError,
    Status.INVALID_SCENE: SceneError,
    Status.IO: SceneFileError,
    Status.OUT_OF_MEMORY: OutOfMemoryError,
    Status.DIVERGED: DivergedError,
    Status.CANCELLED: CancelledError,
    Status.SNAPSHOT: SnapshotError,
    Status.BUSY: BusyError,
    Status.INTERNAL: InternalError,
}


def make(status: int, text: str, **place) -> Error:
    """The exception of a status."""
    try:
        status = Status(status)
    except ValueError:
        pass  # of a newer library
    return _CLASSES.get(status, Error)(status, text, **place)
