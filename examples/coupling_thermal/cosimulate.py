"""Two-way co-simulation: a copper film under a laser pulse and the substrate that it lies on.

Both are FMUs. They meet at the bottom of the film, the interface. One communication step of length H:

1. the substrate gets the interface's temperature at the end of the step, extrapolated along a straight
   line from the film's last two; it makes the step with as many steps of its own as it needs, and has
   the mean heat flux into it;
2. the film gets that flux with the opposite sign, and makes the step.

The heat that leaves the one enters the other, whatever the error of the temperature.
"""

import argparse
import csv
import json
import time
from pathlib import Path

import numpy as np

from fmu import Fmu
from layers import Pulse, temperatures

HERE = Path(__file__).parent

# Communication step [s], about 40 stable steps of the film.
STEP = 2e-9

# Parameters of the substrate: silicon.
SUBSTRATE = {"conductivity": 148.0, "heat_capacity": 1.64e6, "thickness": 2e-4}

# What must hold; each is printed beside what it is.
BALANCE = 1e-6  # heat lost on the way, of what the laser gave
TOTAL = 1e-6  # energy of both bodies, of what the laser gave
ERROR = 0.015  # temperature against both layers as one, of its largest rise

ENERGIES = ["kinetic", "strain", "thermal", "external_work", "heat_in", "numerical_dissipation"]


def couple(film_path, substrate_path, step, end):
    """Co-simulates to `end`; the history as a dict of arrays."""
    with Fmu(film_path) as film, Fmu(substrate_path, SUBSTRATE) as substrate:
        rows = []

        def record():
            row = {"time": film.time}
            for name in ["surface", "interface"]:
                row[f"temperature.{name}"] = film.get(f"probe.{name}.temperature")
            row["displacement.surface"] = film.get_vector("probe.surface.displacement")[1]
            for name in ENERGIES:
                row[f"film.{name}"] = film.get(f"energy.{name}") / area
            row["film.heat_flow"] = film.get("boundary.y_min.heat_flow") / area
            for name in ["heat_flux", "heat_in", "heat_out", "stored"]:
                row[f"substrate.{name}"] = substrate.get(name)
            rows.append(row)

        box = json.loads((HERE / "scene.json").read_text())["geometry"]["box"]
        area = box["max"][0] * box["max"][2]
        temperature = film.get("boundary.y_min.mean_temperature")
        last = temperature
        record()
        for _ in range(round(end / step)):
            substrate.set("surface_temperature", 2 * temperature - last)
            substrate.step(step)
            film.set("boundary.y_min.heat_flux", -substrate.get("heat_flux"))
            film.step(step)
            last, temperature = temperature, film.get("boundary.y_min.mean_temperature")
            record()
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def balances(history):
    """What is lost at the interface, and the error of the energy of both bodies together [J/m^2]."""
    laser = np.array([Pulse().energy(t) for t in history["time"]])
    # By the film's own ledger, its steps and its rule of integration; by the substrate's own.
    lost = history["film.heat_in"] - laser + history["substrate.heat_in"]
    film = sum(history[f"film.{name}"] for name in ["kinetic", "strain", "thermal"])
    film = film + history["film.numerical_dissipation"] - history["film.external_work"]
    both = film - film[0] + history["substrate.stored"] + history["substrate.heat_out"]
    return laser, lost, both - laser


