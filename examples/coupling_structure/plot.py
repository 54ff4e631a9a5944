"""Picture of the residuals: `python plot.py RESIDUALS.csv PICTURE.png`."""

import csv
import sys
from collections import defaultdict

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

runs = defaultdict(lambda: defaultdict(list))
with open(sys.argv[1]) as file:
    for row in csv.DictReader(file):
        runs[row["membrane"]][int(row["step"])].append(float(row["residual"]))
figure, axes = plt.subplots(1, len(runs), figsize=(10, 4), sharey=True, layout="constrained")
for axis, (name, steps) in zip(axes, runs.items()):
    for step, residuals in steps.items():
        colour = plt.cm.viridis(step / max(steps))
        axis.semilogy(range(1, len(residuals) + 1), residuals, "-o", ms=2.5, lw=0.8, color=colour)
    axis.axhline(1e-8, color="k", lw=0.8, ls=":")
    axis.set_title(f"{name} membrane, {len(steps)} steps, early dark to late bright")
    axis.set_xlabel("iteration")
axes[0].set_ylabel("|S(q) − q| over the largest |q|")
figure.savefig(sys.argv[2], dpi=110)
