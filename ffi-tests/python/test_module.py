"""The Python module over the C ABI."""

import ctypes
import gc
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import urlsph
from urlsph import _library, _simulation

SCENE = Path(__file__).parents[1] / "scene.json"
METAL = SCENE.with_name("metal.json")
CONTACT = SCENE.with_name("contact.json")
ROOT = SCENE.parents[1]


@pytest.fixture
def column():
    with urlsph.Simulation(SCENE, threads=2) as simulation:
        yield simulation


@pytest.fixture
def metal():
    with urlsph.Simulation(METAL, threads=2) as simulation:
        yield simulation


@pytest.fixture
def block():
    with urlsph.Simulation(CONTACT, threads=2) as simulation:
        yield simulation


@pytest.mark.skipif("EXPECTED_LIBRARY" not in os.environ, reason="any library will do")
def test_the_library_is_the_one_that_is_meant():
    assert urlsph.library_path() == os.environ["EXPECTED_LIBRARY"]


def test_versions():
    header = (ROOT / "include" / "urlsph.h").read_text()
    assert f'#define URLSPH_VERSION "{urlsph.__version__}"' in header
    assert f"#define URLSPH_ABI_VERSION {_library.ABI_VERSION}" in header
    pyproject = (ROOT / "include" / "python" / "pyproject.toml").read_text()
    assert f'version = "{urlsph.__version__}"' in pyproject


def test_every_function_of_the_header_is_declared():
    header = (ROOT / "include" / "urlsph.h").read_text()
    functions = set(re.findall(r"^urlsph_status (urlsph_\w+)\(", header, re.MULTILINE))
    assert functions == set(_library._SIGNATURES)


def test_status_numbers_are_those_of_the_header():
    header = (ROOT / "include" / "urlsph.h").read_text()
    body = header.split("enum urlsph_status")[1].split("};")[0]
    numbers = {name: int(n) for name, n in re.findall(r"URLSPH_(\w+) = (\d+)", body)}
    assert numbers == {status.name: int(status) for status in urlsph.Status}


def test_quantity_numbers_are_those_of_the_header():
    header = (ROOT / "include" / "urlsph.h").read_text()
    body = header.split("enum urlsph_quantity")[1].split("};")[0]
    numbers = {name.lower(): int(n) for name, n in re.findall(r"URLSPH_(\w+) = (\d+)", body)}
    assert numbers == _simulation._QUANTITIES


def test_structs_are_as_large_as_the_library_has_them(metal, block):
    structs = {
        "urlsph_get_counts": (_library.CountsStruct, ()),
        "urlsph_get_energies": (_library.EnergiesStruct, ()),
        "urlsph_get_momenta": (_library.MomentaStruct, ()),
        "urlsph_get_patch_info": (_library.PatchInfoStruct, (0,)),
        "urlsph_get_resultant": (_library.ResultantStruct, (0,)),
        "urlsph_get_heat_resultant": (_library.HeatResultantStruct, (0,)),
        "urlsph_get_field_info": (_library.FieldInfoStruct, (0,)),
        "urlsph_get_view": (_library.ViewStruct, (0,)),
        "urlsph_get_probe_info": (_library.ProbeInfoStruct, (0,)),
        "urlsph_get_probe_motion": (_library.ProbeMotionStruct, (0,)),
        "urlsph_get_input_info": (_library.InputInfoStruct, (0,)),
        "urlsph_set_callbacks": (_library.CallbacksStruct, ()),
        "urlsph_get_contact_info": (_library.ContactInfoStruct, (0,)),
        "urlsph_get_contact_resultant": (_library.ContactResultantStruct, (0,)),
    }
    for name, (struct, index) in structs.items():
        simulation = block if "contact" in name else metal
        with pytest.raises(urlsph.InvalidArgumentError) as e:
            simulation._call(getattr(_library.lib, name), *index, struct(), 1)
        assert f"{ctypes.sizeof(struct)} bytes" in str(e.value), name


def test_creation(column):
    text = SCENE.read_text()
    with urlsph.Simulation.from_json(text) as a, urlsph.Simulation(json.loads(text)) as b:
        assert a.state_hash == b.state_hash == column.state_hash
        assert a.title == "Test column" and a.time == 0.0 and a.end_time == 0.01
    assert column.threads == 2
    assert column.particle_count == 45
    with urlsph.Simulation(SCENE, overrides={"geometry.box.spacing": 0.25, "title": "x"}) as fine:
        assert fine.particle_count == 5 * 9 * 5 and fine.title == "x"
    with urlsph.Simulation(str(SCENE), overrides=["geometry.box.spacing=0.25"]) as fine:
        assert fine.particle_count == 5 * 9 * 5


