"""The picture of an example: deformed particles coloured by pressure, and histories.

    urlsph run examples/CASE/scene.json --out RUN --set output.field_interval=DT
    python examples/plot_example.py CASE RUN [PICTURE.png]

Needs matplotlib and meshio (`ffi-tests/requirements.txt`).
"""

import argparse
import math
import xml.etree.ElementTree
from pathlib import Path

import matplotlib.pyplot as plt
import matplotlib.ticker
import meshio
import numpy as np
from plotting import read_table, save, style

EXAMPLES = Path(__file__).parent


def top_corner_angle(history):
    """Unwrapped angle of the top corner about Y [degrees]."""
    x = 0.5 + history["probe.top_corner.displacement[1]"]
    z = 0.5 + history["probe.top_corner.displacement[3]"]
    return np.degrees(np.unwrap(np.arctan2(x, z))) - 45


def column(name):
    """A column of a history."""
    return lambda history: history[name]


def change(name):
    """A column of a history less its first value."""
    return lambda history: history[name] - history[name][0]


def length(name):
    """The Euclidean norm of a vector in a history."""
    return lambda history: np.linalg.norm([history[f"{name}[{i}]"] for i in (1, 2, 3)], axis=0)


class Example:
    """What is drawn: times of the particles, curves, how much displacements are enlarged; particles
    are coloured by pressure, or by their temperature above a reference."""

    def __init__(
        self, times, curves, label, *, enlarge=1, gap=1.2, azimuth=25, size=1.0, stacked=False, z_up=False,
        reference_temperature=None
    ):
        self.times, self.curves, self.label = times, curves, label
        self.enlarge, self.gap, self.azimuth, self.size = enlarge, gap, azimuth, size
        self.stacked, self.z_up = stacked, z_up
        self.reference_temperature = reference_temperature

    def colour(self, mesh):
        """What colours the particles of a state."""
        if self.reference_temperature is None:
            return mesh.point_data["pressure"].ravel()
        return mesh.point_data["temperature"].ravel() - self.reference_temperature

    def unit(self, most):
        """Name, unit and scale of the colours up to `most`."""
        if self.reference_temperature is not None:
            return f"temperature above {self.reference_temperature:g} K", "K", 1
        return "pressure", *(("Pa", 1) if most < 1e3 else ("kPa", 1e3) if most < 1e6 else ("MPa", 1e6))


# Curves: the name in the legend, how it is got from history.csv, its column of expected.csv.
CASES = {
    "column_bending": Example(
        [0.0, 0.12, 0.25, 0.46, 0.93, 1.38],
        [
            (f"$u_{axis}$ of the top corner", column(name), name)
            for axis, name in (
                ("x", "probe.top_corner.displacement[1]"),
                ("y", "probe.top_corner.displacement[2]"),
            )
        ],
        "displacement [m]",
        gap=0.3,
    ),
    "column_tension": Example(
        [0.0, 0.02, 0.045, 0.085, 0.125, 0.165],
        [
            (
                "$u_y$ of the top",
                column("probe.top_centre.displacement[2]"),
                "probe.top_centre.displacement[2]",
            )
        ],
        "displacement [m]",
    ),
    "column_twisting": Example(
        [0.0, 0.03, 0.06, 0.09, 0.17, 0.25],
        [("angle of a top corner", top_corner_angle, "angle_deg")],
        "angle [degrees]",
    ),
    "elastic_cube": Example(
        [0.0, 0.004, 0.008, 0.012, 0.016],
        [
            (
                "$u_x$ at (1, 0, 0)",
                column("probe.x_face_centre.displacement[1]"),
                "probe.x_face_centre.displacement[1]",
            )
        ],
        "displacement [m]",
        enlarge=4e5,
        gap=0.4,
        azimuth=205,
    ),
    "swinging_cube": Example(
        [0.0, 0.0028, 0.0056, 0.0084, 0.0112],
        [
            (
                "$u_x$ at (1, 0, 0)",
                column("probe.x_face_centre.displacement[1]"),
                "probe.x_face_centre.displacement[1]",
            )
        ],
        "displacement [m]",
        enlarge=400,
        gap=0.4,
        azimuth=205,
        reference_temperature=293.15,
    ),
    "thermo_wave": Example(
        [0.0, 0.002, 0.004, 0.006, 0.008, 0.01],
        [
            (
                "$u_x$ at the antinode",
                column("probe.antinode.displacement[1]"),
                "probe.antinode.displacement[1]",
            )
        ],
        "displacement [m]",
        enlarge=2000,
        gap=0.07,
        azimuth=0,
        stacked=True,
        reference_temperature=293.15,
    ),
    "slab_heating": Example(
        [0.0005, 0.0025, 0.005, 0.01, 0.025, 0.05],
        [
            (f"{name}", column(f"probe.{name}.temperature"), f"probe.{name}.temperature")
            for name in ("surface", "back")
        ],
        "temperature [K]",
        gap=0.07,
        azimuth=0,
        stacked=True,
        reference_temperature=293.15,
    ),
    "homogeneous": Example(
        [0.0, 0.4, 0.6, 1.0],
        [
            (
                "$u_x$ of the free corner",
                column("probe.corner.displacement[1]"),
                "probe.corner.displacement[1]",
            )
        ],
        "displacement [m]",
        enlarge=10,
        gap=0.4,
        azimuth=205,
        reference_temperature=293.15,
    ),
    "l_block_thermal": Example(
        [0.0, 5.0, 15.0, 30.0, 48.0],
        [
            ("entropy less that at the start", change("entropy.total"), None),
            ("produced", column("entropy.production"), None),
        ],
        "[J/K]",
        gap=2.0,
        size=1.35,
        reference_temperature=293.15,
    ),
    "punch": Example(
        [0.0, 0.03, 0.05, 0.12],
        [
            ("$u_z$ of the corner", column("probe.corner.displacement[3]"), None),
            ("of the far corner", column("probe.far_corner.displacement[3]"), None),
        ],
        "displacement [m]",
        enlarge=5,
        gap=0.3,
        z_up=True,
        size=1.2,
    ),
    "l_block": Example(
        [0.0, 5.0, 10.0, 15.0, 20.0],
        [
            ("angular momentum", length("momentum.angular"), None),
            ("linear momentum times 1 m", length("momentum.linear"), None),
        ],
        "[kg m²/s]",
        gap=2.0,
        size=1.35,
    ),
}


