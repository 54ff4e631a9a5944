"""Picture of `cargo bench --bench growth`.

    python benches/growth/plot.py target/growth.csv benches/growth/results.png
"""

import csv
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))

from plotting import plt, save, style  # noqa: E402


def main(table, picture):
    with open(table, newline="") as file:
        rows = list(csv.DictReader(file))
    bodies = list(dict.fromkeys(row["body"] for row in rows))
    style()
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), constrained_layout=True)
    panels = [
        ("step_ns_per_pair", "step [ns per pair and right-hand side]"),
        ("step_us_per_particle", "step [µs per particle]"),
        ("bytes", "memory [bytes per particle]"),
    ]
    for ax, (column, label) in zip(axes, panels):
        for body, marker in zip(bodies, "os^Dv"):
            own = [row for row in rows if row["body"] == body and row[column]]
            ax.plot(
                [float(row["particles"]) for row in own],
                [float(row[column]) for row in own],
                marker=marker,
                markersize=4,
                label=body,
            )
        ax.set(xscale="log", xlabel="particles", ylabel=label, ylim=(0, None))
    axes[0].legend()
    save(figure, picture)


main(*sys.argv[1:])
