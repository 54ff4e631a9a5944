"""The column as an FMI 3.0 FMU, driven through FMPy: values by name, as NumPy arrays."""

import shutil

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Slave


class Column:
    """An instance of the FMU from time 0 on; use it in a `with` statement."""

    def __init__(self, fmu):
        description = read_model_description(fmu)
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.folder = extract(fmu)
        self.time = 0.0
        self.instance = FMU3Slave(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="column",
        )
        self.instance.instantiate()
        self.instance.enterInitializationMode(startTime=self.time)
        self.instance.exitInitializationMode()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.instance.terminate()
        self.instance.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)

    def __contains__(self, name):
        return name in self.variables

    def shape(self, name):
        return tuple(int(dimension.start) for dimension in self.variables[name].dimensions)

    def get(self, name):
        """A variable: a number, or an array of its shape."""
        shape = self.shape(name)
        values = self.instance.getFloat64(
            [self.variables[name].valueReference], nValues=int(np.prod(shape, dtype=int))
        )
        return np.reshape(values, shape) if shape else values[0]

    def set(self, name, value):
        self.instance.setFloat64([self.variables[name].valueReference], np.ravel(value).tolist())

    def step(self, dt):
        self.instance.doStep(currentCommunicationPoint=self.time, communicationStepSize=dt)
        self.time += dt
