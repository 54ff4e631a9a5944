"""Table and report of `cargo xtask bench`: results.csv and report.html beside results.json.

    python benches/trade/report.py target/bench/results.json
"""

import base64
import csv
import io
import json
import math
import sys
from pathlib import Path

from lxml.html import builder as E
from lxml.html import tostring
from matplotlib.ticker import LogLocator, NullFormatter

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))

from plotting import plt, style  # noqa: E402

COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#8c6d31"]
MARKERS = "osD^vP*X"
OWN = "black"
FRONT = "#c00000"
AXES = [("seconds", "CPU seconds of the steps"), ("pair_updates", "pair-updates")]

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h2 { margin-top: 3rem; border-top: 1px solid #ccc; padding-top: 1rem; }
h3 { margin-top: 2rem; }
img { width: 100%; max-width: 66rem; display: block; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; margin: .5rem 0 1.5rem; }
th, td { padding: .15rem .6rem; text-align: right; border-bottom: 1px solid #e4e4e4; white-space: nowrap; }
th { border-bottom: 1px solid #888; vertical-align: bottom; }
td:first-child, th:first-child, td.text { text-align: left; }
td.text { white-space: normal; }
td.gap, th.gap { border-left: 1px solid #888; }
.within { color: #888; font-style: italic; }
.bad { color: #c00000; }
.own { font-weight: 600; }
nav a { margin-right: 1rem; }
"""


def usable(run, quantity):
    """The error of a quantity if the run is a solution, None otherwise."""
    if run["status"] != "ok":
        return None
    return run["errors"][quantity]


def number(value):
    """Three digits, as short as they get."""
    if value >= 1e5:
        mantissa, exponent = f"{value:.2e}".split("e")
        return f"{float(mantissa):g}e{int(exponent)}"
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def percent(error):
    return f"{number(100 * error)} %"


class Case:
    """A case with its runs."""

    def __init__(self, case, runs, axes):
        self.__dict__.update(case)
        self.runs = [run for run in runs if run["case"] == self.name]
        self.cells = {size["name"]: size["cells"] for size in self.sizes}
        self.own_axis = axes[0]["name"]
        self.own_setting = axes[0]["settings"][0]
        self.axes = []
        own = dict(map(tuple, self.own))
        for axis in axes[1:]:
            settings = [s for s in axis["settings"] if self.of(axis["name"], s)]
            if settings:
                self.axes.append((axis["name"], settings, own.get(axis["name"])))

    def of(self, axis, setting):
        """Runs of a setting, from coarse to fine."""
        runs = [r for r in self.runs if r["axis"] == axis and r["setting"] == setting]
        return sorted(runs, key=lambda run: self.cells[run["size"]])

    def base(self):
        return self.of(self.own_axis, self.own_setting)

    def lines(self, axis, settings, own):
        """Label, runs, colour and marker of every line of an axis, the scene's own first."""
        if axis == "CFL":
            known = [run["cfl"] for run in self.base() if run["cfl"] > 0]
            own = f"CFL {number(known[0])}" if known else None
        label = self.own_setting + (f": {own}" if own else "")
        yield label, self.base(), OWN, "o"
        for i, setting in enumerate(settings):
            yield setting, self.of(axis, setting), COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)]

    def front(self, work, quantity):
        """Runs that no other run beats in both work and error, from cheap to dear; gains below 2 % do not count."""
        found = [r for r in self.runs if usable(r, quantity) is not None and r[work] > 0]
        found.sort(key=lambda run: (run[work], run["errors"][quantity]))
        front, least = [], math.inf
        for run in found:
            if run["errors"][quantity] < 0.98 * least:
                front.append(run)
                least = run["errors"][quantity]
        return front


def ticks(axis, limits, label):
    """Decades are labelled, and 2 and 5 between them where there are few decades."""
    few = limits[1] / limits[0] < 1e3
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if few else (1,), numticks=20))
    axis.set_minor_locator(LogLocator(subs=range(1, 10), numticks=200))
    axis.set_major_formatter(label)
    axis.set_minor_formatter(NullFormatter())


def panels(case, quantity):
    """Two empty diagrams, against CPU seconds and pair-updates, with the reference's uncertainty."""
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.1), sharey=True, dpi=130, layout="constrained")
    errors = [e for run in case.runs if (e := usable(run, quantity))]
    uncertainty = case.quantities[quantity]["uncertainty"]
    bottom = 0.6 * min(errors + ([uncertainty] if uncertainty else []))
    top = 1.8 * max(errors)
    for panel, (work, label) in zip(axes, AXES):
        # All diagrams of a case have the same limits, so that one can be held against another.
        done = [run[work] for run in case.runs if usable(run, quantity)]
        limits = (0.7 * min(done), 1.4 * max(done))
        panel.set(xscale="log", yscale="log", xlabel=label, xlim=limits, ylim=(bottom, top))
        short = number if limits[1] < 1e4 else lambda x: f"{x:.0e}".replace("e+0", "e").replace("e+", "e")
        ticks(panel.xaxis, limits, lambda x, _, short=short: short(x))
        ticks(panel.yaxis, (bottom, top), lambda y, _: percent(y))
        panel.grid(which="minor", alpha=0.12)
        if uncertainty:
            panel.axhspan(bottom, uncertainty, color="0.85", zorder=0, label="uncertainty of the reference")
    axes[0].set_ylabel(f"error: {case.quantities[quantity]['name']}")
    return figure, axes, top


