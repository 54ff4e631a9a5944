"""Tables and pictures of `cargo xtask extremes`.

    python benches/extremes/report.py FOLDER [EXPECTED.csv]

reads FOLDER/results.json and writes results.csv, results.md, map.png and cfl.png beside it; or says which runs ended in
another way than those of EXPECTED.csv did.
"""

import csv
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))

from plotting import plt, save, style  # noqa: E402

COLOURS = {
    "runs": "#9fd4a3",
    "stops": "#f5cf7a",
    "refused": "#c9ced6",
    "slow": "#b7c7ee",
    "wrong": "#e88a86",
}
MEANING = {
    "runs": "runs to its end",
    "stops": "stops with an error that helps, at this share of the time",
    "refused": "refused before it begins",
    "slow": "given up: too many steps",
    "wrong": "wrong, or an error that does not help",
}

# In the cells of the map.
LETTERS = {
    "energy growth": "E",
    "error of the ledger": "L",
    "dissipation gives energy": "D",
    "entropy falls": "H",
    "symmetry lost": "S",
    "checkerboard": "C",
    "volume ratio": "J",
}


def grouped(rows, key):
    groups = {}
    for row in rows:
        groups.setdefault(row[key], []).append(row)
    return groups


def number(value):
    """As short as it can be."""
    if value and not 1e-3 <= abs(value) < 1e5:
        mantissa, exponent = f"{value:.0e}".split("e")
        return f"{mantissa}e{int(exponent)}"
    return f"{value:g}"


def looks_for(rows):
    """What the figures of a sweep are."""
    if rows[0]["default_cfl"] is not None:
        return "cfl"
    return "units" if rows[0]["axis"] == "factor" else "run"


def cell(row, kind):
    outcome, figure = row["outcome"], row["figure"]
    if kind == "cfl" and outcome in ("runs", "wrong"):
        return f"{figure:.2f}"
    if kind == "units" and outcome in ("runs", "wrong"):
        return number(figure)
    if outcome == "wrong":
        return " ".join(LETTERS.get(found, "!") for found in row["message"].split(", "))
    return {"runs": "", "refused": "–"}.get(outcome, f"{figure:.2f}")


def write_csv(rows, path):
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, [name for name in rows[0] if name not in ("title", "axis")],
                                extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        for row in rows:
            short = {k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()}
            writer.writerow(short)


def write_tables(rows, path):
    count = {outcome: sum(row["outcome"] == outcome for row in rows) for outcome in COLOURS}
    lines = [
        "# Results",
        "",
        "Written by `cargo xtask extremes`; `README.md` says what is looked for.",
        "",
        f"{len(rows)} runs: " + ", ".join(f"{count[o]} {o}" for o in COLOURS) + ".",
        "",
        "![Map](map.png)",
        "",
        "![Largest CFL numbers](cfl.png)",
        "",
    ]
    words = {"runs": "runs", "refused": "refused", "slow": "slow"}
    for sweep in grouped(rows, "sweep").values():
        kind = looks_for(sweep)
        values = list(dict.fromkeys(row["value"] for row in sweep))
        lines += [f"## {sweep[0]['title']} (`{sweep[0]['sweep']}`)", ""]
        lines.append(f"| {sweep[0]['axis']} | " + " | ".join(number(v) for v in values) + " |")
        lines.append("|---" * (len(values) + 1) + "|")
        notes = {}
        for series, own in grouped(sweep, "series").items():
            cells = []
            for row in own:
                text = words.get(row["outcome"], "")
                if kind == "cfl" and row["outcome"] in ("runs", "wrong"):
                    text = f"{row['figure']:.2f} ({row['default_cfl']:.2g})"
                elif kind == "units" and row["outcome"] == "runs":
                    text = number(row["figure"])
                elif row["outcome"] in ("stops", "slow"):
                    text = f"{row['outcome']} at {row['figure']:.2f}"
                elif row["outcome"] == "wrong":
                    text = "**wrong**"
                if row["message"]:
                    note = notes.setdefault(row["message"], len(notes) + 1)
                    text += f" [{note}]"
                cells.append(text)
            lines.append(f"| {series} | " + " | ".join(cells) + " |")
        lines.append("")
        lines += [f"{note}. {message}" for message, note in notes.items()]
        if notes:
            lines.append("")
    path.write_text("\n".join(lines).rstrip() + "\n")