def test_creation_fails():
    with pytest.raises(urlsph.SceneError) as e:
        urlsph.Simulation(SCENE, overrides={"material.neo_hookean.density": -1})
    assert e.value.code == urlsph.Status.INVALID_SCENE
    assert e.value.path == "material.neo_hookean.density"
    assert e.value.particle is None and e.value.time is None
    assert isinstance(e.value, ValueError)
    with pytest.raises(urlsph.SceneError) as e:
        urlsph.Simulation.from_json("{")
    assert e.value.code == urlsph.Status.PARSE
    with pytest.raises(urlsph.SceneFileError, match="nowhere.json"):
        urlsph.Simulation("nowhere.json")
    with pytest.raises(ValueError, match="U\\+0000"):
        urlsph.Simulation("a\0b")
    with pytest.raises(TypeError):
        urlsph.Simulation(SCENE, overrides="title=x")
    with pytest.raises(ValueError):
        urlsph.Simulation(SCENE, threads=-1)
    with pytest.raises(urlsph.InvalidArgumentError):
        urlsph.Simulation(SCENE, threads=10**6)


def test_closed():
    simulation = urlsph.Simulation(SCENE)
    assert "45 particles" in repr(simulation)
    simulation.close()
    simulation.close()
    assert simulation.closed and "closed" in repr(simulation)
    with pytest.raises(ValueError, match="closed"):
        simulation.step(1e-3)


def test_patches(column):
    top = column.patches["top"]
    assert top.particles.shape == (9,) and top.areas.shape == (9,)
    assert top.area == pytest.approx(1.0, rel=1e-14) == top.areas.sum()
    np.testing.assert_array_equal(top.normals, np.tile([0.0, 1.0, 0.0], (9, 1)))
    initial = column.read("initial_position")
    np.testing.assert_array_equal(initial[top.particles, 1], 2.0)
    with pytest.raises(urlsph.InvalidArgumentError, match="top"):
        column.resultant("nowhere")


def test_fields(column):
    column.set_traction("top", [1e4, 0.0, 0.0])
    column.step(1e-3)
    for name, field in column.fields.items():
        if not field.is_present:
            with pytest.raises(urlsph.InvalidArgumentError) as e:
                column.read(name)
            assert e.value.field == name
            continue
        values = column.read(name)
        assert values.shape == (45, *field.shape) and np.isfinite(values).all()
        again = np.full_like(values, np.nan)
        assert column.read(name, out=again) is again
        np.testing.assert_array_equal(values, again)
        if field.has_view:
            view = column.view(name)
            np.testing.assert_array_equal(view.array, values[view.order])
        else:
            with pytest.raises(urlsph.InvalidArgumentError) as e:
                column.view(name)
            assert e.value.field == name
    f = column.read("deformation_gradient")
    j = column.read("jacobian")
    residual = np.abs(np.linalg.det(f) - j).max()
    print(f"det F against J: residual {residual:.3e}, tolerance 1e-12")
    assert residual < 1e-12
    with pytest.raises(urlsph.InvalidArgumentError, match="velocity"):
        column.read("colour")
    with pytest.raises(urlsph.InvalidArgumentError, match="`heat`"):
        column.read("temperature")
    for out in (
        np.empty((45, 4)),
        np.empty((45, 3), dtype=np.float32),
        np.empty((3, 45)).T,
        np.empty((90, 3))[::2],
    ):
        with pytest.raises(ValueError, match="out has"):
            column.read("velocity", out=out)


def test_views(column):
    view = column.view("position")
    array = view.array
    assert array.shape == (45, 3) and not array.flags.writeable
    with pytest.raises(ValueError):
        array[0, 0] = 1.0
    assert sorted(view.order) == list(range(45))

    # The memory does not change, nor go away, under an array.
    before = column.state_hash
    part = array[3:7]
    del array
    for change in (
        lambda: column.step(1e-3),
        lambda: column.advance_to(1.0),
        lambda: column.set_traction("top", [1, 0, 0]),
        lambda: column.restore(b""),
        column.close,
    ):
        with pytest.raises(BufferError, match="alive"):
            change()
    assert column.state_hash == before and view.is_current
    del part
    column.step(1e-5)

    assert not view.is_current
    with pytest.raises(urlsph.StaleViewError):
        view.array
    with pytest.raises(urlsph.StaleViewError):
        view.order
    assert column.view("position").array.shape == (45, 3)


