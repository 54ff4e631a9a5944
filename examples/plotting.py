"""What the pictures of the examples share."""

import csv

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image


def style():
    """Diagrams without frames, on a faint grid."""
    plt.rcParams.update(
        {
            "font.size": 9,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.grid": True,
            "grid.alpha": 0.3,
            "legend.frameon": False,
            "lines.linewidth": 1.4,
        }
    )


def read_table(path):
    """Columns of a CSV file by name."""
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    values = np.array(rows[1:], dtype=float)
    return {name: values[:, i] for i, name in enumerate(rows[0])}


def save(figure, path):
    """Saves a figure in a small file."""
    figure.canvas.draw()
    # A palette makes the file a third as large; coverage keeps the rare ends of the colour bar.
    picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3])
    picture = picture.quantize(256, method=Image.Quantize.MAXCOVERAGE)
    picture.save(path, optimize=True)
