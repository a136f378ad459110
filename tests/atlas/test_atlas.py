"""The atlas against single disks by other methods, against closed forms, against thirty digits; what it refuses."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import numpy
import pytest

from tippedisk_verify.atlas.connection_curve import SpecialPoint
from tippedisk_verify.atlas.fold_curves import Plane
from tippedisk_verify.atlas.plane import Atlas, Curve, CurvePoint, atlas
from tippedisk_verify.cli import main
from tippedisk_verify.connection.heteroclinic import heteroclinic
from tippedisk_verify.connection.splitting import splitting_zero
from tippedisk_verify.cycles.folds import LibrationFold, fold_to_digits, libration_folds
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import PRINTED, Parameters

# Half as rough a friction as the paper's, and nearly balanced: here the saddle value changes its sign on Omega_h.
BALANCED = PRINTED.changed(epsilon="0.3", e="0.5e-3")


@pytest.fixture(scope="module")
def by_inertia() -> Atlas:
    """From disks with hysteresis to disks without."""
    return atlas(Plane(PRINTED, "A", Fraction("0.2275e-3"), Fraction("0.2365e-3")), points=5)


@pytest.fixture(scope="module")
def by_eccentricity() -> Atlas:
    return atlas(Plane(BALANCED, "e", Fraction("0.4e-3"), Fraction("0.7e-3")), points=5)


def curve(found: Atlas, kind: str) -> Curve:
    (only,) = (one for one in found.curves if one.kind == kind)
    return only


@pytest.mark.slow
def test_folds_end_in_the_bautin_point(by_inertia: Atlas) -> None:
    (bautin,) = by_inertia.points
    r, e, _, B = (getattr(PRINTED, name) for name in ("r", "e", "A", "B"))
    closed = (B - PRINTED.m * e**2) * r * (2 * r - e) / (2 * (r + e) * (r - 2 * e))
    assert bautin.kind == "bautin"
    assert bautin.value.holds(closed)
    last, *_, first = curve(by_inertia, "fold").points
    assert first.value == by_inertia.plane.lowest
    # The law of docs/disks.md, to leading order in the last amplitude.
    assert float(closed - last.value) == pytest.approx(float(last.gamma_bar_0) ** 2 / 2798494.76137, rel=1e-2)
    assert by_inertia.missing == ()


def test_a_fold_is_that_of_its_disks_own_family(taylor: Taylor, by_inertia: Atlas) -> None:
    """Which is followed in the amplitude at one disk, and the curve in the fold from disk to disk."""
    point = curve(by_inertia, "fold").points[3]
    (fold,) = libration_folds(PRINTED.changed(A=point.value), taylor)
    assert (point.omega - fold.omega).holds(0)
    assert (point.gamma_bar_0 - fold.gamma_bar_0).holds(0)
    assert point.omega.uncertainty < point.omega.value / 10**12


def by_bisection(disk: Parameters, point: CurvePoint | SpecialPoint) -> Measured:
    """The saddle value at Omega_h by bisection, which must be the point's."""
    found = heteroclinic(disk, default_engine(), digits=6, method="bisection")
    apart = abs(point.omega.value - found.omega_h.value)
    assert apart <= found.omega_h.uncertainty + point.omega.uncertainty
    return found.saddle_value


def test_the_connection_is_that_of_bisection(by_inertia: Atlas) -> None:
    for point in curve(by_inertia, "heteroclinic").points[::2]:
        by_bisection(PRINTED.changed(A=point.value), point)
        assert point.omega.uncertainty < point.omega.value / 10**12


def test_points_are_evenly_spread_over_the_folds(by_inertia: Atlas) -> None:
    """To a quarter: even is the length along the curve, and what is measured are chords."""
    points = curve(by_inertia, "fold").points
    x, y = [by_inertia.plane.share(point.value) for point in points], [float(point.omega) for point in points]
    steps = numpy.hypot(numpy.diff(x), numpy.diff(y))
    assert len(points) == 5
    assert steps.max() < 1.25 * steps.min()


@pytest.mark.slow
def test_folds_end_where_the_saddle_value_vanishes(by_eccentricity: Atlas) -> None:
    (neutral,) = by_eccentricity.points
    assert neutral.kind == "neutral-saddle"
    # It falls by 2e3 per unit of e: half of its twelfth digit is 1e-12.
    assert abs(by_bisection(BALANCED.changed(e=neutral.value.value), neutral).value) < Fraction(1, 10**11)
    assert float(neutral.value.uncertainty) < 1e-12 * float(neutral.value)


