"""One way to drive FMUs of FMI 2.0 and FMI 3.0 through FMPy: variables by name, as NumPy arrays."""

import shutil

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

OK, ERROR = 0, 3

# Of a test that is about one version of FMI, or about both at once.
only_fmi2 = pytest.mark.parametrize("version", [2], ids=["fmi2"])
only_fmi3 = pytest.mark.parametrize("version", [3], ids=["fmi3"])


class Driver:
    def __init__(self, fmu, name="instance", folder=None):
        self.description = read_model_description(fmu)
        self.version = int(self.description.fmiVersion[0])
        self._owned = folder is None
        self.folder = folder or extract(fmu)
        self.variables = {v.name: v for v in self.description.modelVariables}
        kind = {2: FMU2Slave, 3: FMU3Slave}[self.version]
        self.fmu = kind(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate()
        self.time = 0.0

    def initialize(self, start=0.0, stop=None, **values):
        """Through initialisation, with parameters and inputs `name=value`; dots as `__`."""
        if self.version == 2:
            self.fmu.setupExperiment(startTime=start, stopTime=stop)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=start, stopTime=stop)
        for name, value in values.items():
            self.set(name.replace("__", "."), value)
        self.fmu.exitInitializationMode()
        self.time = start

    def scalars(self, name):
        """Value references of the elements of a variable in FMI 2.0, and its shape."""
        if name in self.variables:
            return [self.variables[name].valueReference], ()
        references, shape = [], ()
        prefix = name + "["
        for v in self.description.modelVariables:
            if v.name.startswith(prefix):
                references.append(v.valueReference)
                shape = tuple(int(i) for i in v.name[len(prefix):-1].split(","))
        if not references:
            raise KeyError(name)
        return references, shape

    def shape(self, name):
        if self.version == 2:
            return self.scalars(name)[1]
        return tuple(int(d.start) for d in self.variables[name].dimensions)

    def __contains__(self, name):
        return name in self.variables or f"{name}[1]" in self.variables or \
            f"{name}[1,1]" in self.variables

    def get(self, name):
        """A variable as a number or an array."""
        if self.version == 2:
            references, shape = self.scalars(name)
            variable = next(
                v for v in self.description.modelVariables if v.valueReference == references[0])
            get = self.fmu.getReal if variable.type == "Real" else self.fmu.getInteger
            values = get(references)
        else:
            variable, shape = self.variables[name], self.shape(name)
            values = getattr(self.fmu, f"get{variable.type}")(
                [variable.valueReference], nValues=int(np.prod(shape, dtype=int)))
        return np.reshape(values, shape) if shape else values[0]

    def set(self, name, value):
        if self.version == 2:
            references, shape = self.scalars(name)
            integer = name in self.variables and self.variables[name].type == "Integer"
            set_values = self.fmu.setInteger if integer else self.fmu.setReal
        else:
            variable, shape = self.variables[name], self.shape(name)
            references = [variable.valueReference]
            set_values = getattr(self.fmu, f"set{variable.type}")
        set_values(references, np.broadcast_to(value, shape).ravel().tolist())

    def step(self, size):
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=size)
        self.time += size

    def run(self, end, size):
        """Equal steps to the end."""
        for _ in range(round((end - self.time) / size)):
            self.step(size)

    def observe(self):
        """All outputs, exactly, by name."""
        outputs = [v for v in self.description.modelVariables if v.causality == "output"]
        if self.version == 2:
            return {v.name: self.get(v.name) for v in outputs}
        return {v.name: np.asarray(self.get(v.name)).tobytes() for v in outputs}

    def get_state(self):
        return self.fmu.getFMUstate() if self.version == 2 else self.fmu.getFMUState()

    def set_state(self, state):
        (self.fmu.setFMUstate if self.version == 2 else self.fmu.setFMUState)(state)

    def free_state(self, state):
        (self.fmu.freeFMUstate if self.version == 2 else self.fmu.freeFMUState)(state)

    def serialize(self, state):
        name = "serializeFMUstate" if self.version == 2 else "serializeFMUState"
        return getattr(self.fmu, name)(state)

    def deserialize(self, data):
        name = "deSerializeFMUstate" if self.version == 2 else "deserializeFMUState"
        return getattr(self.fmu, name)(data)

    def free(self):
        if self.fmu is not None:
            self.fmu.freeInstance()
            self.fmu = None
            if self._owned:
                shutil.rmtree(self.folder, ignore_errors=True)


def status(call, *arguments, **options):
    """The status of a call that FMPy turns into an exception."""
    try:
        call(*arguments, **options)
    except FMICallException as error:
        return error.status
    return OK
