"""Large-strain solid dynamics by Updated Reference Lagrangian SPH.

>>> import urlsph
>>> with urlsph.Simulation("column.json", overrides={"geometry.box.spacing": 0.125}) as column:
...     column.set_traction("y_max", [1e4, 0, 0])
...     column.step(1e-3)
...     velocity = column.read("velocity")  # NumPy array, particles x 3

SI units, row-major doubles, full 3 x 3 tensors, everything counted from 0.
"""

from ._errors import (
    BusyError,
    CancelledError,
    DivergedError,
    Error,
    InternalError,
    InvalidArgumentError,
    LibraryError,
    OutOfMemoryError,
    SceneError,
    SceneFileError,
    SnapshotError,
    StaleViewError,
    Status,
)
from ._library import library_path, library_version
from ._simulation import (
    Contact,
    ContactResultant,
    Energies,
    Field,
    HeatResultant,
    Input,
    LogRecord,
    Momenta,
    Patch,
    Probe,
    ProbeMotion,
    Progress,
    Resultant,
    Simulation,
    View,
)

__version__ = library_version()

__all__ = [
    "BusyError",
    "CancelledError",
    "Contact",
    "ContactResultant",
    "DivergedError",
    "Energies",
    "Error",
    "Field",
    "HeatResultant",
    "Input",
    "InternalError",
    "InvalidArgumentError",
    "LibraryError",
    "LogRecord",
    "Momenta",
    "OutOfMemoryError",
    "Patch",
    "Probe",
    "ProbeMotion",
    "Progress",
    "Resultant",
    "SceneError",
    "SceneFileError",
    "Simulation",
    "SnapshotError",
    "StaleViewError",
    "Status",
    "View",
    "__version__",
    "library_path",
]
