"""The command line from a user's view: one JSON object, one line for each mistake, whole files."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tests.command_line import answer, assert_refused, printed, rows_of

GOOD = (
    'r = "0.045"\ne = "0.0025"\nm = "0.435"\nA = "0.249e-3"\nB = "0.227e-3"\n'
    'g = "9.81"\nmu = "0.3"\nepsilon = "0.1"\n'
)


def test_scene_writes_whole_files(tmp_path: Path) -> None:
    out = tmp_path / "new" / "folder"
    assert "flat at" in printed(f"scene a --out {out}")
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


def test_integrate_prints_and_writes_a_motion(tmp_path: Path) -> None:
    asked = (
        "integrate --omega 30.4 --state pi/2,pi/2+0.4,0 --time 1,2 --events section,turn --times"
    )
    for name in ("motion.csv", "motion.png"):
        found = answer(f"{asked} 5 --out {tmp_path / name}")
    assert found["t"] == ["1", "1.25", "1.5", "1.75", "2"]
    assert [record["name"] for record in found["events"]] == ["turn", "section", "turn", "section"]
    assert {"t", "beta", "gamma", "v"} <= set(found["events"][0])
    header, first, *_ = (tmp_path / "motion.csv").read_text().splitlines()
    assert (
        header
        == "t,beta,gamma,v,beta_uncertainty,gamma_uncertainty,v_uncertainty,event,t_uncertainty"
    )
    assert (first[:17], first[-2:]) == ("1,1.5707963267948", ",,")
    rows = rows_of(tmp_path / "motion.csv")
    assert [row["event"] for row in rows] == [""] * 5 + ["turn", "section", "turn", "section"]
    assert all(row["t_uncertainty"] and 1 < float(row["t"]) < 2 for row in rows[5:])
    assert (tmp_path / "motion.png").read_bytes()[:4] == b"\x89PNG"
    (tmp_path / "times").write_text("t\n1\n1.5,0\n")
    lines = printed(f"{asked} {tmp_path / 'times'}").splitlines()
    assert [line.split(",")[0] for line in lines[-2:]] == ["  t 1", "  t 1.5"]
    for wrong in ("1", "nowhere", "2 --events flat", "2 --out x.txt", "2 --state 3.2,2,0"):
        assert_refused(f"{asked} {wrong}".split())


#: Commands that are refused, and words of the line that says why.
REFUSED = [
    ("hopf --digits 0", "a whole number from 1 to 4000, not 0"),
    ("hopf --friction smooth", "smooth"),
    ("certify check nofile.json", "nofile.json"),
    ("conformance grade names.csv", "it has 'name', 'value'"),
    ("bench --only nothing", "problem 'nothing' is not known"),
    ("bench --program no-such-program", "cannot be started"),
    ("stress --only 'no such thing'", "case 'no such thing' is not known"),
    ("reference show omega_crit", "did you mean table1/linear/hopf/point/omega_crit"),
    ("reference prove", "No such command 'prove'"),
    ("reference export nothing --out a.csv", "starts with"),
    # speeds
    ("orbit --omega 30.4 --below-crit 0.5", "--above-het and --at-fold, not with several"),
    ("orbit --above-het 0.9", "0.9"),
    ("orbit --rotating", "one of --omega, --below-crit, --below-het and --at-fold"),
    ("orbit --rotating --unstable --at-fold", "--unstable goes with"),
    ("orbit --rotating --above-het 1e-3", "do not rotate"),
    ("orbit --below-het 1e-3", "belongs to --rotating"),
    ("orbit --rotating --below-het 0.05", "rad/s below Omega_h"),
    ("branch --omegas 30.4 --paper-sets", "--paper-sets"),
    ("harmonic-balance", "give the speed with one of --omega and --below-crit"),
    ("basin --omega 30.5 --margin 1,2", "three numbers"),
    ("basin --omega 30.5 --margin 4,2,0", "between 0 and pi"),
    ("basin --omega 29 --margin 1,2,0", "fold near"),
    # the study next to Omega_h
    ("heteroclinic --near 1:2", "FIRST:LAST:COUNT"),
    ("heteroclinic --near 0:1:3", "FIRST:LAST:COUNT"),
    ("heteroclinic --near 1e-2:1e-3:0", "FIRST:LAST:COUNT"),
    ("heteroclinic --near 1e-2:x:2", "FIRST:LAST:COUNT"),
    ("heteroclinic --answers x.csv", "go with --near"),
    ("heteroclinic --out x.png", "go with --near"),
    # sweeps
    *((f"sweep hopf --out a.csv --over g={x}", "a range ") for x in ("1:2", "1:2:x", "1:2:1")),
    ("sweep hopf --out a.csv --over g=1:pi:3", "a range "),
    ("sweep hopf --out a.csv --over g=b", "'b'"),
    ("sweep orbit --out a.csv --over mu=0.3", "either omega"),
    ("sweep hopf --out a.csv --over omega=30", "cannot be swept over"),
    ("sweep orbit --out a.csv --over omega=30 --over below-crit=0.5", "either"),
    ("sweep hopf --out a.csv --over mu=1 --over mu=2", "given twice"),
    # proofs
    ("certify equilibria --omega 30 --every-speed", "--every-speed takes the place"),
    ("certify hopf --friction smooth", "smooth"),
    ("certify heteroclinic --digits 301", "300 digits"),
    ("certify heteroclinic --near -1", "between 1e-6 and 1e6"),
    ("certify heteroclinic --cycles 1", "between 0 and 1"),
    ("certify heteroclinic --cycles 0.001 --friction smooth", "linear friction law"),
    ("certify orbit --fold 1 --omega 30", "belongs to --at-fold"),
    ("certify orbit --at-fold --below-crit 1", "leave out"),
    ("certify orbit --at-fold --friction smooth", "linear"),
    ("certify orbit --rotating", "give the speed"),
    ("certify orbit --omega 30.4 --friction sticky", "sticky"),
    ("certify orbit --omega x", "x"),
    ("certify orbit --below-crit 0.5 --digits 0", "digits"),
    # bounds: one beyond what is had, or too much in all
    ("hopf --digits 4001", "from 1 to 4000"),
    ("heteroclinic --digits 1001", "to 1000 digits"),
    ("scene d --digits 13", "at most 12 digits"),
    ("slow-manifold --order 41", "between 0 and 40"),
    ("orbit --above-het 1e-30 --digits 1000", "to 1000 digits"),
    ("orbit --above-het 1e-801", "down to 1e-800"),
    ("harmonic-balance --omega 30.4 --harmonics 1025", "between 1 and 1024"),
    ("basin --omega 30 --seconds 4", "more than 4 s"),
    ("scene a --omega-h 0.05", "not positive"),
    ("basin --omega 30.4 --count 10000001", "10000000 states"),
    ("sweep hopf --over mu=0.3 --out o.csv --jobs 1000000", "--jobs must lie between"),
    ("sweep hopf --over mu=0:1:1001 --over g=9:10:1000 --out o.csv", "1000000 points"),
    ("branch --omegas 30.4,1e300", "below 1e6 rad/s"),
    # no cycle is there
    ("branch --omegas 31,31.5", "no limit cycle"),
    ("branch --omegas 29", "no limit cycle"),
    ("harmonic-balance --omega 4", "no limit cycle"),
    ("orbit --omega 29", "no limit cycle"),
    # words that do not go together, or are missing, or are nobody's
    ("equilibria --omega 30.4 --below-crit 0.5", "one of --omega and --below-crit"),
    ("verify --only ,", "no claim"),
    ("verify omega_crit", "--only"),
    ("scene", "NAME"),
    ("scene d --wrong", "--wrong"),
    ("launch", "'launch'"),
]


@pytest.mark.parametrize(("asked", "word"), REFUSED)
def test_a_refusal_names_what_is_wrong_and_writes_nothing(
    asked: str, word: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("names.csv").write_text("name,value\n1,2\n")
    line = assert_refused(shlex.split(asked))
    assert word in line
    assert len(line) < 400
    assert [path.name for path in tmp_path.iterdir()] == ["names.csv"]
