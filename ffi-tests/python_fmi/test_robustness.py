"""Wrong use, odd importers, many instances."""

import ctypes
import shutil
import threading
import time
from ctypes import CFUNCTYPE, byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, \
    c_void_p
from pathlib import Path

import numpy as np
import pytest
from fmpy import extract

from driver import ERROR, Driver, only_fmi3, status
from raw import LOG3, Raw, library, threads_and_memory


def test_wrong_phases(start):
    instance = start(initialize=False)
    assert status(instance.step, 0.001) == ERROR
    assert status(instance.fmu.exitInitializationMode) == ERROR
    assert status(instance.fmu.terminate) == ERROR
    instance.initialize()
    assert status(instance.fmu.enterInitializationMode) == ERROR
    assert status(instance.set, "material.density", 2000.0) == ERROR
    assert instance.get("material.density") == 1100.0
    instance.step(0.001)
    instance.fmu.terminate()
    assert status(instance.set, "boundary.top.traction", 0.0) == ERROR
    instance.fmu.reset()
    instance.initialize()
    instance.step(0.001)


def test_wrong_steps(start):
    instance = start()
    instance.step(0.001)
    here = instance.observe()
    for size in [0.0, -0.001, float("nan"), float("inf")]:
        assert status(instance.fmu.doStep, 0.001, size) == ERROR, size
    for point in [0.0, 0.0005, 0.002, -1.0, float("nan")]:
        assert status(instance.fmu.doStep, point, 0.001) == ERROR, point
    assert instance.observe() == here
    instance.step(0.001)


def test_wrong_references(start):
    instance = start()
    get = instance.fmu.getReal if instance.version == 2 else instance.fmu.getFloat64
    put = instance.fmu.setReal if instance.version == 2 else instance.fmu.setFloat64
    energy = instance.variables["energy.kinetic"].valueReference
    threads = instance.variables["threads"].valueReference
    here = instance.observe()
    assert status(get, [10**9]) == ERROR
    assert status(get, [energy, 10**9]) == ERROR
    assert status(get, [threads]) == ERROR
    assert status(put, [energy], [1.0]) == ERROR
    assert status(put, [0], [1.0]) == ERROR
    assert get([]) == []
    assert instance.observe() == here


@only_fmi3
def test_wrong_lengths(start):
    instance = start(fmi=3)
    traction = instance.variables["boundary.top.traction"].valueReference
    before = instance.get("boundary.top.traction")
    for n in (0, 1, 2, 4):
        assert status(instance.fmu.getFloat64, [traction], nValues=n) == ERROR
        assert status(instance.fmu.setFloat64, [traction], [7.0] * n) == ERROR
    # A reference inside an array belongs to no variable.
    assert status(instance.fmu.getFloat64, [traction + 1]) == ERROR
    assert np.array_equal(instance.get("boundary.top.traction"), before)


def test_wrong_values(start):
    instance = start(initialize=False)
    before = instance.get("boundary.top.traction")
    for value in [float("nan"), float("inf")]:
        assert status(instance.set, "boundary.top.traction", [1.0, value, 2.0]) == ERROR
    assert np.array_equal(instance.get("boundary.top.traction"), before)
    for name, value in [("material.poisson_ratio", 0.5), ("material.density", -1.0),
                        ("material.youngs_modulus", float("nan")), ("numerics.cfl", 0.0),
                        ("threads", -1)]:
        kept = instance.get(name)
        assert status(instance.set, name, value) == ERROR, name
        assert instance.get(name) == kept
    instance.initialize()
    instance.step(0.001)


def test_wrong_experiment(export, version):
    for start_time, stop in [(float("nan"), None), (1.0, 0.5), (0.0, float("nan"))]:
        instance = Driver(export("column", version))
        assert status(instance.initialize, start_time, stop) == ERROR
        instance.free()


def test_divergence_keeps_the_last_good_state(start):
    instance = start()
    instance.step(0.001)
    state = instance.get_state()
    instance.set("boundary.top.traction", [0.0, -1e12, 0.0])
    assert status(instance.step, 0.01) == ERROR
    energy = instance.get("energy.kinetic")
    assert np.isfinite(energy)
    assert 0.001 <= instance.get("time") < 0.011
    if instance.version == 2:
        # fmi2LastSuccessfulTime
        assert instance.fmu.getRealStatus(2) == instance.get("time")
    # Back, with a load that it can bear.
    instance.set_state(state)
    instance.time = 0.001
    instance.set("boundary.top.traction", [0.0, -1e3, 0.0])
    instance.step(0.01)