def points(runs, work, quantity):
    """Work and error of the runs that have both."""
    found = [run for run in runs if usable(run, quantity)]
    return [run[work] for run in found], [run["errors"][quantity] for run in found]


def lost(panel, runs, work, top, colour):
    """Unstable and failed runs as crosses on the upper edge, at the work that they had done."""
    least, most = panel.get_xlim()
    found = [min(max(run[work], least), most) for run in runs if run["status"] != "ok"]
    if found:
        panel.plot(
            found, [top] * len(found), "x", color=colour, ms=9, mew=2.2, clip_on=False, zorder=5
        )
    return bool(found)


def finish(figure, axes, any_lost):
    handles, labels = axes[0].get_legend_handles_labels()
    if any_lost:
        handles.append(plt.Line2D([], [], color="0.3", marker="x", ls="", ms=8, mew=2.2))
        labels.append("unstable or failed")
    figure.legend(handles, labels, loc="outside right center")
    file = io.BytesIO()
    figure.savefig(file, pil_kwargs={"optimize": True})
    plt.close(figure)
    return base64.b64encode(file.getvalue()).decode()


def picture(data, text):
    return E.IMG(src=f"data:image/png;base64,{data}", alt=text)


def axis_picture(case, axis, settings, own, quantity):
    figure, axes, top = panels(case, quantity)
    any_lost = False
    for panel, (work, _) in zip(axes, AXES):
        for label, runs, colour, marker in case.lines(axis, settings, own):
            panel.plot(
                *points(runs, work, quantity),
                color=colour,
                marker=marker,
                ms=5,
                lw=2.2 if colour == OWN else 1.3,
                zorder=2 if colour == OWN else 3,
                label=label,
            )
            any_lost |= lost(panel, runs, work, top, colour)
    return picture(finish(figure, axes, any_lost), f"{case.title}: {axis}")


def overview_picture(case, quantity):
    figure, axes, top = panels(case, quantity)
    any_lost = False
    for panel, (work, _) in zip(axes, AXES):
        panel.plot(*points(case.runs, work, quantity), "o", color="0.6", ms=3.5, label="all runs")
        base = points(case.base(), work, quantity)
        panel.plot(*base, "o-", color=OWN, lw=2, ms=5, label=case.own_setting)
        front = points(case.front(work, quantity), work, quantity)
        panel.step(*front, where="post", color=FRONT, lw=1.2, marker="D", ms=4, label="Pareto front")
        any_lost |= lost(panel, case.runs, work, top, "0.3")
    return picture(finish(figure, axes, any_lost), f"{case.title}: all runs")


def orders(case, runs, quantity):
    """Observed order between every size and the next one, where both are solutions."""
    for coarse, fine in zip(runs, runs[1:]):
        a, b = usable(coarse, quantity), usable(fine, quantity)
        ratio = case.cells[fine["size"]] / case.cells[coarse["size"]]
        yield math.log(a / b) / math.log(ratio) if a and b else None


def error_cell(run, quantity, uncertainty):
    if run is None:
        return E.TD("")
    if run["status"] != "ok":
        return E.TD(run["status"], E.CLASS("bad"))
    error = run["errors"][quantity]
    if error is None:
        return E.TD("–")
    return E.TD(percent(error), E.CLASS("within" if error <= uncertainty else ""))


