"""FMUs of small scenes, made with the command line, and one driver for both versions of FMI.

The environment variable URLSPH names the program; without it, the release build is taken.
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from driver import Driver

ROOT = Path(__file__).resolve().parents[2]


def column(**changes):
    """A small cantilever column, loaded on its top face from outside."""
    scene = {
        "title": "Loaded column <&> \"quoted\"",
        "geometry": {"box": {"min": [0, 0, 0], "max": [1, 3, 1], "spacing": 0.25}},
        "material": {
            "neo_hookean": {"density": 1100.0, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}
        },
        "patches": {"top": {"faces": ["y_max"]}},
        "boundary": {
            "y_min": {"support": "clamped"},
            "top": {"traction": {"external": [1000.0, 0.0, 0.0]}},
        },
        "initial": {"velocity": ["Y", 0, 0]},
        "probes": {"tip": [0.5, 3.0, 0.5]},
        "time": {"end": 0.05},
        "output": {"history_interval": 0.005},
    }
    scene.update(changes)
    return scene


PER_PARTICLE = {
    "y_min": {"support": "clamped"},
    "top": {"traction": {"external": [1000.0, 0.0, 0.0], "per_particle": True}},
    "x_max": {"pressure": {"external": 50.0}},
}

SCENES = {
    "column": column(),
    # One value per particle on 25 particles: few enough for the scalars of FMI 2.0.
    "per_particle": column(boundary=PER_PARTICLE),
    # 169 particles: too many for them.
    "many": column(
        geometry={"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 1 / 12}},
        probes={},
        boundary=PER_PARTICLE,
    ),
    "driven": column(
        boundary={
            "y_min": {"support": "clamped"},
            "top": {"velocity": {"external": [0.0, 0.0, 0.0]}},
        },
        initial={},
    ),
    "hot": column(
        material={
            "von_mises": {
                "density": 1100.0, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3,
                "yield_stress": 1e5, "hardening_modulus": 1e6,
                "saturation_stress": 2.5e5, "saturation_exponent": 10.0,
            }
        },
        heat={"specific_heat": 500.0, "reference_temperature": 300.0, "conductivity": 40.0,
              "gruneisen_coefficient": 0.5},
        boundary={
            "y_min": {"support": "clamped", "temperature": {"external": 300.0}},
            "top": {
                "traction": {"external": [1000.0, 0.0, 0.0]},
                "heat_flux": {"external": 0.0, "per_particle": True},
            },
            "x_max": {
                "convection": {
                    "coefficient": {"external": 0.0},
                    "ambient_temperature": {"external": 300.0},
                }
            },
        },
    ),
    "mooney": column(
        material={
            "mooney_rivlin": {
                "density": 1100.0, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3, "area_share": 0.4,
            }
        },
        numerics={"state": "fj", "volume_dissipation": 0.1, "time_step": 1e-4},
        patches={"top-side": {"faces": ["y_max"]}},
        boundary={
            "y_min": {"support": "clamped"},
            "top-side": {"pressure": {"external": -2000.0}},
        },
        output={"fields": ["deformation_gradient", "von_mises_stress", "initial_position"]},
    ),
    "meshed": column(
        geometry={"mesh": {"file": "mesh/cube.msh"}},
        probes={"tip": [0.5, 1.0, 0.5]},
        initial={"velocity": ["Y", 0, -1]},
        contact={"floor": {"point": [0, 0, -1e-3], "normal": [0, 0, 1]}},
    ),
}


@pytest.fixture(scope="session")
def urlsph():
    program = os.environ.get("URLSPH", ROOT / "target" / "release" / "urlsph")
    assert Path(program).is_file(), f"{program} is missing: cargo build --release --features cli"
    return str(program)


@pytest.fixture(scope="session")
def export(urlsph, tmp_path_factory):
    """Makes the FMU of a scene: `export("column", 3)` is its path."""
    folder = tmp_path_factory.mktemp("fmus")
    made = {}

    def make(name, version, again=False):
        if (name, version) not in made or again:
            scene = folder / f"{name}.json"
            scene.write_text(json.dumps(SCENES[name]))
            fmu = folder / f"{name}{version}{'_again' if again else ''}.fmu"
            # Beside the scene while the FMU is made, and gone afterwards.
            mesh = folder / "mesh"
            mesh.mkdir()
            shutil.copy(ROOT / "examples" / "meshes" / "cube_tetrahedra.msh", mesh / "cube.msh")
            subprocess.run(
                [urlsph, "fmu", scene, "--output", fmu, "--fmi", str(version)], check=True)
            shutil.rmtree(mesh)
            if again:
                return str(fmu)
            made[name, version] = str(fmu)
        return made[name, version]

    return make


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def version(request):
    return request.param


@pytest.fixture
def start(export, version):
    """Instantiates: `start("column")` is a driver, freed at the end of the test."""
    drivers = []

    def make(name="column", initialize=True, fmi=version, **options):
        driver = Driver(export(name, fmi), **options)
        drivers.append(driver)
        if initialize:
            driver.initialize()
        return driver

    yield make
    for driver in drivers:
        driver.free()


@pytest.fixture
def unpacked(export, version, tmp_path):
    """Folder with the files of the column's FMU."""
    folder = tmp_path / "unpacked"
    shutil.unpack_archive(export("column", version), folder, "zip")
    return folder
