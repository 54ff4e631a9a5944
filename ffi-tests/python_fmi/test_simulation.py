"""Running the FMU: whole simulations, steps of any size, inputs, parameters, arrays."""

import csv
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from fmpy import simulate_fmu

from driver import ERROR, only_fmi2, only_fmi3, status


def test_simulate_fmu(export, version):
    names = ["energy.kinetic", "energy.strain", "energy.closure_error", "steps"]
    result = simulate_fmu(export("column", version), output=names)
    # As many rows as the default experiment says.
    assert len(result) == 11 and result["time"][-1] == 0.05
    assert result["energy.strain"][0] == 0.0 and result["energy.strain"][-1] > 0.0
    assert result["steps"][-1] >= 10
    closure = np.abs(result["energy.closure_error"]).max() / result["energy.kinetic"][0]
    print(f"closure error {closure:.1e} of the initial energy, tolerance 1e-3")
    assert closure < 1e-3


def test_simulate_fmu_with_parameters_and_inputs(export, version):
    signals = np.array(
        [(0.0, 0.0), (0.05, 0.0)],
        dtype=[("time", float), ("boundary.x_max.pressure", float)])
    result = simulate_fmu(
        export("per_particle", version),
        start_values={"material.youngs_modulus": 3.4e7, "threads": 1},
        input=signals, output=["stable_step", "energy.kinetic"], stop_time=0.01)
    soft = simulate_fmu(export("per_particle", version), output=["stable_step"], stop_time=0.01)
    ratio = soft["stable_step"][0] / result["stable_step"][0]
    assert abs(ratio - np.sqrt(2)) < 1e-12


@only_fmi3
def test_both_versions_give_the_same_bits(start):
    two, three = start(fmi=2), start(fmi=3)
    for driver in (two, three):
        driver.run(0.02, 0.005)
    for name in ["probe.tip.displacement", "boundary.y_min.force", "energy.strain", "steps",
                 "boundary.top.velocity", "momentum.angular", "stable_step"]:
        assert np.array_equal(two.get(name), three.get(name)), name


@only_fmi3
def test_a_mesh_on_a_plane(start):
    two, three = start("meshed", fmi=2), start("meshed", fmi=3)
    for driver in (two, three):
        assert driver.get("contact.floor.particles") == 0
        driver.run(4e-3, 1e-3)
        assert driver.get("contact.floor.particles") > 0
    force, impulse = three.get("contact.floor.force"), three.get("contact.floor.impulse")
    assert force[2] > 0 and impulse[2] > 0 and force[0] == force[1] == impulse[0] == 0
    for name in ["contact.floor.impulse", "probe.tip.displacement", "energy.contact_dissipation"]:
        assert np.array_equal(two.get(name), three.get(name)), name


@only_fmi2
def test_fmu_agrees_with_the_command_line(urlsph, export, start, tmp_path):
    """The outputs of the FMU are the columns of the history of a run."""
    with zipfile.ZipFile(export("column", 3)) as archive:
        archive.extract("resources/scene.json", tmp_path)
    out = tmp_path / "out"
    subprocess.run(
        [urlsph, "run", tmp_path / "resources/scene.json", "--out", out], check=True,
        stderr=subprocess.DEVNULL)
    with open(out / "history.csv") as file:
        rows = list(csv.DictReader(file))
    instance = start(fmi=2)
    names = [n for n in rows[0] if n in instance.variables and n != "time"]
    assert {"probe.tip.displacement[1]", "energy.kinetic", "boundary.top.force[2]"} <= set(names)
    for row in rows:
        if float(row["time"]) > 0:
            instance.step(float(row["time"]) - instance.time)
        for name in names:
            value, expected = instance.get(name), float(row[name])
            scale = max(1.0, abs(expected))
            assert abs(value - expected) <= 1e-9 * scale, (name, row["time"])


def test_steps_of_any_size_end_exactly(start):
    instance = start()
    stable = instance.get("stable_step")
    for size in [stable / 100, 3.7 * stable, 1e-9, 0.9 * stable, 20.123 * stable]:
        instance.step(size)
        assert instance.get("time") == instance.time


