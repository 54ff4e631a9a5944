"""A simulation, with NumPy arrays."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import threading
import weakref
from ctypes import POINTER, c_char_p, c_double, c_size_t, c_uint8, c_uint64, c_void_p, sizeof
from typing import Any, Callable, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import _library as c
from ._errors import Error, StaleViewError, Status
from ._library import check, lib

_QUANTITIES = {
    "traction": 1,
    "pressure": 2,
    "velocity": 3,
    "heat_flux": 4,
    "temperature": 5,
    "convection_coefficient": 6,
    "ambient_temperature": 7,
}
_QUANTITY_NAMES = {number: name for name, number in _QUANTITIES.items()}
_CONFIGURATIONS = {1: "initial", 2: "current", 3: "two_point"}
_LOG_LEVELS = {1: "error", 3: "info"}
_LOG_EVENTS = {1: "failed", 2: "advanced", 3: "restored"}

Overrides = Union[Mapping[str, Any], Sequence[str]]


class Progress(NamedTuple):
    """Where a running step is."""

    time: float  #: simulated time [s]
    end: float  #: where the call ends [s]
    dt: float  #: time step just made [s]
    steps: int  #: time steps since time 0
    start: float  #: where the call began [s]
    reference_updates: int  #: updates of the reference configuration until now


class LogRecord(NamedTuple):
    """A log message, as text and as data."""

    level: str  #: "error" or "info"; later versions may add levels
    event: str  #: "failed", "advanced" or "restored"; later versions may add events
    message: str  #: for people
    error: Optional[Error]  #: of a call that failed
    time: float  #: simulated time now [s]
    steps: int  #: time steps since time 0


class Energies(NamedTuple):
    """Energies [J] and entropies [J/K]; see ``urlsph_energies``. What a scene lacks is 0."""

    kinetic: float
    strain: float
    external_work: float
    numerical_dissipation: float
    projection: float
    closure_error: float
    thermal: float
    heat_in: float
    plastic_work: float
    ballistic: float
    entropy: float
    entropy_production: float
    contact_dissipation: float


class Momenta(NamedTuple):
    """Momenta of the whole body."""

    linear: np.ndarray  #: [kg m/s]
    angular: np.ndarray  #: about the origin [kg m^2/s]


class Resultant(NamedTuple):
    """What a patch feels and does."""

    force: np.ndarray  #: of the surroundings on the body [N]
    moment: np.ndarray  #: about the origin [N m]
    mean_displacement: np.ndarray  #: [m]
    mean_velocity: np.ndarray  #: [m/s]


class HeatResultant(NamedTuple):
    """Heat through a patch, and its absolute temperature."""

    heat_flow: float  #: into the body [W]
    mean_temperature: float  #: weighted with the initial areas [K]
    maximum_temperature: float  #: of its particles [K]


class ContactResultant(NamedTuple):
    """What a plane of contact does to the body."""

    force: np.ndarray  #: [N], without the impulses of impacts
    impulse: np.ndarray  #: since time 0, with those of impacts [N s]
    displacement: float  #: of the plane along its normal since time 0 [m]
    particles: int  #: that touch the plane


class ProbeMotion(NamedTuple):
    """Motion of a probe, and its temperature."""

    displacement: np.ndarray  #: [m]
    velocity: np.ndarray  #: [m/s]
    temperature: Optional[float]  #: absolute [K]; None of a body without heat


class Patch(NamedTuple):
    """A named set of boundary particles, in the initial configuration."""

    name: str
    index: int
    area: float  #: [m^2]
    particles: np.ndarray  #: numbers of the particles, ascending
    areas: np.ndarray  #: tributary areas [m^2]
    normals: np.ndarray  #: unit outward normals, particles x 3


class Contact(NamedTuple):
    """A rigid frictionless plane."""

    name: str
    index: int
    point: np.ndarray  #: of the plane at time 0 [m]
    normal: np.ndarray  #: unit, towards the body


class Field(NamedTuple):
    """A field."""

    name: str
    index: int
    unit: str  #: SI
    shape: tuple  #: per particle: (), (3,) or (3, 3)
    configuration: str  #: "initial", "current" or "two_point"
    description: str
    has_view: bool  #: whether :meth:`Simulation.view` gives it
    is_present: bool  #: whether the scene has it: some take heat or plasticity


class Probe(NamedTuple):
    """A named point of the body."""

    name: str
    index: int
    position: np.ndarray  #: in the initial configuration [m]


class Input(NamedTuple):
    """A condition that the scene leaves to the outside."""

    patch: str
    quantity: str  #: "traction", "pressure", "velocity", "heat_flux", "temperature", ...
    components: int
    particles: int  #: of the patch
    per_particle: bool  #: as the scene declares it; either form can be set


class _Memory:
    """Memory of the library as NumPy sees it. Arrays hold it, and it holds the simulation."""

    def __init__(self, owner: "Simulation", address: int, shape, strides, typestr: str) -> None:
        self.owner = owner
        self.__array_interface__ = {
            "version": 3,
            "data": (address, True),  # read-only
            "shape": shape,
            "strides": strides,
            "typestr": typestr,
        }


class View:
    """A read-only look at the memory of a field, without a copy.

    Row ``s`` of :attr:`array` belongs to the particle ``order[s]``. A view goes stale when the
    simulation changes: :attr:`array` and :attr:`order` raise :class:`StaleViewError` then. The
    other way round, while an array taken from a view is alive, calls that would change the memory
    under it raise :class:`BufferError`.
    """

    def __init__(self, simulation: "Simulation", view: c.ViewStruct) -> None:
        self._simulation = simulation
        self._view = view

    @property
    def generation(self) -> int:
        """Generation of the state that is looked at."""
        return self._view.generation

    @property
    def is_current(self) -> bool:
        """Whether the state is still that one."""
        return not self._simulation.closed and (
            self._simulation.generation == self._view.generation
        )

    @property
    def array(self) -> npt.NDArray[np.float64]:
        """The values in the order of the memory: (slots,), or slots x components."""
        v = self._view
        double = sizeof(c_double)
        if v.components == 1:
            return self._export(v.data, (v.particles,), (double,), np.dtype(np.float64))
        return self._export(
            v.data,
            (v.particles, v.components),
            (double, v.component_stride * double),
            np.dtype(np.float64),
        )

    @property
    def order(self) -> npt.NDArray[np.uint32]:
        """Particle of each slot."""
        dtype = np.dtype(np.uint32)
        return self._export(self._view.order, (self._view.particles,), (dtype.itemsize,), dtype)

    def _export(self, address: int, shape, strides, dtype: np.dtype) -> np.ndarray:
        if not self.is_current:
            raise StaleViewError("the state has changed since the view was taken: take a new one")
        memory = _Memory(self._simulation, address, shape, strides, dtype.str)
        self._simulation._exports.add(memory)
        return np.asarray(memory)


def _log_record(r) -> LogRecord:
    return LogRecord(
        _LOG_LEVELS.get(r.level, str(r.level)),
        _LOG_EVENTS.get(r.event, str(r.event)),
        r.message.decode(),
        r.error.contents.exception() if r.error else None,
        r.time,
        r.steps,
    )


class _Callbacks:
    """The callbacks as C sees them. What they raise is kept until the call is back."""

    def __init__(
        self,
        log: Optional[Callable[[LogRecord], None]],
        progress: Optional[Callable[[Progress], None]],
        cancel: Optional[Callable[[], bool]],
    ) -> None:
        self.raised: Optional[BaseException] = None

        def guard(f: Callable[[], Any]) -> Any:
            if self.raised is None:
                try:
                    return f()
                # KeyboardInterrupt too: it must not get lost in the library.
                except BaseException as e:
                    self.raised = e
            return None

        def on_log(record, _):
            guard(lambda: log(_log_record(record.contents)))

        def on_progress(p, _):
            p = p.contents
            fields = (p.time, p.end, p.dt, p.steps, p.start, p.reference_updates)
            guard(lambda: progress(Progress(*fields)))

        def on_cancel(_):
            stop = guard(cancel) if cancel else False
            return 1 if stop or self.raised is not None else 0

        self.struct = c.CallbacksStruct(
            None,
            c.LogCallback(on_log) if log else c.LogCallback(),
            c.ProgressCallback(on_progress) if progress else c.ProgressCallback(),
            # Always there: it is the way out of a step for an exception and for Ctrl-C.
            c.CancelCallback(on_cancel),
        )

    def raise_again(self) -> None:
        """Raises what a callback has raised, once."""
        raised, self.raised = self.raised, None
        if raised is not None:
            raise raised

    @contextlib.contextmanager
    def interruptible(self) -> Iterator[None]:
        """Lets Ctrl-C end a running step after the current time step.

        Python would raise KeyboardInterrupt at the entry of a callback, where nobody can catch it,
        and forget it. A handler that somebody else has installed is left alone.
        """
        if (
            threading.current_thread() is not threading.main_thread()
            or signal.getsignal(signal.SIGINT) is not signal.default_int_handler
        ):
            yield
            return

        def interrupt(*_: Any) -> None:
            self.raised = self.raised or KeyboardInterrupt()

        signal.signal(signal.SIGINT, interrupt)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _array(values) -> np.ndarray:
    return np.array(values, dtype=np.float64)


def _pointer(array: np.ndarray, ctype):
    return array.ctypes.data_as(POINTER(ctype))


class Simulation:
    """A body in motion.

    :param scene: the file of a scene, or the scene itself as a mapping.
    :param overrides: values of the scene to replace: a mapping such as
        ``{"geometry.box.spacing": 0.125}``, or texts ``path=value``.
    :param threads: threads of this simulation; 0 for one per core. Results do not depend on it.

    A context manager: the memory and the threads are released at the end of the ``with`` block, or
    by :meth:`close`. Calls release the GIL; a call while another one is running on the same
    simulation raises :class:`BusyError`.
    """

    def __init__(
        self,
        scene: Union[str, "os.PathLike[str]", Mapping[str, Any]],
        *,
        overrides: Overrides = (),
        threads: int = 0,
    ) -> None:
        if isinstance(scene, Mapping):
            self._create(lib.urlsph_create_from_json, json.dumps(scene), overrides, threads)
        else:
            self._create(lib.urlsph_create_from_file, os.fspath(scene), overrides, threads)

    @classmethod
    def from_json(
        cls, text: str, *, overrides: Overrides = (), threads: int = 0
    ) -> "Simulation":
        """From the JSON text of a scene."""
        self = cls.__new__(cls)
        self._create(lib.urlsph_create_from_json, text, overrides, threads)
        return self

    def _create(self, create, text: str, overrides: Overrides, threads: int) -> None:
        self._handle = None
        if isinstance(overrides, str):
            raise TypeError("overrides is a mapping or a sequence of texts, not one text")
        if isinstance(overrides, Mapping):
            overrides = [f"{path}={json.dumps(value)}" for path, value in overrides.items()]
        if threads < 0:
            raise ValueError(f"threads is {threads}: it must not be negative")
        items = (c_char_p * len(overrides))(*[_c_text(o) for o in overrides])
        options = c.OptionsStruct(items, len(overrides), threads)
        handle = c_void_p()
        error = c.ErrorStruct()
        status = create(
            _c_text(text), options, sizeof(options), handle, error, sizeof(error)
        )
        if status != Status.OK:
            raise error.exception()
        self._handle = handle.value
        self._exports: "weakref.WeakSet[_Memory]" = weakref.WeakSet()
        self._fields: Optional[Dict[str, Field]] = None
        self._patches: Optional[Dict[str, Patch]] = None
        self._contacts: Optional[Dict[str, Contact]] = None
        self._probes: Optional[Dict[str, Probe]] = None
        self._callbacks = _Callbacks(None, None, None)
        self.set_callbacks()

    # Life.

    @property
    def closed(self) -> bool:
        """Whether :meth:`close` was called."""
        return self._handle is None

    def close(self) -> None:
        """Releases the memory and the threads; further calls raise an error.

        :raises BufferError: while an array taken from a view is alive.
        """
        if self._handle is not None:
            self._check_exports("close")
            # A call on another thread is still running: the handle stays.
            check(lib.urlsph_destroy(self._handle), self._handle)
            self._handle = None

    def __enter__(self) -> "Simulation":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __del__(self) -> None:
        # Arrays of views hold the simulation: there are none left here.
        if getattr(self, "_handle", None) is not None:
            lib.urlsph_destroy(self._handle)

    def __repr__(self) -> str:
        if self.closed:
            return "<urlsph.Simulation, closed>"
        return f"<urlsph.Simulation of {self.particle_count} particles at {self.time:.6g} s>"

    def _call(self, function, *arguments) -> None:
        if self._handle is None:
            raise ValueError("the simulation is closed")
        status = function(self._handle, *arguments)
        # What a callback has raised belongs to the call under way, not to one that finds it busy.
        if status != Status.BUSY:
            self._callbacks.raise_again()
        check(status, self._handle)

    def _change(self, function, *arguments) -> None:
        self._check_exports("change")
        self._call(function, *arguments)

    def _check_exports(self, verb: str) -> None:
        if len(self._exports):
            raise BufferError(
                f"cannot {verb} the simulation while arrays of its views are alive: "
                "delete them, or copy them before"
            )

    def _value(self, function, ctype):
        value = ctype()
        self._call(function, value)
        return value.value

    def _struct(self, function, struct, *index):
        value = struct()
        self._call(function, *index, value, sizeof(value))
        return value

    def _find(self, function, name: str) -> int:
        index = c_size_t()
        self._call(function, _c_text(name), index)
        return index.value

    # The simulation as a whole.

    def set_callbacks(
        self,
        *,
        log: Optional[Callable[[LogRecord], None]] = None,
        progress: Optional[Callable[[Progress], None]] = None,
        cancel: Optional[Callable[[], bool]] = None,
    ) -> None:
        """Sets what the simulation calls, on the thread that calls the simulation.

        :param log: receives each log message as a :class:`LogRecord`.
        :param progress: is called after each time step.
        :param cancel: is asked after each time step; a true answer ends the call with
            :class:`CancelledError`.

        An exception raised in a callback ends the running call, which raises it again.
        """
        callbacks = _Callbacks(log, progress, cancel)
        self._call(lib.urlsph_set_callbacks, callbacks.struct, sizeof(callbacks.struct))
        # The old ones are released only now, when the library does not know them any more.
        self._callbacks = callbacks

    @property
    def title(self) -> str:
        """Title of the scene."""
        return self._value(lib.urlsph_get_title, c_char_p).decode()

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._value(lib.urlsph_get_time, c_double)

    @property
    def end_time(self) -> float:
        """End of the run that the scene describes [s]."""
        return self._value(lib.urlsph_get_end_time, c_double)

    @property
    def stable_step(self) -> float:
        """Largest stable time step from the present state [s]."""
        return self._value(lib.urlsph_get_stable_step, c_double)

    @property
    def generation(self) -> int:
        """Changes whenever the state does."""
        return self._value(lib.urlsph_get_generation, c_uint64)

    @property
    def state_hash(self) -> int:
        """Hash of the complete state."""
        return self._value(lib.urlsph_get_state_hash, c_uint64)

    def _counts(self) -> c.CountsStruct:
        return self._struct(lib.urlsph_get_counts, c.CountsStruct)

    @property
    def particle_count(self) -> int:
        """Number of particles."""
        return self._counts().particles

    @property
    def pair_count(self) -> int:
        """Number of directed pairs of neighbours."""
        return self._counts().pairs

    @property
    def steps(self) -> int:
        """Time steps since time 0."""
        return self._counts().steps

    @property
    def threads(self) -> int:
        """Threads of this simulation."""
        return self._counts().threads

    @property
    def energies(self) -> Energies:
        """Energies now."""
        e = self._struct(lib.urlsph_get_energies, c.EnergiesStruct)
        return Energies(*(getattr(e, name) for name in Energies._fields))

    @property
    def momenta(self) -> Momenta:
        """Momenta now."""
        m = self._struct(lib.urlsph_get_momenta, c.MomentaStruct)
        return Momenta(_array(m.linear), _array(m.angular))

    # Time.

    def step(self, dt: float) -> None:
        """Advances by ``dt`` [s], in as many stable steps as needed, and ends exactly there."""
        with self._callbacks.interruptible():
            self._change(lib.urlsph_step, dt)
        self._callbacks.raise_again()

    def advance_to(self, time: float) -> None:
        """Advances to ``time`` [s], in as many stable steps as needed, and ends exactly there."""
        with self._callbacks.interruptible():
            self._change(lib.urlsph_advance_to, time)
        self._callbacks.raise_again()

    # Patches.

    @property
    def patches(self) -> Dict[str, Patch]:
        """The patches by name."""
        if self._patches is None:
            patches = {}
            for index in range(self._counts().patches):
                info = self._struct(lib.urlsph_get_patch_info, c.PatchInfoStruct, index)
                n = info.particles
                particles = np.empty(n, dtype=np.uintp)
                areas = np.empty(n)
                normals = np.empty((n, 3))
                self._call(
                    lib.urlsph_read_patch_particles, index, _pointer(particles, c_size_t), n
                )
                self._call(lib.urlsph_read_patch_areas, index, _pointer(areas, c_double), n)
                self._call(
                    lib.urlsph_read_patch_normals, index, _pointer(normals, c_double), 3 * n
                )
                name = info.name.decode()
                patches[name] = Patch(name, index, info.area, particles, areas, normals)
            self._patches = patches
        return self._patches

    def resultant(self, patch: str) -> Resultant:
        """Resultant force and moment, mean displacement and mean velocity of a patch now."""
        index = self._find(lib.urlsph_find_patch, patch)
        r = self._struct(lib.urlsph_get_resultant, c.ResultantStruct, index)
        return Resultant(*(_array(getattr(r, name)) for name in Resultant._fields))

    def heat_resultant(self, patch: str) -> HeatResultant:
        """Heat flow through a patch, its mean and maximum temperature; only of a body with heat."""
        index = self._find(lib.urlsph_find_patch, patch)
        r = self._struct(lib.urlsph_get_heat_resultant, c.HeatResultantStruct, index)
        return HeatResultant(*(getattr(r, name) for name in HeatResultant._fields))

    # Planes of contact.

    @property
    def contacts(self) -> Dict[str, Contact]:
        """The planes of contact by name."""
        if self._contacts is None:
            contacts = {}
            for index in range(self._counts().contacts):
                info = self._struct(lib.urlsph_get_contact_info, c.ContactInfoStruct, index)
                name = info.name.decode()
                contacts[name] = Contact(name, index, _array(info.point), _array(info.normal))
            self._contacts = contacts
        return self._contacts

    def contact_resultant(self, contact: str) -> ContactResultant:
        """Force, impulse, displacement and touching particles of a plane of contact now."""
        index = self._find(lib.urlsph_find_contact, contact)
        r = self._struct(lib.urlsph_get_contact_resultant, c.ContactResultantStruct, index)
        return ContactResultant(_array(r.force), _array(r.impulse), r.displacement, r.particles)

    # Fields.

    @property
    def fields(self) -> Dict[str, Field]:
        """The fields by name."""
        if self._fields is None:
            fields = {}
            for index in range(self._counts().fields):
                info = self._struct(lib.urlsph_get_field_info, c.FieldInfoStruct, index)
                name = info.name.decode()
                fields[name] = Field(
                    name,
                    index,
                    info.unit.decode(),
                    {1: (), 9: (3, 3)}.get(info.components, (info.components,)),
                    _CONFIGURATIONS.get(info.configuration, str(info.configuration)),
                    info.description.decode(),
                    bool(info.has_view),
                    bool(info.is_present),
                )
            self._fields = fields
        return self._fields

    def _field(self, name: str) -> Field:
        field = self.fields.get(name)
        # The library's error lists the names that there are.
        return field or self.fields[str(self._find(lib.urlsph_find_field, name))]

    def read(self, field: str, out: Optional[np.ndarray] = None) -> npt.NDArray[np.float64]:
        """A copy of a field, in the caller's order of particles.

        :param field: name, see :attr:`fields`.
        :param out: an array to be filled instead of a new one: C-contiguous doubles of the shape
            ``(particles, *shape of the field)``.
        """
        f = self._field(field)
        shape = (self.particle_count, *f.shape)
        if out is None:
            out = np.empty(shape)
        elif out.shape != shape or out.dtype != np.float64 or not out.flags.carray:
            raise ValueError(
                f"out has shape {out.shape} and type {out.dtype}: it must be a writeable "
                f"C-contiguous array of float64 of shape {shape}"
            )
        self._call(lib.urlsph_read_field, f.index, _pointer(out, c_double), out.size)
        return out

    def view(self, field: str) -> View:
        """A look at the memory of a field without a copy; only for fields with ``has_view``."""
        index = self._field(field).index
        return View(self, self._struct(lib.urlsph_get_view, c.ViewStruct, index))

    # Probes.

    @property
    def probes(self) -> Dict[str, Probe]:
        """The probes by name."""
        if self._probes is None:
            probes = {}
            for index in range(self._counts().probes):
                info = self._struct(lib.urlsph_get_probe_info, c.ProbeInfoStruct, index)
                name = info.name.decode()
                probes[name] = Probe(name, index, _array(info.position))
            self._probes = probes
        return self._probes

    def probe(self, name: str) -> ProbeMotion:
        """Displacement, velocity and temperature of a probe now."""
        index = self._find(lib.urlsph_find_probe, name)
        m = self._struct(lib.urlsph_get_probe_motion, c.ProbeMotionStruct, index)
        return ProbeMotion(_array(m.displacement), _array(m.velocity), m.temperature or None)

    # Inputs.

    @property
    def inputs(self) -> List[Input]:
        """What the scene leaves to the outside."""
        names = list(self.patches)
        inputs = []
        for index in range(self._counts().inputs):
            info = self._struct(lib.urlsph_get_input_info, c.InputInfoStruct, index)
            inputs.append(
                Input(
                    names[info.patch],
                    _QUANTITY_NAMES.get(info.quantity, str(info.quantity)),
                    info.components,
                    info.particles,
                    bool(info.per_particle),
                )
            )
        return inputs

    def input(self, patch: str, quantity: str) -> npt.NDArray[np.float64]:
        """Present values of an input: flat, in one of the two shapes in which they can be set."""
        index = self._find(lib.urlsph_find_patch, patch)
        values = np.empty(3 * len(self.patches[patch].particles))
        count = c_size_t()
        self._call(
            lib.urlsph_read_input,
            index,
            _QUANTITIES.get(quantity, 0),
            _pointer(values, c_double),
            values.size,
            count,
        )
        return values[: count.value].copy()

    def set_traction(self, patch: str, values: npt.ArrayLike) -> None:
        """Sets a traction per unit initial area [Pa]: 3 numbers, or particles x 3."""
        self._set(lib.urlsph_set_traction, patch, values)

    def set_pressure(self, patch: str, values: npt.ArrayLike) -> None:
        """Sets a follower pressure, positive in compression [Pa]: a number, or one per particle."""
        self._set(lib.urlsph_set_pressure, patch, values)

    def set_velocity(self, patch: str, values: npt.ArrayLike) -> None:
        """Sets a velocity [m/s]: 3 numbers, or particles x 3."""
        self._set(lib.urlsph_set_velocity, patch, values)

    def set_heat_flux(self, patch: str, values: npt.ArrayLike) -> None:
        """Sets a heat flux into the body per unit initial area [W/m^2]: a number, or one per
        particle."""
        self._set(lib.urlsph_set_heat_flux, patch, values)

    def set_temperature(self, patch: str, values: npt.ArrayLike) -> None:
        """Sets an absolute temperature [K]: a number, or one per particle. The next step takes it."""
        self._set(lib.urlsph_set_temperature, patch, values)

    def set_convection(
        self,
        patch: str,
        *,
        coefficient: Optional[npt.ArrayLike] = None,
        ambient_temperature: Optional[npt.ArrayLike] = None,
    ) -> None:
        """Sets the convection, both or one of them: each a number, or one per particle.

        :param coefficient: heat transfer coefficient per unit initial area [W/(m^2 K)].
        :param ambient_temperature: absolute temperature of the surroundings [K].
        """
        self._set(lib.urlsph_set_convection, patch, coefficient, ambient_temperature)

    def _set(self, function, patch: str, *values: Optional[npt.ArrayLike]) -> None:
        index = self._find(lib.urlsph_find_patch, patch)
        arguments: List[Any] = []
        # Holds the memory during the call.
        arrays = [None if v is None else np.ascontiguousarray(v, dtype=np.float64) for v in values]
        for array in arrays:
            pointer = None if array is None else _pointer(array, c_double)
            arguments += [pointer, 0 if array is None else array.size]
        self._change(function, index, *arguments)

    # State.

    def snapshot(self) -> bytes:
        """The complete state: restoring it and stepping gives the same bits again."""
        size = c_size_t(self._value(lib.urlsph_get_snapshot_size, c_size_t))
        buffer = (c_uint8 * size.value)()
        self._call(lib.urlsph_save_snapshot, buffer, size.value, size)
        return bytes(buffer)

    def restore(self, snapshot: bytes) -> None:
        """Returns to a snapshot of a simulation of the same scene."""
        snapshot = bytes(snapshot)
        self._change(lib.urlsph_restore_snapshot, snapshot, len(snapshot))

    def save_snapshot(self, path: Union[str, "os.PathLike[str]"]) -> None:
        """Writes the complete state to a file, which is there when all of it is, or stays as it was."""
        self._call(lib.urlsph_save_snapshot_to_file, _c_text(os.fspath(path)))

    def restore_snapshot(self, path: Union[str, "os.PathLike[str]"]) -> None:
        """Returns to a snapshot in a file, of a simulation of the same scene."""
        self._change(lib.urlsph_restore_snapshot_from_file, _c_text(os.fspath(path)))


def _c_text(text: str) -> bytes:
    data = text.encode()
    if b"\0" in data:
        raise ValueError(f"{text!r} contains the character U+0000")
    return data