def test_only_the_last_part_of_a_fold_curve_is_missing(by_eccentricity: Atlas) -> None:
    """Next to the neutral saddle the cycles at folds get too long for doubles. Last bits decide where that begins."""
    (neutral,) = by_eccentricity.points
    near = neutral.value.value - Fraction("0.01e-3")
    folds = [point.value for point in curve(by_eccentricity, "fold").points]
    (end,) = [one for one in by_eccentricity.missing if "followed further in double" in one.reason]
    assert all(one.kind == "fold" and near < one.value < neutral.value.value for one in by_eccentricity.missing)
    assert folds[0] == Fraction("0.4e-3")
    assert folds == sorted(folds)
    assert max(folds) <= end.value
    assert len(folds) >= 4  # of five, all but the one at the end, if that cannot be had


def test_a_connection_of_neutral_saddles_is_found(taylor: Taylor) -> None:
    """The unstable direction's series has a resonance there; a distance of 1e-16 from it leaves no digit."""
    disk = PRINTED.changed(epsilon="0.3", e="0.575279602327400e-3")
    found, other = (heteroclinic(disk, taylor, digits=6, method=name).omega_h for name in ("manifolds", "bisection"))
    assert abs(found.value - other.value) <= found.uncertainty + other.uncertainty


def test_what_is_not_known_is_said(capsys) -> None:
    """A slippery disk: where the saddles are foci, no connection is looked for."""
    assert main(["atlas", "--plane", "mu,Omega", "--range", "0.03", "0.05", "--points", "5", "--jobs", "1"]) == 0
    said = capsys.readouterr().out
    assert "heteroclinic curve" not in said
    assert "heteroclinic missing at 17 values of mu from 0.03 to 0.05: noninverted spinning is a saddle-focus" in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--plane", "A"], "plane 'A' is not known"),
        (["--plane", "Q,Omega"], "plane 'Q,Omega' is not known"),
        (["--range", "0.26e-3", "0.23e-3"], "must rise"),
        (["--range", "0.2e-3", "0.23e-3"], "B must not exceed A"),
        (["--points", "4"], "5 to 10000 points"),
        (["--friction", "smooth"], "linear friction law only"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], said: str, capsys) -> None:
    assert main(["atlas", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert said in captured.err


@pytest.mark.slow
def test_the_command_writes_what_it_prints(tmp_path: Path, capsys) -> None:
    ends = ["--range", "0.2315e-3", "0.2325e-3"]
    assert main(["atlas", *ends, "--points", "5", "--jobs", "1", "--json", "--out", str(tmp_path)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert [one["kind"] for one in result["curves"]] == ["hopf", "heteroclinic", "fold"]
    assert [one["kind"] for one in result["points"]] == ["bautin"]
    assert result["missing"] == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["atlas.csv", "atlas.json", "atlas.png", "atlas.svg"]
    assert json.loads((tmp_path / "atlas.json").read_text(encoding="utf-8")) == result
    header, *rows = (tmp_path / "atlas.csv").read_text(encoding="utf-8").splitlines()
    assert header == "kind,curve,A,A uncertainty,omega,omega uncertainty"
    assert len(rows) == 16


@pytest.mark.slow(minutes=0.6)
def test_every_point_holds_thirty_digits(taylor: Taylor) -> None:
    plane = Plane(PRINTED, "A", Fraction("0.2271e-3"), Fraction("0.26e-3"))
    found = atlas(plane, points=8)
    violations = []
    for one in found.curves:
        for point in one.points:
            disk = plane.at(point.value)
            if one.kind == "heteroclinic":
                truths = {"omega": splitting_zero(disk, point.omega.value, taylor, 30).omega_h}
            elif one.kind == "fold":
                near = float(point.gamma_bar_0), float(point.v_0), float(point.omega)
                fold = fold_to_digits(LibrationFold, disk, near, taylor, 30)
                truths = {name: getattr(fold, name) for name in ("omega", "gamma_bar_0", "v_0", "period")}
            else:
                square = (disk.r + disk.e) ** 2 * disk.m * disk.g / (disk.r * disk.Bbar)
                low, high = (point.omega.value + side * point.omega.uncertainty for side in (-1, 1))
                assert low**2 <= square <= high**2
                continue
            violations += [name for name, truth in truths.items() if not getattr(point, name).contains(truth)]
    assert violations == []
