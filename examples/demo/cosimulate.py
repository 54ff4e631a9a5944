"""Two-way co-simulation: a swinging elastic column and a tuned mass damper on its top face.

The column (large-strain SPH) is an FMU; the damper is the Python class next door. They meet at the
top face of the column: its mean displacement and velocity go to the damper, and the damper's force
comes back as a traction, force over area.

One communication step of length H, from t to t + H:

1. the traction of the step is the damper's force extrapolated to t + H/2 from its last two values,
   over the area of the face: constant over the step and, for the extrapolation, off by O(H^2);
2. the column makes the step, in as many stable steps of its own as it needs;
3. the damper follows the motion that the face has made, and has a new force.

So each model sees the other a half step ahead, never iterates, and the energy that leaves the one
and the energy that reaches the other differ by O(H^2): the script prints both. It also repeats
the first swing with 2 H, to show that this difference is the coupling's error and falls with H.
"""

import argparse
import csv
import json
from pathlib import Path

import meshio
import numpy as np

import pictures
from column import Column
from damper import Damper

HERE = Path(__file__).parent

# Communication step [s]: 1/370 of the column's swing, and a handful of its stable steps.
STEP = 0.005

# The column's first bending mode, 1.84 s (a quarter of a swing lasts 0.46 s), moves the top like
# about a quarter of the column's 6600 kg would. A damper of 400 kg is a fourth of that: heavy for
# a building, but it calms the column within a few swings.
FREQUENCY = 1 / 1.84
MODAL_MASS = 1650.0
MASS = 400.0

ENERGIES = ["kinetic", "strain", "external_work", "numerical_dissipation", "closure_error"]
FIELDS = ["displacement", "velocity", "pressure", "von_mises_stress"]


def couple(fmu, step, end, on_record=None):
    """Co-simulates to `end`; returns the history as a dict of arrays."""
    rows = []
    damper = Damper.tuned(MASS, MODAL_MASS, FREQUENCY)
    with Column(fmu) as column:
        area = column.get("boundary.top.area").sum()
        top = lambda: (column.get("boundary.top.displacement"), column.get("boundary.top.velocity"))

        def record(force):
            kinetic, spring = damper.energy(motion[0])
            row = {"time": column.time}
            for name in ENERGIES:
                row[f"energy.{name}"] = column.get(f"energy.{name}")
            for name, vector in {
                "boundary.top.displacement": motion[0],
                "boundary.top.velocity": motion[1],
                "damper.displacement": damper.displacement,
                "damper.force": force,
            }.items():
                row |= {f"{name}[{k + 1}]": value for k, value in enumerate(vector)}
            row["damper.kinetic"] = kinetic
            row["damper.spring"] = spring
            row["damper.work_on_column"] = damper.work
            row["damper.heat"] = damper.heat
            rows.append(row)
            if on_record:
                on_record(len(rows) - 1, column, damper)

        motion = top()
        force = damper.force(*motion)
        last_force = force
        record(force)
        for _ in range(round(end / step)):
            column.set("boundary.top.traction", (1.5 * force - 0.5 * last_force) / area)
            column.step(step)
            before, motion = motion, top()
            damper.advance(step, before, motion)
            last_force, force = force, damper.force(*motion)
            record(force)
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def work_difference(history):
    """Energies that the damper took from the column, by the column's books and by the damper's, and
    their largest difference over the history."""
    column, damper = -history["energy.external_work"], -history["damper.work_on_column"]
    return column[-1], damper[-1], np.abs(column - damper).max()


class FieldFiles:
    """Field snapshots of the co-simulation: VTU files under a PVD collection."""

    def __init__(self, folder, every):
        self.folder, self.every, self.frames = folder, every, []
        (folder / "fields").mkdir()

    def __call__(self, index, column, damper):
        if index % self.every:
            return
        initial = column.get("field.initial_position")
        data = {name: column.get(f"field.{name}") for name in FIELDS}
        name = f"fields/state_{len(self.frames):06d}.vtu"
        cells = [("vertex", np.arange(len(initial))[:, None])]
        points = initial + data["displacement"]
        meshio.Mesh(points, cells, point_data=data).write(self.folder / name)
        self.frames.append(
            {"time": column.time, "file": name, "initial": initial, "mass": damper.displacement.copy()}
            | {"points": points}
            | data
        )
        entries = "".join(
            f'    <DataSet timestep="{frame["time"]!r}" file="{frame["file"]}"/>\n'
            for frame in self.frames
        )
        (self.folder / "fields.pvd").write_text(
            '<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0">\n'
            f"  <Collection>\n{entries}  </Collection>\n</VTKFile>\n"
        )


