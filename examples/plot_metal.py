"""The picture of a metal bar: the plane of symmetry deformed, coloured by plastic strain and temperature
or pressure, and histories: radius, height and temperature inside over time, or, of a bar that is drawn
out, radius and force over the elongation.

    urlsph run examples/CASE/scene.json --out RUN --set output.field_interval=DT
    python examples/plot_metal.py CASE RUN [PICTURE.png] [--beside OTHER_RUN]

Needs matplotlib and meshio (`ffi-tests/requirements.txt`).
"""

import argparse
import json
import math
import xml.etree.ElementTree
from pathlib import Path

import matplotlib.pyplot as plt
import meshio
import numpy as np
from plotting import read_table, save

EXAMPLES = Path(__file__).parent

# The case: columns of the reference for radius and length.
REFERENCES = {"copper_impact": ("radius", "length")}
NAMES = {
    "equivalent_plastic_strain": ("plastic strain", 1),
    "temperature": ("temperature [K]", 1),
    "pressure": ("pressure [MPa]", 1e-6),
}


def states(folder):
    """Times and meshes of a run."""
    for item in xml.etree.ElementTree.parse(folder / "fields.pvd").iter("DataSet"):
        yield float(item.get("timestep")), meshio.read(folder / item.get("file"))


def draw_states(axes, run, field, mirrored):
    """The plane of angle 0, mirrored: one field on the right, another on the left."""
    offset, frames = 0.0, list(states(run))
    frames = frames[:: max(1, math.ceil((len(frames) - 1) / 5))]
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
        bar = axes.figure.colorbar(cloud, ax=axes, shrink=0.7, pad=0.01, aspect=28)
        bar.set_label(NAMES[name][0] + (", right" if name == field else ", left"), fontsize=8)
        bar.ax.tick_params(labelsize=7)


def told_apart(scenes):
    """What tells runs apart: the temperature at the start, or the cells of the section."""
    starts = [s["heat"]["reference_temperature"] if s.get("heat") else None for s in scenes]
    if None not in starts and len(set(starts)) == len(starts):
        return [f"{start:.0f} K" for start in starts]
    return [f"{s['geometry']['cylinder']['divisions']} divisions" for s in scenes]


def draw_curves(axes, case, runs):
    """Histories of the runs, the first of them in full lines, with the reference behind them."""
    scenes = [json.loads((run / "scene.json").read_text()) for run in runs]
    labels = told_apart(scenes) if len(runs) > 1 else [""]
    drawn_out = "neck" in scenes[0]["probes"]
    styles = ["-", "--", ":"]
    axes[0].set_ylabel("over the initial one")
    for run, scene, label, style in zip(runs, scenes, labels, styles):
        history, probes = read_table(run / "history.csv"), scene["probes"]
        label = label and f", {label}"
        radial = "neck" if drawn_out else "rim"
        radius = 1 + history[f"probe.{radial}.displacement[1]"] / probes[radial][0]
        rise = history["probe.top.displacement[3]"]
        if drawn_out:
            x, unit = 2e3 * rise, "elongation [mm]"
            curves = [(f"radius of the neck{label}", radius, "#1f5fa8")]
        else:
            x, unit = history["time"] * 1e6, "time [µs]"
            curves = [(f"radius{label}", radius, "#1f5fa8"),
                      (f"height of the top{label}", 1 + rise / probes["top"][2], "#d9822b")]
        expected = EXAMPLES / case / "expected.csv"
        for i, (name, values, colour) in enumerate(curves):
            if case in REFERENCES and expected.exists() and run is runs[0]:
                table = read_table(expected)
                column = table[REFERENCES[case][i]]
                axes[0].plot(table["time"] * 1e6, column / column[0], color="#b0b0b0", linewidth=4,
                             label="reference" if i == 0 else None)
            axes[0].plot(x, values, color=colour, linestyle=style, label=name)
        if "probe.inside.temperature" in history:
            axes[1].plot(x, history["probe.inside.temperature"], color="#a63d40", linestyle=style,
                         label=f"{1e3 * probes['inside'][2]:.1f} mm above the foot{label}")
            axes[1].set_ylabel("temperature [K]")
        elif "boundary.top.force[3]" in history and drawn_out:
            sector = scene["geometry"]["cylinder"]["sector"]
            degrees = sector["wedge"] if isinstance(sector, dict) else {"quarter": 90}[sector]
            axes[1].plot(x, 360e-3 / degrees * history["boundary.top.force[3]"], color="#a63d40",
                         linestyle=style, label=f"whole section{label}")
            axes[1].set_ylabel("force [kN]")
        axes[-1].set_xlabel(unit)
    for a in axes:
        a.grid(alpha=0.3)
        a.legend(frameon=False, fontsize=7)


def histories(run):
    """How many diagrams the histories of a run take."""
    with open(run / "history.csv") as file:
        names = file.readline()
    force = "boundary.top.force" in names and "probe.neck" in names
    return 2 if "probe.inside.temperature" in names or force else 1


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("case")
    parser.add_argument("run", type=Path, help="folder written by `urlsph run`")
    parser.add_argument("picture", type=Path, nargs="?", help="default: picture.png of the example")
    parser.add_argument("--beside", type=Path, action="append", default=[],
                        help="another run, whose histories are drawn too")
    arguments = parser.parse_args()
    fields = next(states(arguments.run))[1].point_data
    other = "temperature" if "temperature" in fields else "pressure"
    figure = plt.figure(figsize=(11, 4.6), dpi=110, layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(2, 1))
    draw_states(left.subplots(), arguments.run, "equivalent_plastic_strain", other)
    diagrams = right.subplots(histories(arguments.run), 1, sharex=True, squeeze=False)[:, 0]
    draw_curves(diagrams, arguments.case, [arguments.run, *arguments.beside])
    save(figure, arguments.picture or EXAMPLES / arguments.case / "picture.png")


if __name__ == "__main__":
    main()