def test_arrays_keep_the_simulation():
    simulation = urlsph.Simulation(SCENE)
    initial = simulation.read("position")
    view = simulation.view("position")
    order, array = view.order, view.array
    del simulation, view
    gc.collect()
    np.testing.assert_array_equal(array, initial[order])


def test_inputs(column):
    by_name = {(i.patch, i.quantity): i for i in column.inputs}
    assert set(by_name) == {("bottom", "velocity"), ("top", "traction"), ("side", "pressure")}
    assert by_name["top", "traction"].per_particle and by_name["top", "traction"].particles == 9
    column.set_traction("top", np.arange(27.0).reshape(9, 3))
    np.testing.assert_array_equal(column.input("top", "traction"), np.arange(27.0))
    # A view of something else, integers: NumPy's business.
    column.set_traction("top", np.arange(54).reshape(9, 6)[:, ::2])
    np.testing.assert_array_equal(column.input("top", "traction"), np.arange(0.0, 54.0, 2.0))
    column.set_pressure("side", 5.0)
    column.set_pressure("side", np.ones(15))
    column.set_velocity("bottom", [0.0, 0.1, 0.0])
    before = column.state_hash
    for wrong in (
        lambda: column.set_traction("top", [1.0]),
        lambda: column.set_traction("side", [1.0, 0.0, 0.0]),
        lambda: column.set_pressure("side", np.nan),
        lambda: column.set_velocity("bottom", []),
        lambda: column.input("top", "velocity"),
        lambda: column.input("top", "colour"),
    ):
        with pytest.raises(urlsph.InvalidArgumentError):
            wrong()
    assert column.state_hash == before


def test_heat(metal):
    metal.set_traction("top", [0.0, 1.5e8, 0.0])
    metal.set_heat_flux("top", np.full(9, 1e9))
    metal.set_temperature("bottom", 400.0)
    metal.set_convection("side", coefficient=1e6, ambient_temperature=np.full(15, 600.0))
    metal.set_convection("back", ambient_temperature=300.0)
    np.testing.assert_array_equal(metal.input("side", "convection_coefficient"), [1e6])
    np.testing.assert_array_equal(metal.input("side", "ambient_temperature"), np.full(15, 600.0))
    assert metal.heat_resultant("top").heat_flow == pytest.approx(1e3, rel=1e-12)
    assert metal.heat_resultant("side").heat_flow == pytest.approx(604.0, rel=1e-9)
    before = metal.state_hash
    for wrong in (
        lambda: metal.set_heat_flux("top", [1.0, 2.0]),
        lambda: metal.set_temperature("bottom", 0.0),
        lambda: metal.set_convection("side", coefficient=-1.0),
        lambda: metal.set_convection("side"),
        lambda: metal.set_convection("back", coefficient=1.0, ambient_temperature=300.0),
        lambda: metal.set_temperature("top", 300.0),
    ):
        with pytest.raises(urlsph.InvalidArgumentError):
            wrong()
    assert metal.state_hash == before

    metal.step(1e-6)
    saved = metal.snapshot()
    metal.step(1e-6)
    there = metal.state_hash
    metal.restore(saved)
    metal.step(1e-6)
    assert metal.state_hash == there
    temperature = metal.read("temperature")
    bottom = metal.patches["bottom"].particles
    np.testing.assert_allclose(temperature[bottom], 400.0, rtol=1e-12)
    top = metal.patches["top"]
    resultant = metal.heat_resultant("top")
    assert resultant.maximum_temperature == temperature[top.particles].max()
    mean = top.areas @ temperature[top.particles] / top.area
    assert resultant.mean_temperature == pytest.approx(mean, rel=1e-13)
    corner = metal.probe("corner").temperature
    assert np.abs(temperature - corner).min() < 1e-9
    assert metal.read("equivalent_plastic_strain").max() > 0
    energies = metal.energies
    assert energies.heat_in > 0 and energies.plastic_work > 0 and energies.entropy_production > 0


def test_a_body_without_heat_has_no_temperature(column):
    assert column.probe("corner").temperature is None
    assert column.energies.thermal == column.energies.entropy == 0.0
    with pytest.raises(urlsph.InvalidArgumentError, match="`heat`"):
        column.heat_resultant("top")


