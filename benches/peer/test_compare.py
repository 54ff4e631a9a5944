"""The comparison without its peer: references, urlsph's own side, and what is said about the peer."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import compare
import references
import smd


def case(name):
    return next(c for c in compare.CASES if c.name == name)


@pytest.mark.parametrize("name", ["twisting_gently", "bending_gently"])
def test_lower_orders_come_close_to_the_linear_reference(name):
    curve = case(name).references()[0]
    residual = compare.deviation(curve[0], case(name).compute(curve[0], across=6, along=16), curve).max()
    print(f"{name}: {residual:.1e}")
    assert residual < 1e-3


def test_uniaxial_columns_of_the_two_laws():
    tension = case("tension")
    law = references.neo_hookean(tension.material)
    times, top = references.uniaxial_column(tension.material, law, 50.0, tension.end)
    ours, peers = tension.references()
    residual = compare.deviation(times, top[:, None], ours).max()
    print(f"against the example's reference: {residual:.1e}")
    assert residual < 5e-4
    # The laws agree to first order, and differ by percents at these strains.
    between = compare.deviation(peers[0], peers[1], ours).max()
    print(f"between the laws: {between:.1e}")
    assert 0.02 < between < 0.1
    stretch = 1 + 1e-6
    stresses = [f(tension.material)(stretch) for f in (references.neo_hookean, references.logarithmic)]
    assert stresses[0] == pytest.approx(stresses[1], rel=1e-5)


def test_time_at_the_same_error():
    # The last takes longer than the second and is worse.
    peers = [(0.04, 1.0), (0.01, 4.0), (0.015, 16.0)]
    results = [compare.Result(compare.PEER[0].name, 0, error=error, cpu=(cpu,)) for error, cpu in peers]
    for error, expected in [(0.02, "4.0"), (0.04, "2.0"), (0.05, "< 2.0"), (0.005, "> 8.0")]:
        ours = compare.Result(compare.OURS.name, 0, error=error, cpu=(0.5,))
        assert compare.at_same_error(ours, [ours, *results]) == expected
        assert compare.at_same_error(ours, [ours]) == ""


def test_without_the_peer_urlsph_is_measured_alone(tmp_path):
    # Stands in the way of any LAMMPS that is installed.
    absent = tmp_path / "absent"
    absent.mkdir()
    (absent / "lammps.py").write_text('raise ImportError("no LAMMPS in this test")\n')
    paths = os.pathsep.join([str(absent), os.environ.get("PYTHONPATH", "")])
    out = tmp_path / "out"
    ran = subprocess.run(
        [sys.executable, "-B", HERE / "compare.py", "--out", out, "--repeats", "2", "--divisions", "4"],
        env=os.environ | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0, ran.stderr
    assert "peer: absent: no LAMMPS in this test" in ran.stdout
    assert "pip install -r benches/peer/requirements.txt" in ran.stdout
    report = json.loads((out / "report.json").read_text())
    assert report["peer"].startswith("absent")
    # The errors of the examples' READMEs for M1, and of the linear cases.
    most = {"twisting": 0.05, "twisting_gently": 0.07, "bending_gently": 0.008, "tension": 0.015}
    assert report["cases"].keys() == most.keys()
    for name, results in report["cases"].items():
        (result,) = results
        print(f"{name}: {result['error']:.4f}")
        assert result["setting"] == "urlsph"
        assert result["error"] < most[name]
        assert len(result["cpu"]) == 2 and min(result["cpu"]) > 0
        assert result["particles"] == 625
    assert (out / "report.md").read_text().count("| 625 | urlsph |") == len(most)
    assert (out / "report.png").stat().st_size > 10_000


def test_the_peer_where_it_is_installed(tmp_path):
    try:
        lammps, _ = smd.load()
    except smd.Absent as absence:
        pytest.skip(str(absence))
    gently = case("twisting_gently")
    settings = [compare.OURS, compare.PEER[0]]
    log = tmp_path / "lammps.log"
    (ours, peer), _ = compare.measure(gently, gently.references(), 0.25, settings, lammps, 1, log)
    assert not peer.failure
    assert (peer.particles, peer.pairs) == (ours.particles, ours.pairs)
    print(f"{peer.error:.4f}")
    assert peer.error < 0.07
    # Far too long steps are told, not measured.
    twisting = case("twisting")
    wild = compare.Setting("wild", stages=1, support=1.5, safety=1.2)
    (_, failed), _ = compare.measure(
        twisting, twisting.references(), 0.25, [compare.OURS, wild], lammps, 1, log
    )
    assert failed.failure and not failed.cpu