def table(head, rows):
    parts = [E.TR(*head)] + rows
    return E.DIV(E.TABLE(*parts), E.CLASS("wide"))


def settings_table(case, axis, settings, own, quantity):
    sizes = [size["name"] for size in case.sizes]
    sizes = [s for s in sizes if any(run["size"] == s for run in case.runs)]
    uncertainty = case.quantities[quantity]["uncertainty"]
    rows = []
    for label, runs, colour, _ in case.lines(axis, settings, own):
        by_size = {run["size"]: run for run in runs}
        known = [by_size.get(size) for size in sizes]
        found = {run["size"]: o for run, o in zip(runs[1:], orders(case, runs, quantity))}
        cells = [E.TD(label, E.CLASS("own" if colour == OWN else ""))]
        cells += [error_cell(run, quantity, uncertainty) for run in known]
        for i, size in enumerate(sizes[1:]):
            order = found.get(size)
            cells.append(E.TD("" if order is None else f"{order:.2f}", E.CLASS("gap" if i == 0 else "")))
        for i, run in enumerate(known):
            text = number(run["seconds"]) if run and run["status"] != "failed" else ""
            cells.append(E.TD(text, E.CLASS("gap" if i == 0 else "")))
        rows.append(E.TR(*cells))
    head = [E.TH(axis)] + [E.TH("error", E.BR(), size) for size in sizes]
    for i, (coarse, fine) in enumerate(zip(sizes, sizes[1:])):
        head.append(E.TH("order", E.BR(), f"{coarse} to {fine}", E.CLASS("gap" if i == 0 else "")))
    for i, size in enumerate(sizes):
        head.append(E.TH("CPU s", E.BR(), size, E.CLASS("gap" if i == 0 else "")))
    return table(head, rows)


def front_table(case, quantity):
    rows = []
    for run in case.front("seconds", quantity):
        rows.append(
            E.TR(
                E.TD(run["setting"]),
                E.TD(run["size"]),
                E.TD(percent(run["errors"][quantity])),
                E.TD(number(run["seconds"])),
                E.TD(number(run["pair_updates"])),
                E.TD(str(run["steps"])),
            )
        )
    heads = ["on the front", "size", "error", "CPU s", "pair-updates", "steps"]
    return table([E.TH(h) for h in heads], rows)


def sizes_table(case):
    """What the scene's own settings cost per size, and the errors of all quantities."""
    rows = []
    for run in case.base():
        cells = [E.TD(run["size"])]
        cells += [E.TD(str(run[key])) for key in ["particles", "pairs", "steps"]]
        cells += [E.TD(number(run[key])) for key in ["pair_updates", "setup_seconds", "seconds"]]
        rate = 1e9 * run["seconds"] / run["pair_updates"] if run["pair_updates"] else 0
        cells.append(E.TD(number(rate)))
        for q, quantity in enumerate(case.quantities):
            cells.append(error_cell(run, q, quantity["uncertainty"]))
        rows.append(E.TR(*cells))
    heads = ["as the scene", "particles", "directed pairs", "steps", "pair-updates", "set-up, CPU s"]
    heads += ["steps, CPU s", "ns per pair-update"]
    heads += [f"error: {quantity['name']}" for quantity in case.quantities]
    return table([E.TH(h) for h in heads], rows)


def lost_table(case):
    rows = []
    for run in case.runs:
        if run["status"] != "ok":
            cells = [run["setting"], run["size"], run["status"], f"{number(run['time'])} s"]
            rows.append(E.TR(*[E.TD(c) for c in cells], E.TD(run["reason"], E.CLASS("text"))))
    heads = ["setting", "size", "", "reached", "reason"]
    return table([E.TH(h) for h in heads], rows) if rows else E.P("No run was unstable or failed.")


def uncertainty_text(quantity):
    if quantity["uncertainty"] == 0:
        return "the reference is exact"
    return f"uncertainty of the reference {percent(quantity['uncertainty'])}"


