"""An FMU's C functions without FMPy in between, and what a process has."""

import ctypes
import time
from ctypes import CFUNCTYPE, c_bool, c_char_p, c_double, c_int, c_size_t, c_void_p
from pathlib import Path

from fmpy import read_model_description


def library(folder):
    return ctypes.CDLL(str(next(Path(folder).glob("binaries/*/urlsph.*"))))


LOG3 = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class Raw:
    """The C functions without FMPy in between."""

    def __init__(self, folder, version):
        self.version, self.folder = version, Path(folder)
        self.library = library(folder)
        self.token = read_model_description(str(folder)).guid.encode()
        self.messages = []
        # Kept alive as long as the instances.
        self.log3 = LOG3(lambda _, status, category, text: self.messages.append(
            (status, category.decode(), text.decode())))

    def __getitem__(self, name):
        return self.library[f"fmi{self.version}{name}"]

    def instantiate(self, name=b"raw", token=None, resources=..., log=True, kind=1):
        token = self.token if token is None else token
        if resources is ...:
            path = self.folder / "resources"
            resources = (path.as_uri() if self.version == 2 else str(path)).encode()
        function = self["Instantiate" if self.version == 2 else "InstantiateCoSimulation"]
        function.restype = c_void_p
        if self.version == 2:
            # Without a logger; some importers pass no functions at all.
            return function(c_char_p(name), kind, c_char_p(token), c_char_p(resources), None, 0, 0)
        return function(
            c_char_p(name), c_char_p(token), c_char_p(resources), c_bool(False), c_bool(False),
            c_bool(False), c_bool(False), None, c_size_t(0), None,
            self.log3 if log else None, None)

    def call(self, name, instance, *arguments):
        return self[name](c_void_p(instance), *arguments)

    def initialize(self, instance):
        if self.version == 2:
            # No fmi2SetupExperiment: some importers leave it out.
            assert self.call("EnterInitializationMode", instance) == 0
        else:
            assert self.call(
                "EnterInitializationMode", instance, c_bool(False), c_double(0), c_double(0),
                c_bool(False), c_double(0)) == 0
        assert self.call("ExitInitializationMode", instance) == 0

    def step(self, instance, point, size):
        if self.version == 2:
            return self.call("DoStep", instance, c_double(point), c_double(size), 0)
        # All results may be NULL.
        return self.call(
            "DoStep", instance, c_double(point), c_double(size), c_bool(False), None, None, None,
            None)

    def free(self, instance):
        self["FreeInstance"](c_void_p(instance))


def threads_and_memory():
    """What this process has; a thread that was joined takes a moment to leave the count."""
    time.sleep(0.2)
    with open("/proc/self/status") as file:
        fields = dict(line.split(":", 1) for line in file if ":" in line)
    return int(fields["Threads"]), int(fields["VmRSS"].split()[0]) * 1024