def picture(path, history, reference, laser, lost, total, fluence):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    t = history["time"] * 1e9
    figure, axes = plt.subplots(3, 1, figsize=(8, 10), sharex=True, layout="constrained")
    for name, exact, colour in zip(["surface", "interface"], reference, ["C3", "C0"]):
        axes[0].plot(t, exact, color=colour, lw=4, alpha=0.3, label=f"{name}, both layers as one")
        axes[0].plot(t, history[f"temperature.{name}"], color=colour, lw=1.2, label=f"{name}, two FMUs")
    axes[0].set_ylabel("temperature [K]")
    axes[0].legend(fontsize=8)
    axes[1].plot(t, laser, "k--", lw=1, label="from the laser")
    film = sum(history[f"film.{name}"] for name in ["kinetic", "strain", "thermal"])
    axes[1].stackplot(
        t, film - film[0], history["substrate.stored"], history["substrate.heat_out"],
        labels=["in the film", "in the substrate", "out of its back"], alpha=0.7,
    )
    axes[1].set_ylabel("energy per area [J/m²]")
    axes[1].legend(fontsize=8, loc="lower right")
    tiny = 1e-18
    axes[2].semilogy(t, np.abs(lost) / fluence + tiny, label="lost at the interface")
    axes[2].semilogy(t, np.abs(total) / fluence + tiny, label="error of the energy of both")
    axes[2].axhline(BALANCE, color="k", lw=0.8, ls=":", label="tolerance")
    axes[2].set_ylabel("of the energy from the laser")
    axes[2].set_xlabel("time [ns]")
    axes[2].set_ylim(1e-13, 1e-4)
    axes[2].legend(fontsize=8)
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--film", type=Path, required=True, nargs="+",
                        help="the film as FMUs: FMI 3.0 and perhaps FMI 2.0, which must agree")
    parser.add_argument("--substrate", type=Path, required=True, help="the substrate's FMU")
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    scene = json.loads((HERE / "scene.json").read_text())
    end = scene["time"]["end"]

    clock = time.monotonic()
    history = couple(arguments.film[0], arguments.substrate, STEP, end)
    print(f"{round(end / STEP)} exchanges, {time.monotonic() - clock:.1f} s")
    with open(arguments.out / "history.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(history)
        writer.writerows(zip(*(column.tolist() for column in history.values())))
    reference = temperatures(scene, SUBSTRATE, history["time"])
    laser, lost, total = balances(history)
    fluence = laser[-1]
    picture(arguments.out / "coupling.png", history, reference, laser, lost, total, fluence)

    failed = []

    def check(what, value, tolerance):
        print(f"{what}: {value:.2e}, tolerance {tolerance:g}")
        if not value <= tolerance:
            failed.append(what)

    into = history["substrate.heat_in"][-1]
    print(f"the laser gave {fluence:.1f} J/m^2, of which {into:.1f} went on into the substrate")
    check("heat lost at the interface, of the laser's", np.abs(lost).max() / fluence, BALANCE)
    check("energy balance of both bodies, of the laser's", np.abs(total).max() / fluence, TOTAL)
    for name, exact in zip(["surface", "interface"], reference):
        error = np.abs(history[f"temperature.{name}"] - exact).max() / np.ptp(exact)
        check(f"temperature of the {name}, error of its largest rise", error, ERROR)

    # The error of the coupling alone: the same film and substrate with longer exchanges.
    half = couple(arguments.film[0], arguments.substrate, STEP / 2, end)
    gaps = []
    for factor in (4, 2):
        coarse = couple(arguments.film[0], arguments.substrate, factor * STEP, end)
        fine = half["temperature.interface"][:: 2 * factor]
        gaps.append(np.abs(coarse["temperature.interface"] - fine).max())
    order = np.log2(gaps[0] / gaps[1])
    print(f"exchanges of {4 * STEP * 1e9:g} and {2 * STEP * 1e9:g} ns: {gaps[0]:.3f} and {gaps[1]:.3f} K off, "
          f"order {order:.1f}, at least 1.5")
    if order < 1.5:
        failed.append("order of the coupling")

    for other in arguments.film[1:]:
        again = couple(other, arguments.substrate, STEP, end)
        same = all(np.array_equal(history[name], again[name]) for name in history)
        print(f"{other.name}: {'the same bits' if same else 'OTHER numbers'}")
        if not same:
            failed.append(other.name)
    if failed:
        raise SystemExit("error: not as it should be: " + "; ".join(failed))
    print("the thermal coupling holds")


if __name__ == "__main__":
    main()