def test_time_is_the_importers(start):
    shifted, plain = start(initialize=False), start()
    shifted.initialize(start=10.0, stop=10.05)
    assert shifted.get("time") == 10.0
    for driver in (shifted, plain):
        driver.run(driver.time + 0.01, 0.0025)
    assert shifted.get("time") == pytest.approx(10.01, abs=1e-12)
    assert shifted.get("energy.kinetic") == pytest.approx(plain.get("energy.kinetic"), rel=1e-9)


def test_stop_time_is_obeyed(start):
    instance = start(initialize=False)
    instance.initialize(stop=0.01)
    instance.step(0.005)
    assert status(instance.step, 0.0051) == ERROR
    instance.step(0.005)
    assert status(instance.step, 0.001) == ERROR


def test_inputs_load_the_body(start):
    pulled, pushed = start(), start()
    pushed.set("boundary.top.traction", [-1000.0, 0.0, 0.0])
    assert np.array_equal(pushed.get("boundary.top.traction"), [-1000.0, 0.0, 0.0])
    # The force on the patch answers at once: traction times area.
    assert pushed.get("boundary.top.force")[0] == pytest.approx(-1000.0, rel=1e-12)
    assert pulled.get("boundary.top.force")[0] == pytest.approx(1000.0, rel=1e-12)
    for driver in (pulled, pushed):
        driver.run(0.01, 0.005)
    moved = [d.get("boundary.top.displacement")[0] for d in (pulled, pushed)]
    assert moved[0] > moved[1]


def test_inputs_before_initialisation_count(start):
    early, late = start(initialize=False), start()
    early.set("boundary.top.traction", [0.0, 5e4, 0.0])
    early.initialize()
    late.set("boundary.top.traction", [0.0, 5e4, 0.0])
    for driver in (early, late):
        driver.step(0.01)
    assert early.observe() == late.observe()


def test_values_per_particle(start):
    """A load per particle equals the same load for the patch, and a turning one turns."""
    each, whole = start("per_particle"), start("column", fmi=3)
    assert each.shape("boundary.top.traction") == (25, 3)
    each.set("boundary.x_max.pressure", 0.0)
    each.set("boundary.top.traction", [2000.0, 0.0, 500.0])
    whole.set("boundary.top.traction", [2000.0, 0.0, 500.0])
    for driver in (each, whole):
        driver.run(0.01, 0.005)
    assert np.array_equal(
        each.get("probe.tip.displacement"), whole.get("probe.tip.displacement"))
    x = each.get("boundary.top.initial_position") - [0.5, 3.0, 0.5]
    each.set("boundary.top.traction", 1e5 * np.cross([0.0, 1.0, 0.0], x))
    area = each.get("boundary.top.area")
    assert area.sum() == pytest.approx(1.0, rel=1e-12)
    force = each.get("boundary.top.force")
    assert np.abs(force).max() < 1e-6
    # The couple, with the arms of the body as it is now.
    couple = 1e5 * (area * (x[:, 0] ** 2 + x[:, 2] ** 2)).sum()
    assert each.get("boundary.top.moment")[1] == pytest.approx(couple, rel=0.02)
    for driver in (each, whole):
        driver.step(0.001)
    assert each.get("momentum.angular")[1] > whole.get("momentum.angular")[1]


def test_moving_support(start):
    instance = start("driven")
    instance.set("boundary.top.prescribed_velocity", [0.0, 0.5, 0.0])
    instance.run(0.01, 0.0025)
    assert instance.get("boundary.top.displacement") == pytest.approx([0, 0.005, 0], abs=1e-6)
    assert instance.get("boundary.top.velocity") == pytest.approx([0, 0.5, 0], abs=1e-12)
    # Stretched: the support pulls at the top.
    assert instance.get("boundary.top.force")[1] > 0


