"""The command line from a user's view: one JSON object, one line for each mistake, whole files."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from tippedisk_verify.cli import main

GOOD = (
    'r = "0.045"\ne = "0.0025"\nm = "0.435"\nA = "0.249e-3"\nB = "0.227e-3"\n'
    'g = "9.81"\nmu = "0.3"\nepsilon = "0.1"\n'
)


def test_scene_writes_whole_files(tmp_path: Path, capsys) -> None:
    out = tmp_path / "new" / "folder"
    assert main(["scene", "a", "--out", str(out)]) == 0
    names = sorted(path.name for path in out.iterdir())
    assert names == [
        "scene_a_orbit_1.csv",
        "scene_a_orbit_2.csv",
        "scene_a_slow_manifold.csv",
        "scenes_2d.png",
        "scenes_2d.svg",
        "scenes_3d.png",
        "scenes_3d.svg",
    ]
    header, first, *_ = (out / "scene_a_orbit_1.csv").read_text(encoding="utf-8").splitlines()
    assert header == "t [s],beta [rad],gamma [rad],v [rad/s]"
    assert first == "0.0,1.5707963268,-1.5707963268,2.0"
    assert "flat at" in capsys.readouterr().out


def test_integrate_prints_and_writes_a_motion(tmp_path: Path, capsys) -> None:
    asked = [
        "integrate",
        "--omega",
        "30.4",
        "--state",
        "pi/2,pi/2+0.4,0",
        "--time",
        "1,2",
        "--events",
        "section,turn",
    ]
    for name in ("motion.csv", "motion.png"):
        assert main([*asked, "--times", "5", "--out", str(tmp_path / name), "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
    assert found["t"] == ["1", "1.25", "1.5", "1.75", "2"]
    assert [record["name"] for record in found["events"]] == ["turn", "section", "turn", "section"]
    assert {"t", "beta", "gamma", "v"} <= set(found["events"][0])
    header, first, *_ = (tmp_path / "motion.csv").read_text().splitlines()
    assert (
        header
        == "t,beta,gamma,v,beta_uncertainty,gamma_uncertainty,v_uncertainty,event,t_uncertainty"
    )
    assert (first[:17], first[-2:]) == ("1,1.5707963267948", ",,")
    rows = list(csv.DictReader((tmp_path / "motion.csv").read_text().splitlines()))
    assert [row["event"] for row in rows] == [""] * 5 + ["turn", "section", "turn", "section"]
    assert all(row["t_uncertainty"] and 1 < float(row["t"]) < 2 for row in rows[5:])
    assert (tmp_path / "motion.png").read_bytes()[:4] == b"\x89PNG"
    (tmp_path / "times").write_text("t\n1\n1.5,0\n")
    assert main([*asked, "--times", str(tmp_path / "times")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(",")[0] for line in lines[-2:]] == ["  t 1", "  t 1.5"]
    for wrong in (
        "--times 1",
        "--times nowhere",
        "--events flat",
        "--out x.txt",
        "--state 3.2,2,0",
    ):
        assert main([*asked, *wrong.split()]) == 2
        assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("asked", "word"),
    [
        ("hopf --digits 0", "a whole number from 1 to 4000, not 0"),
        ("orbit --omega 30.4 --below-crit 0.5", "--above-het and --at-fold, not with several"),
        ("certify check nofile.json", "nofile.json"),
        ("conformance grade names.csv", "it has 'name', 'value'"),
    ],
)
def test_a_refusal_names_what_is_wrong(
    asked: str, word: str, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("names.csv").write_text("name,value\n1,2\n")
    assert main(asked.split()) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert word in line
