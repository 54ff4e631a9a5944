"""The state of the FMU: rollback, copies, bytes."""

from ctypes import byref, c_void_p

import numpy as np
import pytest

from driver import ERROR, status

SCENES = ["column", "per_particle", "mooney", "driven"]


@pytest.mark.parametrize("name", SCENES)
def test_a_repeated_step_gives_the_same_bits(start, name):
    instance = start(name)
    instance.step(0.004)
    state, time = instance.get_state(), instance.time
    before = instance.observe()
    instance.step(0.003)
    instance.step(0.001)
    first = instance.observe()
    instance.set_state(state)
    instance.time = time
    assert instance.observe() == before
    instance.step(0.003)
    instance.step(0.001)
    assert instance.observe() == first
    assert first != before
    instance.free_state(state)


def test_a_step_that_is_never_left_and_one_that_is_resumed(start):
    straight, resumed = start(), start()
    straight.run(0.02, 0.005)
    resumed.run(0.01, 0.005)
    state = resumed.get_state()
    resumed.run(0.02, 0.005)
    resumed.set_state(state)
    resumed.time = 0.01
    resumed.run(0.02, 0.005)
    assert resumed.observe() == straight.observe()


def test_inputs_and_parameters_belong_to_the_state(start):
    instance = start(initialize=False)
    instance.initialize(material__density=2200.0)
    instance.set("boundary.top.traction", [1.0, 2.0, 3.0])
    state = instance.get_state()
    instance.set("boundary.top.traction", [4.0, 5.0, 6.0])
    instance.step(0.001)
    instance.set_state(state)
    assert np.array_equal(instance.get("boundary.top.traction"), [1.0, 2.0, 3.0])
    # After a reset the state brings the parameters back.
    instance.fmu.reset()
    assert instance.get("material.density") == 1100.0
    instance.set_state(state)
    assert instance.get("material.density") == 2200.0
    assert instance.get("time") == 0.0
    instance.time = 0.0
    instance.step(0.001)


def test_a_state_before_initialisation(start):
    instance = start(initialize=False)
    state = instance.get_state()
    instance.initialize()
    instance.step(0.001)
    instance.set_state(state)
    assert status(instance.step, 0.001) == ERROR
    instance.initialize()
    instance.step(0.001)


def test_a_state_object_is_used_again(start):
    instance = start()
    state = instance.get_state()
    instance.step(0.001)
    place = c_void_p(state.value)
    getter = instance.fmu.fmi2GetFMUstate if instance.version == 2 else instance.fmu.fmi3GetFMUState
    getter(instance.fmu.component, byref(place))
    assert place.value == state.value
    here = instance.observe()
    instance.step(0.001)
    instance.set_state(place)
    assert instance.observe() == here


@pytest.mark.parametrize("name", SCENES)
def test_bytes_into_a_fresh_instance(start, export, version, name):
    old = start(name)
    old.step(0.004)
    data = old.serialize(old.get_state())
    assert data == old.serialize(old.get_state())
    old.step(0.004)
    new = start(name, initialize=False)
    state = new.deserialize(data)
    new.set_state(state)
    new.time = 0.004
    new.step(0.004)
    assert new.observe() == old.observe()


def test_bytes_are_checked(start):
    instance = start()
    instance.step(0.001)
    data = instance.serialize(instance.get_state())
    here = instance.observe()
    for bad in [b"", b"x", data[:-1], data[:100], data + b"\0", bytes(len(data))]:
        assert status(instance.deserialize, bad) == ERROR
    for at in [0, 15, 20, 60, len(data) // 2, len(data) - 1]:
        bad = bytearray(data)
        bad[at] ^= 1
        assert status(instance.deserialize, bytes(bad)) == ERROR, at
    assert instance.observe() == here


def test_states_of_another_fmu_are_refused(start):
    one, other = start("column"), start("driven")
    data = other.serialize(other.get_state())
    assert status(one.deserialize, data) == ERROR
    here = one.observe()
    assert status(one.set_state, other.get_state()) == ERROR
    assert one.observe() == here


def test_null_states(start):
    instance = start()
    assert status(instance.set_state, c_void_p()) == ERROR
    assert status(instance.serialize, c_void_p()) == ERROR
    # Freeing nothing is allowed.
    instance.free_state(c_void_p())


def test_many_states_do_not_leak(start):
    instance = start()
    for _ in range(200):
        instance.free_state(instance.get_state())

    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * 4096

    before = resident()
    for _ in range(500):
        instance.free_state(instance.get_state())
    growth = resident() - before
    print(f"resident memory grew by {growth} bytes over 500 states, tolerance 2 MB")
    assert growth < 2e6