def test_heat(start, version):
    instance = start("hot")
    if version == 3:
        assert instance.shape("boundary.top.heat_flux") == (25,)
    instance.set("boundary.top.heat_flux", 1e6)
    instance.set("boundary.x_max.convection_coefficient", 1e3)
    instance.set("boundary.x_max.ambient_temperature", 400.0)
    instance.set("boundary.y_min.prescribed_temperature", 310.0)
    # Heat flows answer at once: flux x area, coefficient x area x difference.
    assert instance.get("boundary.top.heat_flow") == pytest.approx(1e6, rel=1e-12)
    assert instance.get("boundary.x_max.heat_flow") == pytest.approx(3e5, rel=1e-9)
    for name, wrong in [("boundary.y_min.prescribed_temperature", 0.0),
                        ("boundary.x_max.ambient_temperature", -1.0),
                        ("boundary.x_max.convection_coefficient", -1.0)]:
        assert status(instance.set, name, wrong) == ERROR
    state = instance.get_state()
    instance.run(0.01, 0.005)
    after = instance.observe()
    assert instance.get("boundary.y_min.mean_temperature") == pytest.approx(310.0, rel=1e-12)
    assert instance.get("boundary.top.mean_temperature") > 300.0
    top = instance.get("boundary.top.maximum_temperature")
    assert instance.get("boundary.top.mean_temperature") <= top
    assert instance.get("probe.tip.temperature") == pytest.approx(top, rel=1e-2)
    energies = {n: instance.get(f"energy.{n}") for n in ["thermal", "heat_in", "closure_error"]}
    assert energies["thermal"] > 0 and energies["heat_in"] > 0
    residual = abs(energies["closure_error"]) / energies["heat_in"]
    print(f"closure error {residual:.1e} of the heat, tolerance 1e-3")
    assert residual < 1e-3
    assert instance.get("entropy.production") > 0 and "energy.plastic_work" in instance
    # Back, and the same again.
    instance.set_state(state)
    instance.time = 0.0
    instance.run(0.01, 0.005)
    assert instance.observe() == after
    if version == 3:
        each = instance.get("boundary.top.particle_temperature")
        assert each.max() == top
        assert instance.get("field.temperature").max() >= top
        assert instance.get("field.equivalent_plastic_strain").min() >= 0


def test_heat_parameters(start):
    cold, warm = start("hot", initialize=False), start("hot")
    cold.initialize(heat__specific_heat=1000.0, material__yield_stress=2e5)
    assert cold.get("heat.specific_heat") == 1000.0
    for driver in (cold, warm):
        driver.set("boundary.top.heat_flux", 1e6)
        driver.step(0.01)
    assert cold.get("boundary.top.mean_temperature") < warm.get("boundary.top.mean_temperature")


def test_a_body_without_heat_has_none_of_it(start):
    names = " ".join(start().variables)
    for word in ["temperature", "heat", "entropy", "thermal", "plastic", "contact", "ballistic"]:
        assert word not in names


def test_parameters(start):
    base, stiff = start(), start(initialize=False)
    stiff.initialize(material__youngs_modulus=6.8e7, numerics__cfl=0.3)
    cfl = base.get("numerics.cfl")
    ratio = base.get("stable_step") / stiff.get("stable_step")
    assert ratio == pytest.approx(2 * cfl / 0.3, rel=1e-12)
    # Set before initialisation, and read back.
    heavy = start(initialize=False)
    heavy.set("material.density", 4400.0)
    assert heavy.get("material.density") == 4400.0
    kinetic = heavy.get("energy.kinetic") / base.get("energy.kinetic")
    assert kinetic == pytest.approx(4.0, rel=1e-12)


def test_parameters_go_together_at_the_end_of_initialisation(start):
    instance, other = start("hot", initialize=False), start("hot", initialize=False)
    # One after the other, as many importers do, though in between they do not go together.
    instance.set("material.yield_stress", 3e5)
    assert instance.get("material.yield_stress") == 3e5
    assert status(instance.get, "energy.kinetic") == ERROR
    assert status(instance.set, "material.saturation_stress", -1.0) == ERROR
    assert status(instance.initialize) == ERROR
    instance.set("material.saturation_stress", 4e5)
    instance.fmu.exitInitializationMode()
    other.initialize(material__saturation_stress=4e5, material__yield_stress=3e5)
    for driver in (instance, other):
        driver.step(0.01)
    assert instance.observe() == other.observe()


