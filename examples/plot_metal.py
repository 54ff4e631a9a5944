"""The picture of a metal bar: the outline and plane of symmetry deformed, coloured by plastic strain and
temperature or pressure, and histories.

    urlsph run examples/CASE/scene.json --out RUN --set output.field_interval=DT
    python examples/plot_metal.py CASE RUN [PICTURE.png]

Needs matplotlib and meshio (`ffi-tests/requirements.txt`).
"""

import argparse
import csv
import json
import xml.etree.ElementTree
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import meshio
import numpy as np
from PIL import Image

EXAMPLES = Path(__file__).parent

# The case: columns of the reference for radius and length, whether length is from foot to top.
REFERENCES = {"copper_impact": ("radius", "length")}
NAMES = {
    "equivalent_plastic_strain": ("plastic strain", 1),
    "temperature": ("temperature [K]", 1),
    "pressure": ("pressure [MPa]", 1e-6),
}


def read_table(path):
    """Columns of a CSV file by name."""
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    values = np.array(rows[1:], dtype=float)
    return {name: values[:, i] for i, name in enumerate(rows[0])}


def states(folder):
    """Times and meshes of a run."""
    for item in xml.etree.ElementTree.parse(folder / "fields.pvd").iter("DataSet"):
        yield float(item.get("timestep")), meshio.read(folder / item.get("file"))


def draw_states(axes, run, field, mirrored):
    """The plane of angle 0, mirrored: one field on the right, another on the left."""
    offset, frames = 0.0, list(states(run))
    frames = frames[:: max(1, (len(frames) - 1) // 5)]
    ranges, clouds = {}, {}
    for name in (field, mirrored):
        values = np.concatenate([m.point_data[name].ravel() for _, m in frames]) * NAMES[name][1]
        ranges[name] = (np.quantile(values, 0.005), np.quantile(values, 0.995))
    for time, mesh in frames:
        x = mesh.points * 1e3
        start = x - mesh.point_data["displacement"] * 1e3
        plane = np.abs(start[:, 1]) < 1e-6
        width = x[plane, 0].max()
        offset += width + 0.8
        for name, side, colours in ((field, 1, "viridis"), (mirrored, -1, "inferno")):
            low, high = ranges[name]
            clouds[name] = axes.scatter(
                offset + side * x[plane, 0], x[plane, 2], s=7,
                c=mesh.point_data[name].ravel()[plane] * NAMES[name][1],
                cmap=colours, vmin=low, vmax=high, linewidths=0,
            )
        axes.annotate(
            f"{time * 1e6:.0f} µs", (offset, x[:, 2].min()), (0, -6), textcoords="offset points",
            ha="center", va="top", fontsize=8,
        )
        offset += width
    axes.set_aspect("equal")
    axes.axis("off")
    for name, cloud in clouds.items():
        bar = plt.colorbar(cloud, ax=axes, shrink=0.7, pad=0.01, aspect=28)
        bar.set_label(NAMES[name][0] + (", right" if name == field else ", left"), fontsize=8)
        bar.ax.tick_params(labelsize=7)


def draw_curves(axes, case, run):
    """Radius and length over time with the reference behind them."""
    history = read_table(run / "history.csv")
    probes = json.loads((run / "scene.json").read_text())["probes"]
    radial = "rim" if "rim" in probes else "neck"
    curves = [
        ("radius", probes[radial][0] + history[f"probe.{radial}.displacement[1]"], "#1f5fa8"),
        ("height of the top", probes["top"][2] + history["probe.top.displacement[3]"], "#d9822b"),
    ]
    expected = EXAMPLES / case / "expected.csv"
    for i, (name, values, colour) in enumerate(curves):
        if case in REFERENCES and expected.exists():
            table = read_table(expected)
            column = table[REFERENCES[case][i]]
            axes.plot(table["time"] * 1e6, column / column[0], color="#b0b0b0", linewidth=4,
                      label="reference" if i == 0 else None)
        axes.plot(history["time"] * 1e6, values / values[0], color=colour, label=name)
    axes.set_xlabel("time [µs]")
    axes.set_ylabel("over the initial one")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, fontsize=8)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("case")
    parser.add_argument("run", type=Path, help="folder written by `urlsph run`")
    parser.add_argument("picture", type=Path, nargs="?", help="default: picture.png of the example")
    arguments = parser.parse_args()
    fields = next(states(arguments.run))[1].point_data
    other = "temperature" if "temperature" in fields else "pressure"
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(11, 4.6), dpi=110, width_ratios=(2, 1), layout="constrained"
    )
    draw_states(left, arguments.run, "equivalent_plastic_strain", other)
    draw_curves(right, arguments.case, arguments.run)
    figure.canvas.draw()
    picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3])
    picture = picture.quantize(256, method=Image.Quantize.MAXCOVERAGE)
    picture.save(arguments.picture or EXAMPLES / arguments.case / "picture.png", optimize=True)


if __name__ == "__main__":
    main()
