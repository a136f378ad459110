"""Omega_h: proofs that must succeed, and those that must not."""

from __future__ import annotations

import json
import math
import pathlib
import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy
import pytest
from flint import arb, arb_mat, ctx

from tests.proofs.cases import carry
from tippedisk_verify.connection.heteroclinic import heteroclinic
from tippedisk_verify.errors import InputError, NoConnectionError
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED
from tippedisk_verify.proofs.kernel.balls import ball, ball_constants, positive, working_precision
from tippedisk_verify.proofs.kernel.claims import saddle as saddle_module
from tippedisk_verify.proofs.kernel.claims.connection import _slowly, connection_shown
from tippedisk_verify.proofs.kernel.claims.saddle import UNSTABLE, Saddle
from tippedisk_verify.proofs.kernel.field import field
from tippedisk_verify.proofs.kernel.flow import Model, Path
from tippedisk_verify.proofs.kernel.flow import Status as FlowStatus
from tippedisk_verify.proofs.search import heteroclinic as certified
from tippedisk_verify.proofs.search.certificate import parameter_texts
from tippedisk_verify.proofs.search.heteroclinic import ProvedConnection, Status, prove_connection, series_of_curve
from tippedisk_verify.reference_values.lookup import reference

TRUTH = {name: reference(f"{name}/linear/heteroclinic/point/omega_h").measured() for name in ("printed", "calibrated")}
DIGITS = 8
WIDTH = Fraction(1, 10**DIGITS)


@pytest.fixture(scope="module")
def proof() -> ProvedConnection:
    return prove_connection(PRINTED, TRUTH["printed"].value, DIGITS)


@pytest.mark.slow
def test_the_proof_holds_the_ordinary_roads_value(proof: ProvedConnection) -> None:
    assert proof.proved
    assert proof.unique
    assert proof.upright
    assert proof.omega_h is not None
    assert 2 * proof.omega_h.uncertainty <= WIDTH
    assert proof.omega_h.holds(TRUTH["printed"].value)
    assert "there is exactly one Omega with" in proof.statement
    assert proof.saddle_value is not None
    assert proof.saddle_value.value + proof.saddle_value.uncertainty < 0
    for mine, theirs in zip(proof.saddle_eigenvalues, ("u", "s", "ss"), strict=True):
        entry = reference(f"printed/linear/heteroclinic/point/lambda_{theirs}").measured()
        assert abs(mine.value - entry.value) <= mine.uncertainty + entry.uncertainty


def test_json_is_plain(proof: ProvedConnection) -> None:
    result = json.loads(json.dumps(proof.to_dict()))
    assert result["proved"] is True
    # The interval printed is the interval of the statement, to the last digit.
    assert proof.omega_h is not None
    assert Fraction(result["omega_h"]["value"]) == proof.omega_h.value
    assert Fraction(result["omega_h"]["uncertainty"]) == proof.omega_h.uncertainty


def test_what_follows_of_limit_cycles_names_its_space(proof: ProvedConnection) -> None:
    """With gamma a real number, and only with all hypotheses."""
    said = proof.limit_cycle
    assert said is not None
    assert said in proof.to_dict().values()
    assert "gamma in R (not modulo 2 pi)" in said
    assert "exactly one periodic orbit above Omega_h and none below it or at it" in said
    assert "asymptotically stable" in said
    unstable, slow, fast = proof.saddle_eigenvalues
    repelling = (Measured(-slow.value, slow.uncertainty), slow, fast)  # lambda_u + lambda_s = 0, to within its width
    for changed in (
        {"unique": False},
        {"slowly": False},
        {"saddle_eigenvalues": repelling},
        {"saddle_eigenvalues": (Measured(9 + unstable.value, unstable.uncertainty), slow, fast)},
        {"status": Status.SIDES},
    ):
        assert replace(proof, **changed).limit_cycle is None
    docs = pathlib.Path(__file__).parents[2] / "docs"
    pages = [path.read_text(encoding="utf-8") for path in docs.glob("certified*.md")]
    (theorem,) = (page[page.index("**Theorem 7") :] for page in pages if "**Theorem 7" in page)
    for word in ("Let gamma be a real number", "figure of eight", "simple zero", "leading direction", "Shilnikov"):
        assert word in theorem
    # Nowhere is it said without its space.
    assert "".join(pages).count("Shilnikov") == theorem.count("Shilnikov")