@pytest.fixture
def raw(export, version):
    folder = extract(export("column", version))
    yield Raw(folder, version)
    shutil.rmtree(folder, ignore_errors=True)


def test_instantiation_is_guarded(raw):
    assert raw.instantiate(token=b"{another}") is None
    assert raw.instantiate(token=b"") is None
    if raw.version == 3:
        status_, category, text = raw.messages[-1]
        assert status_ == ERROR and category == "logStatusError"
        assert "export it again" in text
    else:
        # fmi2ModelExchange
        assert raw.instantiate(kind=0) is None
    null = raw.instantiate(name=None)
    assert null
    raw.free(null)


def test_null_token(raw):
    function = raw["Instantiate" if raw.version == 2 else "InstantiateCoSimulation"]
    function.restype = c_void_p
    if raw.version == 2:
        assert function(None, 1, None, None, None, 0, 0) is None
    else:
        assert function(
            None, None, None, c_bool(False), c_bool(False), c_bool(False), c_bool(False), None,
            c_size_t(0), None, None, None) is None


@pytest.mark.parametrize("resources", [None, b"", b"/no/such/folder", b"file:///no/such/folder"])
def test_resources_are_found_beside_the_library(raw, resources):
    instance = raw.instantiate(resources=resources)
    assert instance
    raw.initialize(instance)
    assert raw.step(instance, 0.0, 0.001) == 0
    raw.free(instance)


def test_path_with_blanks_and_percent(raw, tmp_path):
    folder = tmp_path / "a b %41 ü"
    shutil.copytree(raw.folder, folder)
    shutil.rmtree(raw.folder)
    moved = Raw(folder, raw.version)
    instance = moved.instantiate()
    assert instance
    moved.free(instance)


def test_null_instances(raw):
    nothing = c_void_p()
    assert raw["Terminate"](nothing) == ERROR
    assert raw["Reset"](nothing) == ERROR
    assert raw.step(None, 0.0, 0.001) == ERROR
    raw["FreeInstance"](nothing)


def test_null_arrays(raw):
    instance = raw.instantiate()
    raw.initialize(instance)
    reference = (c_uint32 * 1)(0)
    if raw.version == 2:
        assert raw.call("GetReal", instance, None, c_size_t(1), None) == ERROR
        assert raw.call("GetReal", instance, reference, c_size_t(1), None) == ERROR
        assert raw.call("SetReal", instance, reference, c_size_t(1), None) == ERROR
    else:
        assert raw.call(
            "GetFloat64", instance, None, c_size_t(1), None, c_size_t(1)) == ERROR
        assert raw.call(
            "SetFloat64", instance, reference, c_size_t(1), None, c_size_t(1)) == ERROR
        assert any("NULL" in text for _, _, text in raw.messages)
    raw.free(instance)


def test_an_instance_of_the_other_standard_is_refused(raw):
    instance = raw.instantiate()
    other = raw.library["fmi3Reset" if raw.version == 2 else "fmi2Reset"]
    assert other(c_void_p(instance)) == ERROR
    raw.free(instance)


def test_unsupported_functions_say_so(raw):
    instance = raw.instantiate()
    raw.initialize(instance)
    names = ["EnterEventMode", "EnterContinuousTimeMode"]
    if raw.version == 3:
        names += ["EnterConfigurationMode", "EnterStepMode", "EvaluateDiscreteStates"]
    for name in names:
        assert raw.call(name, instance) == ERROR
    reference = (c_uint32 * 1)(0)
    if raw.version == 3:
        for kind in ["Float32", "Int8", "UInt16", "Int64", "Boolean", "String"]:
            values = (c_double * 1)()
            get = f"Get{kind}"
            assert raw.call(
                get, instance, reference, c_size_t(1), values, c_size_t(1)) == ERROR
            # For no variables, every type will do.
            assert raw.call(get, instance, None, c_size_t(0), None, c_size_t(0)) == 0
        assert any("no variables of this type" in text for _, _, text in raw.messages)
    else:
        values = (c_int * 1)()
        assert raw.call("GetBoolean", instance, reference, c_size_t(1), values) == ERROR
        assert raw.call("GetBoolean", instance, None, c_size_t(0), None) == 0
        assert raw.call("GetStatus", instance, 0, values) == ERROR
    assert raw.step(instance, 0.0, 0.001) == 0
    raw.free(instance)


