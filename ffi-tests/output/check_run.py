"""What an independent reader (meshio) makes of the folder that `urlsph run` wrote."""

import csv
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import meshio
import numpy as np


def main(folder):
    with open(folder / "history.csv") as file:
        header, *rows = csv.reader(file)
    rows = np.array(rows, dtype=float)
    history = {name: rows[:, k] for k, name in enumerate(header)}
    sets = ET.parse(folder / "fields.pvd").getroot().findall("./Collection/DataSet")
    assert len(sets) > 2, "the collection has too few files"
    for entry in sets:
        time = float(entry.get("timestep"))
        mesh = meshio.read(folder / entry.get("file"))
        data = mesh.point_data
        n = len(mesh.points)
        (cells,) = mesh.cells
        assert cells.type == "vertex" and np.array_equal(np.ravel(cells.data), np.arange(n))
        assert data["cauchy_stress"].shape == (n, 9)

        # The particle at the probe moves like the probe, of which the history tells.
        initial = mesh.points - data["displacement"]
        (particle,) = np.flatnonzero(np.abs(initial - [0, 6, 0]).max(axis=1) < 1e-9)
        (row,) = np.flatnonzero(history["time"] == time)
        for quantity in ("displacement", "velocity"):
            probe = [history[f"probe.top_centre.{quantity}[{k}]"][row] for k in (1, 2, 3)]
            residual = np.abs(data[quantity][particle] - probe).max()
            print(f"t = {time}: {quantity} of particle {particle} and probe: {residual:.1e} (tolerance 1e-12)")
            assert residual < 1e-12

        # The pressure is that of the Cauchy stress.
        stress = data["cauchy_stress"].reshape(n, 3, 3)
        scale = np.abs(stress).max() or 1.0
        residual = np.abs(np.ravel(data["pressure"]) + np.trace(stress, axis1=1, axis2=2) / 3).max()
        assert residual <= 1e-12 * scale, residual
    print("1 passed, 0 failed")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