@pytest.mark.parametrize("below", ["0.00007", "0.009"])
def test_on_the_cylinder_there_is_another_limit_cycle(taylor: Taylor, below: str) -> None:
    """Below Omega_h, where with gamma in R there is none near the connections: gamma grows by 2 pi a period."""
    omega = round(TRUTH["printed"].value, 8) - Fraction(below)
    times = numpy.linspace(0, 20, 20_001)
    start = (Fraction("0.0376"), Fraction("-2.9713"), Fraction("0.2482"))  # on the unstable branch, next to the saddle
    run = taylor(Request(PRINTED, omega, start, 20, shifted=True, times=times))
    beta, gamma, _ = run.samples.T
    turns = numpy.searchsorted(gamma, 2 * math.pi * numpy.arange(4, 8))
    assert beta.min() > 0  # gamma only grows
    crossed = beta[turns]
    # Each is up to 1 ms late, in which beta changes by 5e-4; the orbit itself has converged to less after three turns.
    assert abs(numpy.diff(crossed)).max() < 1e-3


def test_an_orbit_that_comes_in_along_the_fast_direction_is_told() -> None:
    z = [arb(0, 1e-9), arb("0.01", 1e-9), arb("0.001", 1e-9)]
    apart = arb_mat([[6, 1, 1], [1, -8, 2], [1, 2, -100]])
    assert _slowly(apart, z)
    assert not _slowly(apart, [z[0], z[2], z[1]])
    assert not _slowly(apart, [z[0], arb(0, "0.01"), z[2]])
    near = arb_mat([[6, 1, 1], [1, -8, 2], [1, 2, -13.9]])  # the discs are [-11, -5] and [-16.9, -10.9]
    assert not _slowly(near, z)


@pytest.mark.slow
def test_arrivals_move_with_the_speed_as_enclosed() -> None:
    """The ends of I, followed by themselves: they arrive in p(I), and their difference is P G times I's length."""
    middle, half, bits = round(TRUTH["printed"].value, 8), Fraction(4, 10**7), 80

    class Noted(certified._Search):
        def arrived(self, path: Path, z: Sequence[Any], curve: Any) -> bool:
            self.time, self.box = path.time, path.box
            return super().arrived(path, z, curve)

        def apart(self, matrix: Any, by_speed: Sequence[Any], G: Sequence[Any]) -> list[Any]:
            self.G = G
            return super().apart(matrix, by_speed, G)

    disk, search = parameter_texts(PRINTED), Noted(PRINTED, middle, half, bits, Fraction(1, 64))
    with working_precision(bits):
        assert len(connection_shown(disk, "linear", (middle, half), search).pieces) > 100
        ends, theta = [], search.log["unstable"]["reach"]
        for speed in (middle - half, middle + half):
            # Followed from the same plane z_u = theta_0 of the same coordinates, by the series of the speed itself.
            saddle = Saddle(disk, "linear", ball(speed), search.log["directions"])
            curve = series_of_curve(saddle, UNSTABLE, search.order, search.values)
            defect = curve.relative_defect(theta)
            start = curve.point(theta, [arb(0, part * theta) for part in defect])
            beta, gamma, v = saddle.offset(start)
            flight = carry(Model(ball_constants(PRINTED), ball(speed)), [beta, gamma - arb.pi(), v], search.time)
            assert flight.status is FlowStatus.REACHED
            assert all(whole.contains(part.mid()) for whole, part in zip(search.box, flight.state, strict=True))
            ends.append(flight.state)
        moved = saddle.coordinates([b - a for a, b in zip(*ends, strict=True)])
        for part, enclosed in zip(moved, search.G, strict=True):
            assert enclosed.contains((part / (2 * ball(half))).mid())
        assert positive(abs(search.G[0]) - 1)


@pytest.mark.parametrize("side", [-1, pytest.param(1, marks=pytest.mark.slow)])
def test_an_interval_beside_the_truth_is_not_proved(monkeypatch, proof: ProvedConnection, side: int) -> None:
    """The interval ends a fiftieth of its length short of Omega_h: as near as that, and still no proof."""
    monkeypatch.setattr(certified, "_MOST_PASSES", 1)
    assert proof.omega_h is not None
    half = proof.omega_h.uncertainty
    found = prove_connection(PRINTED, TRUTH["printed"].value + side * half * Fraction(104, 100), DIGITS)
    assert found.status is Status.SIDES
    assert "nothing is proved" in found.statement
    assert found.omega_h is None
    assert not found.proved


