"""NumPy access to the variables of an FMI 3.0 FMU that FMPy has instantiated.

FMPy passes values as lists, one Python object per number. These functions hand NumPy buffers to
the FMU instead: reading 100,000 values takes microseconds.

    from fmpy import extract, read_model_description
    from fmpy.fmi3 import FMU3Slave
    from fmpy_arrays import Arrays

    arrays = Arrays(fmu, model_description)         # fmu: an instantiated fmpy.fmi3.FMU3Slave
    positions = arrays.get("boundary.top.initial_position")      # shape (particles, 3)
    arrays.set("boundary.top.traction", tractions)
    arrays.get("field.displacement", out=buffer)                 # no allocation
"""

from ctypes import POINTER, c_double, c_size_t, c_uint32, c_void_p

import numpy as np


class Arrays:
    """Reads and sets `Float64` variables of any shape by name."""

    def __init__(self, fmu, model_description):
        self._fmu = fmu
        self._variables = {v.name: v for v in model_description.modelVariables}
        self._get = self._function("fmi3GetFloat64")
        self._set = self._function("fmi3SetFloat64")

    def _function(self, name):
        # An object of our own: FMPy's has argument types of its own.
        function = self._fmu.dll[name]
        function.argtypes = [
            c_void_p, POINTER(c_uint32), c_size_t, POINTER(c_double), c_size_t,
        ]
        return function

    def _variable(self, name):
        try:
            variable = self._variables[name]
        except KeyError:
            raise KeyError(f"the FMU has no variable {name!r}") from None
        if variable.type != "Float64":
            raise TypeError(f"{name} is of type {variable.type}, not Float64")
        return variable

    def shape(self, name):
        """The shape of a variable; `()` for a scalar."""
        return tuple(int(d.start) for d in self._variable(name).dimensions)

    def get(self, name, out=None):
        """Reads a variable into a new array, or into `out` (C-contiguous `float64`)."""
        variable, shape = self._variable(name), self.shape(name)
        if out is None:
            out = np.empty(shape)
        elif out.dtype != np.float64 or not out.flags.c_contiguous or out.shape != shape:
            raise ValueError(f"{name}: out must be a C-contiguous float64 array of shape {shape}")
        self._call(self._get, "fmi3GetFloat64", variable, out)
        return out

    def set(self, name, values):
        """Sets a variable from anything that broadcasts to its shape."""
        variable = self._variable(name)
        values = np.ascontiguousarray(
            np.broadcast_to(np.asarray(values, dtype=np.float64), self.shape(name)))
        self._call(self._set, "fmi3SetFloat64", variable, values)

    def _call(self, function, label, variable, buffer):
        reference = c_uint32(int(variable.valueReference))
        status = function(
            self._fmu.component, reference, 1,
            buffer.ctypes.data_as(POINTER(c_double)), buffer.size)
        if status > 1:
            raise RuntimeError(f"{label} failed for {variable.name} with status {status}")