def section(case):
    parts = [E.H2(case.title, id=case.name)]
    parts.append(E.P(E.CODE(case.scene), f". Reference: {case.reference}."))
    for quantity in case.quantities:
        text = f": {quantity['over']}; {uncertainty_text(quantity)}."
        parts.append(E.P(E.B(quantity["name"]), text))
    parts += [E.DIV(sizes_table(case)), E.H3("All runs")]
    for q, quantity in enumerate(case.quantities):
        if any(usable(run, q) for run in case.runs):
            parts += [overview_picture(case, q), front_table(case, q)]
    for axis, settings, own in case.axes:
        parts.append(E.H3(axis[0].upper() + axis[1:]))
        if any(usable(run, 0) for run in case.runs):
            parts.append(axis_picture(case, axis, settings, own, 0))
        for q, quantity in enumerate(case.quantities):
            parts += [E.P(f"Errors of {quantity['name']}:"), settings_table(case, axis, settings, own, q)]
    parts += [E.H3("Unstable and failed runs"), lost_table(case)]
    return parts


def summary(cases):
    rows = []
    for case in cases:
        count = lambda status: sum(run["status"] == status for run in case.runs)  # noqa: E731
        finest = case.base()[-1]
        rows.append(
            E.TR(
                E.TD(E.A(case.title, href=f"#{case.name}")),
                E.TD(str(count("ok"))),
                E.TD(str(count("unstable"))),
                E.TD(str(count("failed"))),
                E.TD(finest["size"]),
                E.TD(number(finest["seconds"])),
                error_cell(finest, 0, case.quantities[0]["uncertainty"]),
                E.TD(uncertainty_text(case.quantities[0]), E.CLASS("text")),
            )
        )
    heads = ["case", "ok", "unstable", "failed", "finest as the scene", "CPU s", "error", ""]
    return table([E.TH(h) for h in heads], rows)


def html(results, cases):
    machine = results["machine"]
    where = f"{machine['cpu'] or 'a CPU of unknown name'}, {machine['cores']} cores"
    load = f"single-threaded, {machine['side_by_side']} side by side"
    intro = [
        E.H1("Speed against accuracy"),
        E.P(f"urlsph {results['urlsph']}, {where}; runs {load}{'; the quick set' if results['quick'] else ''}."),
        E.P(
            "CPU seconds are those of the steps alone; set-up stands apart. Other load on the machine lengthens "
            "them. Pair-updates, directed pairs times right-hand sides, do not depend on the machine, and do not "
            "see what a setting costs beside the pairs. Every setting is changed by itself; the rest is as in the "
            "scene. Order: of the error from one size to the next. Errors in grey italics are within the "
            "uncertainty of the reference, which is the grey band in the diagrams. The Pareto front joins the runs "
            "that no other run beats in both work and error, where gains in error below 2 % do not count; an error that crosses zero can put a run there by luck, "
            "which its neighbours in the tables show."
        ),
        summary(cases),
    ]
    body = [part for case in cases for part in section(case)]
    head = E.HEAD(
        E.META(charset="utf-8"), E.TITLE("urlsph: speed against accuracy"), E.STYLE(STYLE)
    )
    page = E.HTML(head, E.BODY(*intro, *body), lang="en")
    return tostring(page, doctype="<!doctype html>", encoding="unicode")


COLUMNS = [
    "case", "axis", "setting", "size", "cells", "status", "quantity", "error", "uncertainty", "particles", "pairs",
    "steps", "reference_updates", "pair_updates", "setup_seconds", "seconds", "time", "overrides", "reason",
]  # fmt: skip


def write_csv(path, cases):
    """A row per run and quantity."""
    with open(path, "w", newline="") as file:
        rows = csv.DictWriter(file, COLUMNS, extrasaction="ignore")
        rows.writeheader()
        for case in cases:
            for run in case.runs:
                errors = run["errors"] or [None] * len(case.quantities)
                for quantity, error in zip(case.quantities, errors):
                    row = run | {"cells": case.cells[run["size"]], "quantity": quantity["name"], "error": error}
                    row |= {"uncertainty": quantity["uncertainty"], "overrides": " ".join(run["overrides"])}
                    rows.writerow(row)


def main(path):
    results = json.loads(path.read_text())
    if results["format"] != 1:
        sys.exit(f"{path} has format {results['format']} and not 1: it was written by another version")
    style()
    cases = [Case(case, results["runs"], results["axes"]) for case in results["cases"]]
    write_csv(path.with_name("results.csv"), cases)
    report = path.with_name("report.html")
    report.write_text(html(results, cases))
    print(f"Report: {report}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
