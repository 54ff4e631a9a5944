"""What the quick bench of the thermo-elastic wave leaves: runs, table and report; and what is left of runs that
are given up.

    python benches/trade/check_report.py target/bench target/bench-given-up
"""

import csv
import json
import math
import sys
from pathlib import Path

from lxml import html


def read(folder):
    results = json.loads((folder / "results.json").read_text())
    with open(folder / "results.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    return results, rows, html.parse(folder / "report.html").getroot()


def check_page(page):
    """It stands by itself: no script, and nothing that is loaded from elsewhere."""
    assert not page.xpath("//script | //link | //iframe | //@onload")
    sources = page.xpath("//img/@src")
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert all(link.startswith("#") for link in page.xpath("//a/@href"))
    return len(sources)


def finished(folder):
    results, rows, page = read(folder)
    (case,) = results["cases"]
    runs = results["runs"]
    assert case["name"] == "thermo-wave" and results["format"] == 1
    assert len(rows) == len(runs) * len(case["quantities"])

    # The scene itself: second order against the exact frequency, work as counted.
    own = [run for run in runs if run["axis"] == "scene"]
    coarse, fine = (run["errors"][0] for run in own)
    order = math.log2(coarse / fine)
    print(f"order of the frequency: {order:.2f} (1.8 to 2.2)")
    assert 1.8 < order < 2.2
    for run in own:
        assert run["status"] == "ok" and run["pair_updates"] == 3 * run["steps"] * run["pairs"]
        assert run["seconds"] > 0 and run["setup_seconds"] > 0

    # Every setting was run or is the scene's own, or would make it another problem.
    seen = {(run["axis"], run["setting"]) for run in runs} | {tuple(pair) for pair in case["own"]}
    every = {(axis["name"], setting) for axis in results["axes"] for setting in axis["settings"]}
    assert every - seen == {("physics", "heat"), ("physics", "no heat")}, every - seen
    assert ["neighbours", "6 neighbours"] in case["own"]

    # A solution beyond its bound is called unstable, in the report too.
    lost = [run for run in runs if run["status"] == "unstable"]
    print(f"{len(lost)} of {len(runs)} runs unstable")
    assert lost
    text = page.text_content()
    assert all(run["reason"] in text for run in lost)
    # Of every quantity an overview, and a diagram of every axis that was run.
    assert check_page(page) == len(case["quantities"]) + len({run["axis"] for run in runs}) - 1


def given_up(folder):
    results, _, page = read(folder)
    assert all(run["status"] == "failed" for run in results["runs"])
    assert "given up after 0 s" in page.text_content()
    assert check_page(page) == 0


if __name__ == "__main__":
    finished(Path(sys.argv[1]))
    given_up(Path(sys.argv[2]))
    print("2 passed, 0 failed")
