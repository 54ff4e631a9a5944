"""What is in the archive: the description against the standards, and everything beside it."""

import ctypes
import json
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import platform, platform_tuple, read_model_description, supported_platforms
from fmpy.validation import validate_fmu
from lxml import etree

from conftest import ROOT, SCENES
from driver import only_fmi3
from functions import FMI2, FMI3

SCHEMAS = Path(fmpy.__file__).parent / "schema"


@pytest.mark.parametrize("name", SCENES)
def test_fmpy_finds_no_problem(export, name, version):
    assert validate_fmu(export(name, version)) == []


def validate(schema, document):
    # The schemas include their neighbours by relative path.
    checker = etree.XMLSchema(etree.parse(str(SCHEMAS / schema)))
    checker.validate(etree.fromstring(document))
    assert [str(e) for e in checker.error_log] == []


@pytest.mark.parametrize("name", SCENES)
def test_description_obeys_the_schema(export, name, version):
    with zipfile.ZipFile(export(name, version)) as archive:
        validate(f"fmi{version}/fmi{version}ModelDescription.xsd",
                 archive.read("modelDescription.xml"))
        if version == 3:
            validate("fmi3/fmi3TerminalsAndIcons.xsd",
                     archive.read("terminalsAndIcons/terminalsAndIcons.xml"))


def test_contents(export, version):
    with zipfile.ZipFile(export("column", version)) as archive:
        assert archive.testzip() is None
        names = set(archive.namelist())
        folder = platform if version == 2 else platform_tuple
        icon = "model.png" if version == 2 else "terminalsAndIcons/icon.png"
        wanted = {
            "modelDescription.xml", "resources/scene.json", "documentation/index.html",
            "documentation/licenses/LICENSE-MIT", "documentation/licenses/LICENSE-APACHE",
            "documentation/licenses/license.txt", icon,
        }
        assert wanted <= names
        assert any(n.startswith(f"binaries/{folder}/urlsph.") for n in names)
        assert archive.read(icon).startswith(b"\x89PNG\r\n\x1a\n")
        scene = json.loads(archive.read("resources/scene.json"))
        assert scene["time"] == {"end": 0.05}
        page = archive.read("documentation/index.html").decode()
        assert page.startswith("<!DOCTYPE html>")
        body = ElementTree.fromstring(page.split("\n", 1)[1])
        text = "".join(body.itertext())
        assert "boundary.top.traction" in text and SCENES["column"]["title"] in text
    assert supported_platforms(export("column", version)) != []


@pytest.mark.parametrize("name", ["column", "meshed"])
def test_same_scene_same_bytes(export, version, name):
    first = Path(export(name, version)).read_bytes()
    assert Path(export(name, version, again=True)).read_bytes() == first


def test_a_mesh_travels_with_its_fmu(export, version):
    with zipfile.ZipFile(export("meshed", version)) as archive:
        scene = json.loads(archive.read("resources/scene.json"))
        # A name without a folder: the resources may lie anywhere.
        assert scene["geometry"]["mesh"]["file"] == "mesh.msh"
        original = ROOT / "examples" / "meshes" / "cube_tetrahedra.msh"
        assert archive.read("resources/mesh.msh") == original.read_bytes()


def test_tokens_tell_scenes_and_versions_apart(export):
    tokens = [read_model_description(export(n, v)).guid for n in SCENES for v in (2, 3)]
    assert len(set(tokens)) == len(tokens)


def test_every_function_is_exported(unpacked, version):
    library = ctypes.CDLL(str(next(unpacked.glob("binaries/*/urlsph.*"))))
    # One library serves both standards.
    missing = [name for name in FMI2 + FMI3 if not hasattr(library, name)]
    assert missing == []


@pytest.mark.parametrize("name", SCENES)
def test_units_and_types(export, name, version):
    description = read_model_description(export(name, version))
    units = {u.name: u for u in description.unitDefinitions}
    assert all(u.baseUnit is not None for u in units.values())
    for v in description.modelVariables:
        if v.type in ("Real", "Float64"):
            assert v.declaredType is not None and v.declaredType.unit in units, v.name
    newton = units["N"].baseUnit
    assert (newton.kg, newton.m, newton.s) == (1, 1, -2)


@pytest.mark.parametrize("name", SCENES)
def test_start_values_are_those_of_the_fmu(start, name):
    instance = start(name, initialize=False)
    checked = 0
    for v in instance.description.modelVariables:
        if v.start is not None:
            expected = np.array(str(v.start).split(), dtype=float)
            assert np.array_equal(np.ravel(instance.get(v.name)), expected), v.name
            checked += 1
    assert checked >= 6


def test_names(export):
    three = {v.name for v in read_model_description(export("column", 3)).modelVariables}
    assert {
        "time", "threads", "steps", "stable_step", "material.density", "numerics.cfl",
        "boundary.top.traction", "boundary.top.force", "boundary.top.moment",
        "boundary.top.displacement", "boundary.top.velocity", "boundary.y_min.force",
        "boundary.top.particle_displacement", "boundary.top.area", "probe.tip.displacement",
        "probe.tip.velocity", "energy.kinetic", "energy.strain", "energy.external_work",
        "energy.numerical_dissipation", "energy.projection", "energy.closure_error",
        "momentum.linear", "momentum.angular", "field.displacement", "field.cauchy_stress",
    } <= three
    two = {v.name for v in read_model_description(export("column", 2)).modelVariables}
    assert {"boundary.top.traction[1]", "boundary.top.force[3]", "probe.tip.velocity[2]"} <= two
    assert not any(n.startswith("field.") for n in two)


def test_quoted_names(export, version):
    names = {v.name for v in read_model_description(export("mooney", version)).modelVariables}
    assert "boundary.'top-side'.pressure" in names
    assert "material.area_share" in names
    # A scene with a fixed step has no CFL number.
    assert "numerics.time_step" in names and "numerics.cfl" not in names


@only_fmi3
def test_arrays_as_scalars_only_in_small_numbers(start):
    few = start("per_particle", initialize=False, fmi=2)
    assert few.shape("boundary.top.traction") == (25, 3)
    assert few.shape("boundary.top.particle_displacement") == (25, 3)
    many = start("many", initialize=False, fmi=2)
    assert many.shape("boundary.top.traction") == (3,)
    assert "boundary.top.particle_displacement" not in many
    assert len(many.variables) < 200
    native = start("many", initialize=False, fmi=3)
    assert native.shape("boundary.top.traction") == (169, 3)


@only_fmi3
def test_tensors_are_3_by_3(start):
    instance = start("mooney", fmi=3)
    shape = instance.shape("field.deformation_gradient")
    assert shape[1:] == (3, 3)
    gradient = instance.get("field.deformation_gradient")
    assert np.abs(gradient - np.eye(3)).max() < 1e-12


def test_terminals_name_variables(export):
    with zipfile.ZipFile(export("column", 3)) as archive:
        root = ElementTree.fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml"))
    names = {v.name for v in read_model_description(export("column", 3)).modelVariables}
    members = [m.get("variableName") for m in root.iter("TerminalMemberVariable")]
    assert "boundary.top.traction" in members and set(members) <= names
