"""Days in a host, in short: the library loaded and unloaded at ever new paths, one instance called without end.

The environment variable URLSPH_SOAK multiplies what is done; with 100 it is 2,000 loads and a million calls of each kind.
"""

import _ctypes
import ctypes
import os
import shutil

from driver import only_fmi3
from raw import Raw, threads_and_memory

FACTOR = int(os.environ.get("URLSPH_SOAK", "1"))
LOADS = 20 * FACTOR
# What a load leaves [bytes]: statics of two dependencies, a regular expression and the records of a collector, which
# nothing frees when a library is unloaded.
LEFT = 40_000
CALLS = 10_000 * FACTOR


def next_key():
    """The first free of the 1,024 keys of thread-local storage that a process has."""
    libc, key = ctypes.CDLL(None), ctypes.c_uint()
    assert libc.pthread_key_create(ctypes.byref(key), None) == 0
    assert libc.pthread_key_delete(key) == 0
    return key.value


def is_mapped(folder):
    with open("/proc/self/maps") as file:
        return any(str(folder) in line for line in file)


def test_loads_at_fresh_paths(unpacked, version, tmp_path):
    """As importers do: unpack, load, instantiate, step, free, unload, delete."""

    def live(first, last):
        for n in range(first, last):
            folder = tmp_path / f"fresh{n}"
            shutil.copytree(unpacked, folder)
            raw = Raw(folder, version)
            instance = raw.instantiate(log=False)
            raw.initialize(instance)
            assert raw.step(instance, 0.0, 1e-4) == 0
            raw.free(instance)
            _ctypes.dlclose(raw.library._handle)
            assert not is_mapped(folder), "the library is still there"
            shutil.rmtree(folder)

    warm = max(LOADS // 10, 5)
    live(0, warm)
    threads, memory = threads_and_memory()
    key = next_key()
    live(warm, warm + LOADS)
    threads_after, memory_after = threads_and_memory()
    assert next_key() == key, "a load leaves a key of thread-local storage"
    growth = memory_after - memory
    tolerance = 1e6 + LEFT * LOADS
    print(f"{LOADS} loads: {threads} -> {threads_after} threads; memory grew by {growth} bytes, tolerance {tolerance:g}")
    assert threads_after == threads
    assert growth < tolerance


@only_fmi3
def test_calls_without_end(start):
    """Set, step and get of one instance."""
    instance = start("column")
    reference = instance.variables["boundary.top.traction"].valueReference
    energy = instance.variables["energy.kinetic"].valueReference

    def live(times):
        for n in range(times):
            instance.fmu.setFloat64([reference], [100.0 * (n % 7), 0.0, 0.0])
            instance.step(1e-6)
            assert instance.fmu.getFloat64([energy])[0] >= 0.0

    live(CALLS // 10)
    threads, memory = threads_and_memory()
    live(CALLS)
    threads_after, memory_after = threads_and_memory()
    growth = memory_after - memory
    print(f"{CALLS} calls: {threads} -> {threads_after} threads; memory grew by {growth} bytes, tolerance 4 MB")
    assert threads_after == threads
    assert growth < 4e6