def read_run(folder):
    """History and field frames of `urlsph run`."""
    with open(folder / "history.csv") as file:
        rows = list(csv.reader(file))
    table = np.array(rows[1:], dtype=float)
    history = {name: table[:, k] for k, name in enumerate(rows[0])}
    frames = []
    for path in sorted((folder / "fields").glob("*.vtu")):
        mesh = meshio.read(path)
        data = {name: np.squeeze(values) for name, values in mesh.point_data.items()}
        frames.append({"points": mesh.points, "initial": data["initial_position"]} | data)
    return history, frames


def write_csv(path, history):
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(history)
        writer.writerows(zip(*(column.tolist() for column in history.values())))


def swing_amplitude(history, name, since):
    """Largest absolute value of a column of the history from `since` on."""
    return np.abs(history[name][history["time"] >= since - 1e-9]).max()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fmu", type=Path, required=True, help="the column, FMI 3.0")
    parser.add_argument("--alone", type=Path, required=True, help="results of `urlsph run`, the column without damper")
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    arguments = parser.parse_args()
    out = arguments.out
    scene = json.loads((HERE / "scene.json").read_text())
    end = scene["time"]["end"]

    alone, alone_frames = read_run(arguments.alone)
    interval = scene["output"]["field_interval"]
    files = FieldFiles(out, every=round(interval / STEP))
    history = couple(arguments.fmu, STEP, end, files)
    write_csv(out / "history.csv", history)

    # The same coupling with a step twice as long, over the first swing.
    swing = 1.8
    coarse = couple(arguments.fmu, 2 * STEP, swing)
    fine = {name: values[history["time"] <= swing + 1e-9] for name, values in history.items()}
    errors = [work_difference(run)[2] for run in (coarse, fine)]
    column_work, damper_work, difference = work_difference(history)

    pictures.snapshots(out / "snapshots.png", alone_frames, files.frames, interval, "von_mises_stress")
    pictures.histories(out / "histories.png", alone, history)
    pictures.energies(out / "energies.png", history)

    initial = history["energy.kinetic"][0] + history["energy.strain"][0]
    damper = Damper.tuned(MASS, MODAL_MASS, FREQUENCY)
    late = end - swing
    tip = "boundary.top.displacement[1]"
    before, after = swing_amplitude(alone, tip, late), swing_amplitude(history, tip, late)
    closure = np.abs(history["energy.closure_error"]).max() / initial
    tolerance = 1e-3 * initial
    agreed = difference < tolerance
    summary = f"""# A swinging column and a tuned mass damper

An elastic column of 1 m x 6 m x 1 m, clamped at the bottom, is set swinging ({initial / 1e3:.0f} kJ).
On its top face hangs a mass of {damper.mass:.0f} kg by a spring of {damper.stiffness:.0f} N/m and a dashpot of
{damper.damping:.0f} N s/m. The column is an FMU of {len(files.frames[0]["initial"])} particles, the damper a Python class; they
exchange motion and traction every {STEP * 1e3:g} ms over {end:g} s.

| | column alone | with damper |
| --- | --- | --- |
| largest sway of the top in the first swing | {np.abs(alone[tip][alone["time"] <= swing]).max():.2f} m | {np.abs(history[tip][history["time"] <= swing]).max():.2f} m |
| largest sway of the top in the last swing | {before:.2f} m | {after:.2f} m |

Largest force between column and damper: {np.linalg.norm([history[f"damper.force[{k}]"] for k in (1, 2, 3)], axis=0).max() / 1e3:.2f} kN.

Energy that the damper took from the column:

- by the column's ledger {column_work / 1e3:.4f} kJ, by the damper's own books {damper_work / 1e3:.4f} kJ;
- largest difference at any time {difference:.3g} J, {difference / initial:.1e} of the initial energy \
({"less" if agreed else "MORE"} than the {tolerance / initial:g} that the demo allows);
- over the first swing {errors[0]:.3g} J with H = {2 * STEP * 1e3:g} ms and {errors[1]:.3g} J with H = {STEP * 1e3:g} ms:
  the difference is the coupling's error and falls with order {np.log2(errors[0] / errors[1]):.1f} in the step.

The column's own energy balance closes to {closure:.1e} of the initial energy; the scheme dissipated
{history["energy.numerical_dissipation"][-1] / initial * 100:.1f} % of it, the damper {history["damper.heat"][-1] / initial * 100:.1f} %.

| file | what |
| --- | --- |
| `snapshots.png` | the column alone and with the damper, by von Mises stress |
| `histories.png` | sway of the top, force between the two |
| `energies.png` | where the energy goes |
| `history.csv` | all of it by time |
| `fields.pvd`, `fields/` | fields of the co-simulation, for ParaView |
| `alone/` | history and fields of the column alone, by `urlsph run` |
| `column.fmu` | the column |
"""
    (out / "summary.md").write_text(summary)
    print(summary)
    if not agreed:
        raise SystemExit("error: the two sides of the coupling do not agree on the energy exchanged")


if __name__ == "__main__":
    main()
