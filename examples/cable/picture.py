"""The picture of the cable: velocity of its middle with each limiter, elastic and elastic-plastic.

    python examples/cable/picture.py URLSPH [PICTURE.png]

runs both scenes with the command line URLSPH and draws them. Needs matplotlib.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

import matplotlib.pyplot as plt
from plotting import read_table, save, style

NAME = "probe.middle.velocity[1]"
CURVES = {"none": "#9aa0a6", "minmod": "#d9822b", "shock": "#1f5fa8"}


def history(urlsph, scene, limiter, folder):
    """The history of a run with a limiter."""
    out = folder / f"{scene}_{limiter}"
    subprocess.run(
        [urlsph, "run", HERE / f"{scene}.json", "--out", out, "--quiet"]
        + ["--set", f"numerics.limiter={limiter}", "--set", "output.history_interval=0.08"],
        check=True,
    )
    return read_table(out / "history.csv")


def main():
    urlsph = sys.argv[1]
    picture = Path(sys.argv[2]) if len(sys.argv) > 2 else HERE / "picture.png"
    style()
    figure, axes = plt.subplots(1, 2, figsize=(10, 3.6), dpi=110, layout="constrained", sharey=True)
    with tempfile.TemporaryDirectory() as folder:
        for ax, scene, expected, title in (
            (axes[0], "scene", "expected.csv", "elastic"),
            (axes[1], "johnson_cook", "expected_johnson_cook.csv", "elastic-plastic"),
        ):
            exact = read_table(HERE / expected)
            ax.plot(exact["time"], exact[NAME] * 1e3, color="black", linewidth=0.9, label="exact")
            for limiter, color in CURVES.items():
                run = history(urlsph, scene, limiter, Path(folder))
                ax.plot(run["time"], run[NAME] * 1e3, color=color, linewidth=1.2, label=limiter)
            ax.set_title(title, fontsize=10)
            ax.set_xlabel("time [s]")
    axes[0].set_ylabel("velocity at X = 5 m [mm/s]")
    axes[1].legend()
    save(figure, picture)


if __name__ == "__main__":
    main()