def test_contact(block, column):
    assert list(block.contacts) == ["floor", "piston"]
    # The scene's normal is twice as long.
    np.testing.assert_array_equal(block.contacts["floor"].normal, [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(block.contacts["piston"].point, [0.0, 2.001, 0.0])
    floor = block.contact_resultant("floor")
    assert floor.particles == 9 and block.contact_resultant("piston").particles == 0
    np.testing.assert_allclose(floor.impulse, [0.0, 275.0, 0.0], rtol=1e-12)
    block.step(4e-3)
    floor, piston = block.contact_resultant("floor"), block.contact_resultant("piston")
    change = block.momenta.linear - [0.0, -2200.0, 0.0]
    np.testing.assert_allclose(floor.impulse + piston.impulse, change, atol=1e-8)
    assert piston.displacement == pytest.approx(8e-3, rel=1e-12)
    assert floor.force[1] > 0 > piston.force[1]
    assert block.energies.contact_dissipation > 0
    with pytest.raises(urlsph.InvalidArgumentError, match="floor, piston"):
        block.contact_resultant("wall")
    assert column.contacts == {}


def test_step(column):
    column.set_traction("top", [1e4, 0.0, 0.0])
    column.step(1e-3)
    column.advance_to(2e-3)
    assert column.time == 2e-3 and column.steps > 1 and column.stable_step > 0
    for dt in (0.0, -1.0, float("nan"), float("inf"), 1e-30):
        with pytest.raises(urlsph.InvalidArgumentError) as e:
            column.step(dt)
        assert e.value.time == 2e-3
    resultant = column.resultant("top")
    np.testing.assert_allclose(resultant.force, [1e4, 0.0, 0.0], atol=1e-8)
    assert resultant.mean_displacement[0] > 0
    assert column.probe("corner").displacement[0] > 0
    np.testing.assert_array_equal(column.probes["corner"].position, [1.0, 2.0, 1.0])
    assert column.energies.external_work > 0 and column.momenta.linear[0] > 0


def test_snapshot(column):
    column.set_traction("top", [1e4, 0.0, 0.0])
    column.step(1e-3)
    saved = column.snapshot()
    column.step(1e-3)
    there = column.state_hash
    column.restore(saved)
    column.step(1e-3)
    assert column.state_hash == there
    with urlsph.Simulation(SCENE, threads=1) as twin:
        twin.restore(saved)
        twin.step(1e-3)
        assert twin.state_hash == there
    for damaged in (b"", saved[:-1], saved + b"\0", saved[:100] + b"\xff" + saved[101:]):
        with pytest.raises(urlsph.SnapshotError):
            column.restore(damaged)
    assert column.state_hash == there


def test_snapshot_file(column, tmp_path):
    column.step(1e-3)
    path = tmp_path / "column.snapshot"
    column.save_snapshot(path)
    assert path.read_bytes() == column.snapshot()
    here = column.state_hash
    column.step(1e-3)
    there = column.state_hash
    column.restore_snapshot(str(path))
    assert column.state_hash == here
    column.step(1e-3)
    assert column.state_hash == there

    # What fails changes neither the state nor the folder.
    with pytest.raises(OSError):
        column.save_snapshot(tmp_path / "nowhere" / "column.snapshot")
    with pytest.raises(OSError):
        column.restore_snapshot(tmp_path / "nothing")
    with pytest.raises(ValueError):
        column.save_snapshot("a\0b")
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(urlsph.SnapshotError, match="column.snapshot"):
        column.restore_snapshot(path)
    assert column.state_hash == there
    assert list(tmp_path.iterdir()) == [path]


def test_divergence(column):
    pull = np.zeros((9, 3))
    pull[0, 0], pull[4, 1] = 1e14, -1e14
    column.set_traction("top", pull)
    with pytest.raises(urlsph.DivergedError) as e:
        column.step(1.0)
    assert e.value.particle in range(45) and len(e.value.position) == 3
    assert e.value.field and e.value.time >= 0
    assert np.isfinite(column.read("cauchy_stress")).all()


def test_callbacks(column):
    seen, logged = [], []
    column.set_callbacks(
        progress=seen.append, log=logged.append
    )
    column.step(10.5 * column.stable_step)
    assert [p.steps for p in seen] == list(range(1, len(seen) + 1)) and len(seen) > 10
    assert seen[-1].time == seen[-1].end == column.time
    assert {p.start for p in seen} == {0} and {p.reference_updates for p in seen} == {0}
    (first,) = logged
    assert (first.level, first.event, first.error) == ("info", "advanced", None)
    assert (first.time, first.steps) == (column.time, column.steps)
    assert first.message.endswith(f"in {column.steps} steps")
    with pytest.raises(urlsph.InvalidArgumentError):
        column.step(0.0)
    last = logged[-1]
    assert (last.level, last.event) == ("error", "failed") and "dt" in last.message
    assert isinstance(last.error, urlsph.InvalidArgumentError) and str(last.error) == last.message
    assert (last.time, last.steps, last.error.time) == (column.time, column.steps, column.time)

    # The handle is in use while its callback runs.
    statuses = []

    def reenter(_):
        try:
            column.time
        except urlsph.BusyError as e:
            statuses.append(e.code)

    column.set_callbacks(progress=reenter)
    column.step(1e-5)
    assert set(statuses) == {urlsph.Status.BUSY}

    column.set_callbacks(cancel=lambda: True)
    before = column.steps
    with pytest.raises(urlsph.CancelledError):
        column.step(1.0)
    assert column.steps == before + 1

    def fail(_):
        raise KeyError("mine")

    column.set_callbacks(progress=fail)
    with pytest.raises(KeyError, match="mine"):
        column.step(1.0)
    assert column.steps == before + 2
    column.set_callbacks()
    column.step(1e-5)


def test_busy_from_another_thread(column):
    running, stop = threading.Event(), threading.Event()
    column.set_callbacks(progress=lambda _: running.set(), cancel=stop.is_set)
    outcome = []

    def run():
        try:
            column.advance_to(1e9)
        except urlsph.Error as e:
            outcome.append(e)
        running.set()

    thread = threading.Thread(target=run)
    thread.start()
    running.wait()
    with pytest.raises(urlsph.BusyError):
        column.read("velocity")
    with pytest.raises(urlsph.BusyError):
        column.close()
    stop.set()
    thread.join()
    assert isinstance(outcome[0], urlsph.CancelledError)
    assert column.time > 0


@pytest.mark.skipif(os.name != "posix", reason="sends a POSIX signal")
def test_ctrl_c_ends_a_step(column):
    running = threading.Event()
    start = time.monotonic()
    column.set_callbacks(
        progress=lambda _: running.set(), cancel=lambda: time.monotonic() > start + 60
    )
    # A shell that starts the tests in the background has Ctrl-C ignored.
    inherited = signal.signal(signal.SIGINT, signal.default_int_handler)

    def interrupt():
        running.wait()
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            column.advance_to(1e9)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        thread.join()
        signal.signal(signal.SIGINT, inherited)
    column.step(1e-5)


def test_a_busy_call_leaves_the_exception_to_the_step(column):
    refused = []

    def interrupted(_):
        # Ctrl-C is the step's to raise, though another call comes before its end.
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(urlsph.BusyError):
            column.time
        refused.append(True)

    column.set_callbacks(progress=interrupted)
    # A shell that starts the tests in the background has Ctrl-C ignored.
    inherited = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            column.step(1.0)
    finally:
        signal.signal(signal.SIGINT, inherited)
    assert refused == [True]


README = (ROOT / "include" / "python" / "README.md").read_text()
READMES = README + (ROOT / "README.md").read_text()


@pytest.mark.parametrize("program", re.findall(r"```python\n(.*?)```", READMES, re.DOTALL))
def test_what_the_readme_shows(program, tmp_path, monkeypatch):
    scenes = [("column", SCENE), ("scene", SCENE), ("part", METAL), ("block", CONTACT)]
    for name, scene in scenes:
        (tmp_path / f"{name}.json").write_text(scene.read_text())
    monkeypatch.chdir(tmp_path)
    exec(compile(program, "README.md", "exec"), {})


def test_the_readme_names_all_energies():
    for name in urlsph.Energies._fields:
        assert f"`{name}`" in README, name


def test_loading_errors_name_the_remedy(tmp_path):
    package = Path(urlsph.__file__).parent
    copy = tmp_path / "urlsph"
    copy.mkdir()
    for source in package.glob("*.py"):
        (copy / source.name).write_bytes(source.read_bytes())
    run = subprocess.run(
        [sys.executable, "-c", "import urlsph"],
        env={**os.environ, "PYTHONPATH": str(tmp_path), "URLSPH_LIBRARY": "/no/such/library"},
        capture_output=True,
        text=True,
    )
    assert run.returncode != 0
    assert "LibraryError" in run.stderr and "URLSPH_LIBRARY" in run.stderr