def test_any_number_of_threads_gives_the_same_bits(start):
    results = []
    for threads in (1, 2, 3, 8):
        instance = start(initialize=False)
        instance.initialize(threads=threads)
        instance.run(0.02, 0.01)
        results.append(instance.observe())
    assert all(r == results[0] for r in results)


def test_reset(start):
    instance = start(initialize=False)
    instance.initialize(material__density=2000.0)
    instance.set("boundary.top.traction", [0.0, 1e5, 0.0])
    instance.step(0.01)
    instance.fmu.reset()
    assert instance.get("material.density") == 1100.0
    assert np.array_equal(instance.get("boundary.top.traction"), [1000.0, 0.0, 0.0])
    instance.initialize()
    fresh = start()
    for driver in (instance, fresh):
        driver.run(0.01, 0.005)
    assert instance.observe() == fresh.observe()


def test_values_stay_readable_after_termination(start):
    instance = start()
    instance.step(0.01)
    before = instance.observe()
    instance.fmu.terminate()
    assert instance.observe() == before
    assert status(instance.step, 0.01) == ERROR


@only_fmi3
def test_fields(start):
    instance = start(fmi=3)
    instance.run(0.01, 0.005)
    displacement = instance.get("field.displacement")
    assert displacement.shape == (5 * 13 * 5, 3)
    velocity = instance.get("field.velocity")
    top = instance.get("boundary.top.particle_displacement")
    assert top.shape == (25, 3)
    rows = {tuple(r) for r in displacement}
    assert all(tuple(r) in rows for r in top)
    area = instance.get("boundary.top.area")
    mean = (area[:, None] * top).sum(0) / area.sum()
    assert mean == pytest.approx(instance.get("boundary.top.displacement"), rel=1e-12)
    assert np.isfinite(velocity).all()
    normal = instance.get("boundary.top.normal")
    assert np.array_equal(normal, np.broadcast_to([0.0, 1.0, 0.0], (25, 3)))


@only_fmi3
def test_several_variables_in_one_call(start):
    instance = start(fmi=3)
    names = ["energy.kinetic", "boundary.top.force", "time"]
    references = [instance.variables[n].valueReference for n in names]
    values = instance.fmu.getFloat64(references, nValues=5)
    assert values[0] == instance.get("energy.kinetic") and values[4] == 0.0
    assert values[1:4] == list(instance.get("boundary.top.force"))


@only_fmi3
def test_numpy_helper(export, start, tmp_path, monkeypatch):
    """The module that every FMI 3.0 archive brings along."""
    with zipfile.ZipFile(export("many", 3)) as archive:
        archive.extract("documentation/fmpy_arrays.py", tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path / "documentation"))
    monkeypatch.delitem(sys.modules, "fmpy_arrays", raising=False)
    from fmpy_arrays import Arrays
    instance = start("many", fmi=3)
    arrays = Arrays(instance.fmu, instance.description)
    assert arrays.shape("boundary.top.traction") == (169, 3)
    values = np.random.default_rng(1).normal(size=(169, 3))
    arrays.set("boundary.top.traction", values)
    assert np.array_equal(arrays.get("boundary.top.traction"), values)
    assert np.array_equal(instance.get("boundary.top.traction"), values)
    arrays.set("boundary.top.traction", [1.0, 2.0, 3.0])
    assert np.array_equal(arrays.get("boundary.top.traction")[-1], [1.0, 2.0, 3.0])
    instance.step(1e-3)
    out = np.empty((13**3, 3))
    assert arrays.get("field.velocity", out=out) is out
    assert np.array_equal(out, instance.get("field.velocity"))
    assert arrays.get("energy.kinetic").shape == ()
    with pytest.raises(ValueError, match="shape"):
        arrays.get("field.velocity", out=np.empty(3))
    with pytest.raises(KeyError, match="no variable"):
        arrays.get("nothing")
    with pytest.raises(TypeError, match="Int32"):
        arrays.get("threads")
    with pytest.raises(RuntimeError, match="status 3"):
        arrays.set("energy.kinetic", 1.0)
