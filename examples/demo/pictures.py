"""Pictures of the demo."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

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


def surface(points):
    """Which particles of a box lie on its surface."""
    low, high = points.min(axis=0), points.max(axis=0)
    return ((points < low + 1e-9) | (points > high - 1e-9)).any(axis=1)


def snapshots(path, alone, coupled, field, times=(0.5, 1.4, 2.3, 3.2, 4.1, 5.0), interval=0.1):
    """The two columns at several times, coloured by a stress; the damper as a ball on a spring."""
    index = [round(time / interval) for time in times]
    scale = max(np.quantile(alone[k][field], 0.995) for k in index) / 1e6
    figure = plt.figure(figsize=(11, 6.4))
    for row, frames in enumerate((alone, coupled)):
        for column, k in enumerate(index):
            frame = frames[k]
            axes = figure.add_axes(
                [0.045 + column * 0.143, 0.5 - row * 0.44, 0.143, 0.43], projection="3d", computed_zorder=False
            )
            shown = surface(frame["initial"])
            x, y, z = frame["points"][shown].T
            dots = axes.scatter(
                x, z, y, c=frame[field][shown] / 1e6, s=9, vmin=0, vmax=scale, cmap="viridis", linewidths=0, depthshade=False
            )
            if "mass" in frame:
                top = frame["points"][frame["initial"][:, 1] > 6 - 1e-9].mean(axis=0)
                mass = np.array([0, 6, 0]) + frame["mass"]
                spring = np.linspace(top, mass, 2)
                axes.plot(spring[:, 0], spring[:, 2], spring[:, 1], color=DAMPER, linewidth=1.2)
                axes.scatter(*mass[[0, 2, 1]], s=70, color=DAMPER, edgecolors="black", linewidths=0.6, depthshade=False)
            axes.set(xlim=(-4, 4), ylim=(-1, 1), zlim=(0, 7))
            axes.set_box_aspect((8, 2, 7), zoom=1.55)
            axes.set_proj_type("ortho")
            axes.view_init(elev=12, azim=-78)
            axes.set_axis_off()
            if row == 0:
                axes.set_title(f"t = {times[column]:.1f} s", y=0.98)
    figure.text(0.02, 0.71, "column alone", rotation=90, va="center", ha="center", fontsize=11)
    figure.text(0.02, 0.27, "with damper", rotation=90, va="center", ha="center", fontsize=11)
    bar = figure.colorbar(dots, cax=figure.add_axes([0.93, 0.2, 0.014, 0.6]), extend="max")
    bar.set_label("von Mises stress [MPa]")
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
