"""Pictures of the demo."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

plt.rcParams.update(
    {
        "font.size": 9,
        "axes.titlesize": 10,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.alpha": 0.3,
        "legend.frameon": False,
        "lines.linewidth": 1.4,
        "savefig.dpi": 200,
    }
)

ALONE, COUPLED, DAMPER, HEAT, SCHEME = "#8c8c8c", "#1f5fa8", "#d9822b", "#b5402f", "#c9c9c9"


def surface(initial):
    """The surface of a box of lattice particles as quadrilaterals: (faces, 4) particle indices."""
    places = [np.unique(initial[:, axis].round(9), return_inverse=True)[1] for axis in range(3)]
    lattice = np.empty([place.max() + 1 for place in places], dtype=int)
    lattice[tuple(places)] = np.arange(len(initial))
    quads = []
    for axis in range(3):
        for side, turn in ((0, -1), (-1, 1)):
            face = np.take(lattice, side, axis=axis)
            corners = np.stack([face[:-1, :-1], face[1:, :-1], face[1:, 1:], face[:-1, 1:]], axis=-1)
            # Counter-clockwise seen from outside, so that the shading falls on the right side.
            outward = turn if axis != 1 else -turn
            quads.append(corners.reshape(-1, 4)[:, ::outward])
    return np.concatenate(quads)


def upright(points):
    """From the scene, where y is up, to the picture, where z is up."""
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([x, -z, y], axis=-1)


def snapshots(path, alone, coupled, interval, field, times=(0.5, 1.4, 2.3, 3.2, 4.1, 5.0)):
    """The two columns at several times, coloured by a stress [Pa], from frames of an interval [s]; the
    damper as a ball on a spring."""
    index = [round(time / interval) for time in times]
    most = max(np.quantile(alone[k][field], 0.995) for k in index) / 1e6
    colours = matplotlib.cm.ScalarMappable(matplotlib.colors.Normalize(0, most), "viridis")
    light = matplotlib.colors.LightSource(azdeg=195, altdeg=35)
    quads = surface(alone[0]["initial"])
    figure = plt.figure(figsize=(11, 4.7))
    for row, frames in enumerate((alone, coupled)):
        for column, k in enumerate(index):
            frame = frames[k]
            axes = figure.add_axes(
                [0.035 + column * 0.146, 0.5 - row * 0.475, 0.15, 0.42],
                projection="3d",
                proj_type="ortho",
                computed_zorder=False,
            )
            ground = np.array([[-1.6, -1.3, 0], [1.6, -1.3, 0], [1.6, 1.3, 0], [-1.6, 1.3, 0]])
            axes.add_collection3d(Poly3DCollection([ground], facecolors="#ececec", edgecolors="#c4c4c4", clip_on=False))
            stress = frame[field][quads].mean(axis=1) / 1e6
            axes.add_collection3d(
                Poly3DCollection(
                    upright(frame["points"])[quads],
                    facecolors=colours.to_rgba(stress),
                    edgecolors=(0, 0, 0, 0.18),
                    linewidths=0.25,
                    shade=True,
                    lightsource=light,
                    clip_on=False,
                )
            )
            if "mass" in frame:
                top = frame["initial"][:, 1] > frame["initial"][:, 1].max() - 1e-9
                centre = upright(frame["points"][top].mean(axis=0))
                mass = upright(frame["initial"][top].mean(axis=0) + frame["mass"])
                axes.plot(*np.transpose([centre, mass]), color=DAMPER, linewidth=1.6)
                axes.scatter(*mass, s=75, color=DAMPER, edgecolors="black", linewidths=0.7, depthshade=False)
            axes.set(xlim=(-3.6, 3.6), ylim=(-1.3, 1.3), zlim=(-0.1, 6.9))
            axes.set_box_aspect((7.2, 2.6, 7), zoom=1.48)
            axes.view_init(elev=14, azim=-70)
            axes.set_axis_off()
            axes.patch.set_alpha(0)
            if row == 0:
                left, bottom, width, height = axes.get_position().bounds
                figure.text(left + width / 2, 0.945, f"t = {times[column]:.1f} s", ha="center")
    figure.text(0.02, 0.7, "column alone", rotation=90, va="center", ha="center", fontsize=11)
    figure.text(0.02, 0.23, "with damper", rotation=90, va="center", ha="center", fontsize=11)
    bar = figure.colorbar(colours, cax=figure.add_axes([0.93, 0.15, 0.013, 0.7]), extend="max")
    bar.set_label("von Mises stress [MPa]")
    bar.ax.grid(False)
    figure.savefig(path)
    plt.close(figure)


def histories(path, alone, coupled):
    """Sway of the top with and without the damper, and the force between the two."""
    figure, (sway, force) = plt.subplots(2, 1, figsize=(7.2, 5.6), sharex=True, layout="constrained")
    tip = "boundary.top.displacement[1]"
    sway.plot(alone["time"], alone[tip], color=ALONE, label="top of the column alone")
    sway.plot(coupled["time"], coupled[tip], color=COUPLED, label="top of the column with damper")
    sway.plot(
        coupled["time"], coupled["damper.displacement[1]"], color=DAMPER, linewidth=1, label="mass of the damper"
    )
    sway.set_ylabel("displacement in x [m]")
    sway.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    for k, name, colour in ((1, "x", COUPLED), (2, "y", HEAT)):
        force.plot(coupled["time"], coupled[f"damper.force[{k}]"] / 1e3, color=colour, label=f"in {name}")
    force.set_ylabel("force on the top face [kN]")
    force.set_xlabel("time [s]")
    force.legend(loc="upper right", ncols=2)
    force.set_xlim(0, coupled["time"][-1])
    figure.savefig(path)
    plt.close(figure)


def energies(path, history):
    """Where the energy is: the parts stacked add up to the initial energy."""
    figure, axes = plt.subplots(figsize=(7.2, 4.2), layout="constrained")
    parts = [
        ("column, strain", history["energy.strain"], "#7fa7d6"),
        ("column, kinetic", history["energy.kinetic"], COUPLED),
        ("damper, spring and mass", history["damper.spring"] + history["damper.kinetic"], DAMPER),
        ("heat of the dashpot", history["damper.heat"], HEAT),
        ("dissipated by the scheme", history["energy.numerical_dissipation"], SCHEME),
    ]
    time = history["time"]
    axes.stackplot(
        time,
        *[values / 1e3 for _, values, _ in parts],
        colors=[colour for *_, colour in parts],
        labels=[name for name, *_ in parts],
        linewidth=0,
    )
    initial = history["energy.kinetic"][0] + history["energy.strain"][0]
    axes.axhline(initial / 1e3, color="black", linewidth=1, linestyle="--", label="initial energy")
    axes.set(xlim=(0, time[-1]), ylim=(0, 1.08 * initial / 1e3), xlabel="time [s]", ylabel="energy [kJ]")
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    figure.savefig(path)
    plt.close(figure)