def draw_map(rows, path):
    sweeps = list(grouped(rows, "sweep").values())
    columns = 3
    heights = [len(grouped(sweep, "series")) for sweep in sweeps]
    # Into the shortest column, in their order.
    filled, places = [0.0] * columns, []
    for height in heights:
        column = filled.index(min(filled))
        places.append((column, filled[column], height))
        filled[column] += height + 3.4
    total = max(filled)
    figure = plt.figure(figsize=(16, 0.2 * total + 1.0))
    top = 0.7 / figure.get_figheight()
    for sweep, (column, before, height) in zip(sweeps, places):
        bottom = (1 - top) * (1 - (before + 1.1 + height) / total)
        axes = figure.add_axes([0.115 + column / columns, bottom, 0.205, (1 - top) * height / total])
        kind = looks_for(sweep)
        for y, (series, own) in enumerate(grouped(sweep, "series").items()):
            for x, row in enumerate(own):
                axes.add_patch(plt.Rectangle((x, y), 0.96, 0.92, color=COLOURS[row["outcome"]]))
                axes.text(x + 0.48, y + 0.48, cell(row, kind), ha="center", va="center", fontsize=6.5)
        values = list(dict.fromkeys(row["value"] for row in sweep))
        names = list(grouped(sweep, "series"))
        axes.set(xlim=(0, len(values)), ylim=(len(names), 0))
        axes.set_xticks([x + 0.48 for x in range(len(values))], [number(v) for v in values], fontsize=7)
        axes.set_yticks([y + 0.46 for y in range(len(names))], names, fontsize=7)
        axes.tick_params(length=0)
        axes.grid(False)
        for spine in axes.spines.values():
            spine.set_visible(False)
        axes.set_title(sweep[0]["title"], fontsize=7.5, loc="left", pad=3)
        axes.set_xlabel(sweep[0]["axis"], fontsize=7, labelpad=1)
    handles = [plt.Rectangle((0, 0), 1, 1, color=c) for c in COLOURS.values()]
    figure.legend(handles, MEANING.values(), ncols=5, loc="upper center", fontsize=8)
    letters = ",  ".join(f"{letter}: {found}" for found, letter in LETTERS.items())
    figure.text(0.5, 1 - 0.42 / figure.get_figheight(), letters, ha="center", va="top", fontsize=7.5)
    save(figure, path)


def draw_cfl(rows, path):
    sweeps = [sweep for sweep in grouped(rows, "sweep").values() if looks_for(sweep) == "cfl"]
    if not sweeps:
        return
    figure, all_axes = plt.subplots(1, len(sweeps), figsize=(4 * len(sweeps), 3.4), constrained_layout=True,
                                    squeeze=False)
    for axes, sweep in zip(all_axes[0], sweeps):
        for n, (series, own) in enumerate(grouped(sweep, "series").items()):
            own = [row for row in own if row["outcome"] in ("runs", "wrong")]
            at = range(len(own))
            axes.plot(at, [row["figure"] for row in own], "o-", color=f"C{n}", markersize=4, label=series)
            axes.plot(at, [row["default_cfl"] for row in own], ":", color=f"C{n}")
        values = list(dict.fromkeys(row["value"] for row in sweep))
        axes.set_xticks(range(len(values)), [number(v) for v in values])
        axes.set(xlabel=sweep[0]["axis"], ylabel="CFL number", ylim=(0, 2.05), title=sweep[0]["title"].split(": ")[-1])
        axes.legend(fontsize=7)
    all_axes[0][0].text(0.02, 0.02, "dotted: default", transform=all_axes[0][0].transAxes, fontsize=7)
    save(figure, path)


def compare(rows, expected):
    """Ends with status 1 if a run's outcome is not the expected one."""
    with open(expected, newline="") as file:
        known = {(row["sweep"], row["series"], float(row["value"])): row["outcome"] for row in csv.DictReader(file)}
    changed = 0
    for row in rows:
        before = known.get((row["sweep"], row["series"], float(f"{row['value']:.4g}")))
        if row["outcome"] != before:
            changed += 1
            print(f"{row['sweep']}, {row['series']}, {row['value']:g}: {row['outcome']} instead of {before} {row['message']}")
    print(f"{len(rows)} runs, {changed} of them ended in another way than before: where that is meant, run `cargo xtask validate`")
    sys.exit(changed > 0)


def main(folder, expected=None):
    folder = Path(folder)
    rows = json.loads((folder / "results.json").read_text())
    if expected:
        compare(rows, expected)
    style()
    write_csv(rows, folder / "results.csv")
    write_tables(rows, folder / "results.md")
    draw_map(rows, folder / "map.png")
    draw_cfl(rows, folder / "cfl.png")


main(*sys.argv[1:])
