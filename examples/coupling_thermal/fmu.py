"""An FMU of FMI 2.0 or FMI 3.0 through FMPy: numbers by name, steps from time 0 on."""

import shutil

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave


class Fmu:
    """An instance; use it in a `with` statement. Parameters are given by name."""

    def __init__(self, path, parameters=None):
        description = read_model_description(path)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.second = description.fmiVersion.startswith("2")
        self.folder = extract(path)
        self.time = 0.0
        self.instance = (FMU2Slave if self.second else FMU3Slave)(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=description.modelName,
        )
        self.instance.instantiate()
        for name, value in (parameters or {}).items():
            self.set(name, value)
        if self.second:
            self.instance.setupExperiment(startTime=0.0)
            self.instance.enterInitializationMode()
        else:
            self.instance.enterInitializationMode(startTime=0.0)
        self.instance.exitInitializationMode()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.instance.terminate()
        self.instance.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)

    def get(self, name):
        get = self.instance.getReal if self.second else self.instance.getFloat64
        return get([self.references[name]])[0]

    def get_vector(self, name):
        """Its three components, which FMI 2.0 has as scalars."""
        if self.second:
            return [self.get(f"{name}[{i}]") for i in (1, 2, 3)]
        return self.instance.getFloat64([self.references[name]], nValues=3)

    def set(self, name, value):
        set_ = self.instance.setReal if self.second else self.instance.setFloat64
        set_([self.references[name]], [value])

    def step(self, dt):
        self.instance.doStep(currentCommunicationPoint=self.time, communicationStepSize=dt)
        self.time += dt