def test_log_of_fmi2_is_escaped(export):
    """The logger is variadic: a percent sign in a message must not be read as a format."""
    folder = Path(extract(export("column", 2)))
    messages = []
    logger = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p)(
        lambda _, name, status_, category, form, text: messages.append(
            (name, status_, category, form, text)))

    class Callbacks(ctypes.Structure):
        _fields_ = [("logger", c_void_p), ("rest", c_void_p * 4)]

    callbacks = Callbacks(ctypes.cast(logger, c_void_p))
    function = library(folder)["fmi2Instantiate"]
    function.restype = c_void_p
    assert function(
        c_char_p(b"100%s"), 1, c_char_p(b"%n%s"), None, byref(callbacks), 0, 1) is None
    (name, status_, category, form, text), = messages
    assert (name, status_, category, form) == (b"100%s", ERROR, b"logStatusError", b"%s")
    assert b"%n%s" in text
    shutil.rmtree(folder, ignore_errors=True)


@only_fmi3
def test_logging(raw):
    instance = raw.instantiate()
    raw.initialize(instance)
    assert raw.messages == []
    categories = (c_char_p * 1)(b"logEvents")
    assert raw.call("SetDebugLogging", instance, c_bool(True), c_size_t(1), categories) == 0
    assert raw.call("Terminate", instance) == 0
    assert raw.messages == [(0, "logEvents", "fmi3Terminate")]
    wrong = (c_char_p * 1)(b"nothing")
    assert raw.call("SetDebugLogging", instance, c_bool(True), c_size_t(1), wrong) == ERROR
    assert raw.call("SetDebugLogging", instance, c_bool(False), c_size_t(0), None) == 0
    raw.messages.clear()
    raw.free(instance)
    assert raw.messages == []


@only_fmi3
def test_a_logger_that_calls_back(raw):
    """A message in the middle of a call does not lock the instance up."""
    seen = []

    def log(_, status_, category, text):
        seen.append(raw.call("SetDebugLogging", instance, c_bool(False), c_size_t(0), None))

    raw.log3 = LOG3(log)
    instance = raw.instantiate()
    assert raw.call("Terminate", instance) == ERROR
    assert seen == [0]
    raw.free(instance)


def test_instances_come_and_go_without_a_trace(raw):
    def live(times):
        for _ in range(times):
            instance = raw.instantiate(log=False)
            raw.initialize(instance)
            assert raw.step(instance, 0.0, 1e-4) == 0
            raw.free(instance)

    live(20)
    threads, memory = threads_and_memory()
    live(100)
    threads_after, memory_after = threads_and_memory()
    growth = memory_after - memory
    print(f"{threads} -> {threads_after} threads; memory grew by {growth} bytes, tolerance 4 MB")
    assert threads_after == threads
    assert growth < 4e6


def test_instances_in_one_process(start):
    lonely = start()
    lonely.run(0.01, 0.005)
    crowd = [start() for _ in range(4)]
    for k, driver in enumerate(crowd):
        driver.set("boundary.top.traction", [1000.0 + k, 0.0, 0.0])
    for _ in range(2):
        for driver in crowd:
            driver.step(0.005)
    assert crowd[0].observe() == lonely.observe()
    assert crowd[1].observe() != lonely.observe()


def test_instances_from_threads(start):
    lonely = start()
    lonely.run(0.02, 0.005)
    drivers = [start() for _ in range(4)]
    workers = [threading.Thread(target=d.run, args=(0.02, 0.005)) for d in drivers]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert all(d.observe() == lonely.observe() for d in drivers)


def test_one_instance_from_changing_threads(start):
    lonely, wandering = start(), start()
    for _ in range(4):
        worker = threading.Thread(target=wandering.step, args=(0.005,))
        worker.start()
        worker.join()
        lonely.step(0.005)
    assert wandering.observe() == lonely.observe()


def test_calls_at_once_are_refused_or_done(start):
    """Two threads on one instance: one works, the other may be told to wait."""
    instance = start()
    energy = instance.variables["energy.kinetic"].valueReference
    get = instance.fmu.getReal if instance.version == 2 else instance.fmu.getFloat64
    patience = time.monotonic() + 60

    def step():
        # The other call may come first; a step that is refused changes nothing.
        while status(instance.step, 0.05) == ERROR and time.monotonic() < patience:
            pass

    worker = threading.Thread(target=step)
    worker.start()
    outcomes = set()
    while worker.is_alive():
        outcomes.add(status(get, [energy]))
    worker.join()
    assert outcomes <= {0, ERROR}
    assert instance.get("time") == 0.05