@pytest.mark.slow
def test_a_speed_without_a_connection_is_said_to_be_none() -> None:
    for omega in ("29.9", "30.2"):
        found = prove_connection(PRINTED, Fraction(omega), 4)
        assert found.status is Status.NOT_NEAR
        assert not found.unique


def test_too_few_bits_end_without_a_proof(monkeypatch) -> None:
    monkeypatch.setattr(certified, "_MOST_PASSES", 1)
    monkeypatch.setattr(certified, "_GUARD_BITS", 4)
    found = prove_connection(PRINTED, TRUTH["printed"].value, DIGITS)
    assert found.status is not Status.PROVED


@pytest.mark.slow
def test_perturbed_equations_are_not_proved_about_the_true_speed(monkeypatch) -> None:
    """The field of a disk whose friction is a millionth stronger, at the saddles and on the flight."""
    changed = PRINTED.changed(mu=PRINTED.mu * (1 + Fraction(1, 10**6)))
    monkeypatch.setattr(certified, "_MOST_PASSES", 1)
    assert not prove_connection(changed, TRUTH["printed"].value, DIGITS).proved


@pytest.mark.slow
def test_other_equations_at_the_saddles_than_on_the_flight_are_not_proved(monkeypatch) -> None:
    """The local manifolds of a system whose v' is a thousandth larger: their defects know nothing, the sides do."""

    def stronger(*arguments: Any) -> Callable[..., tuple[Any, Any, Any]]:
        usual = field(*arguments)

        def rates(*state: Any) -> tuple[Any, Any, Any]:
            beta, gamma, v = usual(*state)
            return beta, gamma, v * 1.0009765625  # exact in binary

        return rates

    monkeypatch.setattr(saddle_module, "field", stronger)
    monkeypatch.setattr(certified, "_MOST_PASSES", 1)
    assert not prove_connection(PRINTED, TRUTH["printed"].value, DIGITS).proved


def test_bad_input_and_no_saddle() -> None:
    before = ctx.prec, ctx.cap
    for near, digits in ((Fraction(30), 0), (Fraction(30), certified.MOST_DIGITS + 1), (Fraction(-1), 8)):
        with pytest.raises(InputError):
            prove_connection(PRINTED, near, digits)
    with pytest.raises(NoConnectionError):
        prove_connection(PRINTED.changed(mu="0.03"), Fraction(30), 8)
    assert (ctx.prec, ctx.cap) == before


@pytest.mark.slow
@pytest.mark.parametrize("parameters", [PRINTED, CALIBRATED], ids=lambda p: p.name)
@pytest.mark.parametrize("digits", [30, 50])
def test_many_digits(parameters, digits: int) -> None:
    truth = TRUTH[parameters.name]
    found = prove_connection(parameters, truth.value, digits)
    assert found.proved
    assert found.unique
    assert found.omega_h is not None
    assert 2 * found.omega_h.uncertainty <= Fraction(1, 10**digits)
    assert found.omega_h.holds(truth.value)


@pytest.mark.slow
def test_random_disks(taylor: Taylor) -> None:
    """Random disks: proved about the ordinary road's Omega_h, and about no speed that is not it."""
    rng, proved = random.Random(3), 0
    for _ in range(10):
        ratio = Fraction(round(rng.uniform(0.88, 0.95), 4)).limit_denominator(10**4)
        values = {
            name: getattr(PRINTED, name) * Fraction(round(rng.uniform(0.9, 1.1), 4)).limit_denominator(10**4)
            for name in ("r", "e", "m", "A", "g", "mu", "epsilon")
        }
        disk = PRINTED.changed(**values, B=values["A"] * ratio, C=None)
        try:
            truth = heteroclinic(disk, taylor, digits=12).omega_h
        except NoConnectionError:
            continue
        found = prove_connection(disk, truth.value, DIGITS)
        assert found.status is Status.PROVED
        proved += 1
        half = found.omega_h.uncertainty
        offset = half * Fraction(round(10 ** rng.uniform(0.01, 4), 3)).limit_denominator(1000) * rng.choice((-1, 1))
        assert not prove_connection(disk, truth.value + offset, DIGITS).proved
    assert proved >= 5