def read_fields(folder, time, colour):
    """The written state nearest to a time: time, initial positions, displacements, colours."""
    sets = xml.etree.ElementTree.parse(folder / "fields.pvd").iter("DataSet")
    nearest = min(sets, key=lambda s: abs(float(s.get("timestep")) - time))
    mesh = meshio.read(folder / nearest.get("file"))
    displacement = mesh.point_data["displacement"]
    return float(nearest.get("timestep")), mesh.points - displacement, displacement, colour(mesh)


def project(points, azimuth):
    """Parallel projection with y up: right, up and towards the eye."""
    turn, tilt = math.radians(azimuth), math.radians(18)
    x, y, z = points.T
    right = x * math.cos(turn) - z * math.sin(turn)
    front = x * math.sin(turn) + z * math.cos(turn)
    return right, y * math.cos(tilt) - front * math.sin(tilt), y * math.sin(tilt) + front * math.cos(tilt)


def draw_particles(figure, axes, example, folder):
    """States side by side, far particles first."""
    states = [read_fields(folder, time, example.colour) for time in example.times]
    most = np.quantile(np.abs(np.concatenate([state[3] for state in states])), 0.99)
    name, unit, scale = example.unit(most)
    initial = states[0][1]
    # That of a lattice, or near enough of other particles.
    spacing = max(
        np.diff(np.unique(initial[:, 0].round(6)))[0],
        0.8 * np.cbrt(np.ptp(initial, axis=0).prod() / len(initial)),
    )
    offset, clouds = 0.0, []
    for time, start, displacement, colour in states:
        points = start + example.enlarge * displacement
        if example.z_up:
            points = points[:, [0, 2, 1]] * (1, 1, -1)
        right, up, depth = project(points, example.azimuth)
        if example.stacked:
            up = up + offset - up.max()
            offset -= np.ptp(up) + example.gap
            place, alignment = (right.min(), up.mean()), {"ha": "right", "va": "center"}
        else:
            right = right + offset - right.min()
            offset += np.ptp(right) + example.gap
            place, alignment = (right.mean(), up.min()), {"ha": "center", "va": "top"}
        order = np.argsort(depth)
        clouds.append(
            axes.scatter(
                right[order], up[order], c=colour[order] / scale, cmap="coolwarm",
                vmin=-most / scale, vmax=most / scale, linewidths=0.15, edgecolors="#00000055",
            )
        )
        axes.annotate(f"{time:g} s", place, (-8, 0) if example.stacked else (0, -8), textcoords="offset points", fontsize=8, **alignment)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.margins(0.03, 0.06)
    figure.canvas.draw()
    # A little more than the spacing, so that the surface is closed.
    dots = axes.transData.transform([[spacing, 0], [0, 0]])
    diameter = 1.15 * example.size * (dots[0, 0] - dots[1, 0]) * 72 / figure.dpi
    for cloud in clouds:
        cloud.set_sizes([diameter**2])
    bar = figure.colorbar(clouds[0], ax=axes, shrink=0.75, pad=0.01, aspect=25)
    bar.set_label(f"{name} [{unit}]")
    bar.outline.set_visible(False)
    if example.enlarge != 1:
        axes.set_title(f"displacements enlarged {example.enlarge:,.0f} times", fontsize=9)


def draw_curves(axes, example, history, expected):
    """Histories with the reference behind them."""
    for i, (name, measure, reference) in enumerate(example.curves):
        if expected is not None and reference is not None:
            end = expected["time"] <= history["time"][-1] * (1 + 1e-9)
            axes.plot(
                expected["time"][end], expected[reference][end], color="#b0b0b0", linewidth=4,
                label="reference" if i == 0 else None,
            )
        axes.plot(history["time"], measure(history), color=("#1f5fa8", "#d9822b")[i], label=name)
    axes.xaxis.set_major_locator(matplotlib.ticker.MaxNLocator(5))
    axes.set_xlabel("time [s]")
    axes.set_ylabel(example.label)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.16), ncols=3, columnspacing=1.2)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("case", choices=CASES)
    parser.add_argument("run", type=Path, help="folder written by `urlsph run`")
    parser.add_argument("picture", type=Path, nargs="?", help="default: picture.png of the example")
    arguments = parser.parse_args()
    example = CASES[arguments.case]
    expected = EXAMPLES / arguments.case / "expected.csv"
    history = read_table(arguments.run / "history.csv")
    style()
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(10, 3.8), dpi=110, width_ratios=(1.5, 1), layout="constrained"
    )
    draw_curves(right, example, history, read_table(expected) if expected.exists() else None)
    draw_particles(figure, left, example, arguments.run)
    save(figure, arguments.picture or EXAMPLES / arguments.case / "picture.png")


if __name__ == "__main__":
    main()
