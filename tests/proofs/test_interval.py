"""The limit cycles of an interval of speeds: true cycles lie in what is proved; certificates, and tampered ones."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from typing import Any

import pytest

from tests.proofs.test_arc import GUESS, OMEGA, RADIUS, cycle
from tippedisk_verify.cli import main
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.proofs.kernel import claims
from tippedisk_verify.proofs.search.interval import IntervalProof, Status, failed_interval, prove_interval
from tippedisk_verify.theory.bautin import bautin_points


@lru_cache(maxsize=1)
def proved() -> IntervalProof:
    return prove_interval(PRINTED, OMEGA, RADIUS, GUESS)


@pytest.mark.slow
def test_an_interval_of_speeds() -> None:
    proof = proved()
    assert proof.proved, proof.statement
    assert proof.claim["stable"] is True
    numbers = proof.numbers
    # dT/dOmega is about -0.79 s^2/rad: the range of the period can be no narrower, and is hardly wider.
    assert Fraction("0.78e-3") < numbers["period"].uncertainty < Fraction("0.8e-3")
    assert numbers["gamma_bar_0"].uncertainty <= Fraction("2.8e-3")


@pytest.mark.slow(minutes=0.4)
@pytest.mark.parametrize(
    "s",
    [
        pytest.param(Fraction(-1), marks=pytest.mark.slow),
        Fraction(random.Random(11).randint(-999, 999), 1000),
        pytest.param(Fraction(1), marks=pytest.mark.slow),
    ],
)
def test_true_cycles_at_speeds_of_the_interval_lie_inside(s) -> None:
    proof, truth = proved(), cycle(s).numbers()
    for name, value in proof.numbers.items():
        assert value.holds(truth[name].value), name
    for name, near in proof.claim["enclosed_within"].items():
        at_s = sum(Fraction(part) * s**k for k, part in enumerate(proof.claim["curve"][name]))
        assert abs(truth[name].value - at_s) <= Fraction(near), name
    assert truth["beta_max"].value < Fraction(proof.claim["beta_below"])


def test_what_the_proof_says() -> None:
    found = proved().to_dict()
    assert (found["proved"], found["status"], found["radius"]) == (True, "PROVED", "0.001")
    for word in ("for every Omega from", "exactly one fixed point", "asymptotically stable", PRINTED.definition()):
        assert word in found["statement"]
    assert all(
        0 < float(found["enclosed_within"][name]) <= float(found["unique_within"][name]) for name in found["curve"]
    )


@pytest.mark.slow
def test_too_wide_an_interval_is_not_proved() -> None:
    failed = prove_interval(PRINTED, OMEGA, "0.49", GUESS)
    assert failed.status in (Status.NOT_FOLLOWED, Status.NOT_INCLUDED)
    assert failed.statement.startswith("nothing is proved")


def test_bad_input() -> None:
    for radius in ("0", "-1", "31", "pi", "wide"):
        with pytest.raises(InputError):
            prove_interval(PRINTED, OMEGA, radius, GUESS)
    with pytest.raises(InputError, match="born below"):
        prove_interval(PRINTED, OMEGA, "0.5", GUESS)
    with pytest.raises(InputError, match="two components"):
        prove_interval(PRINTED, OMEGA, RADIUS, ("1",))
    with pytest.raises(InputError, match="smooth"):
        prove_interval(PRINTED.with_friction("smooth"), OMEGA, RADIUS, GUESS)


def test_where_cycles_are_born_above_omega_crit_a_range_may_hold_it() -> None:
    """Where that is not known, as at the Bautin point itself, too. The second speed is that of stable cycles."""
    for inertia, speed in ((bautin_points(PRINTED, "A")[0].value.value, "30.9"), ("0.229e-3", "30.8866")):
        failed_interval(PRINTED.changed(A=inertia), speed, "0.1")


def test_from_the_command_line(capsys, monkeypatch, tmp_path) -> None:
    monkeypatch.setattr("tippedisk_verify.proofs.search.interval.prove_interval", lambda *_: proved())
    arguments = ["certify", "orbit", "--omega", str(OMEGA), "--radius", RADIUS, "--guess", *GUESS]
    arguments[3] = "30.386592688644"
    path = str(tmp_path / "interval.json")
    assert main([*arguments, "--certificate", path]) == 0
    assert "for every Omega from" in capsys.readouterr().out
    assert main(["certify", "check", path]) == 0
    assert proved().statement in capsys.readouterr().out
    assert main([*arguments, "--rotating"]) == 2
    assert "--radius" in capsys.readouterr().err


#: of a certificate: what is done to its claim, evidence or both, and what is said
TAMPERED: dict[str, tuple[Callable[[Any, Any], Any], str]] = {
    "another speed": (lambda claim, evidence: claim.update(omega="30.3"), "other ends"),
    "another interval": (
        lambda claim, evidence: claim.update(omega="30.387", radius="0.001", low="30.386", high="30.388"), "Krawczyk"
    ),
    "no radius": (
        lambda claim, evidence: claim.update(radius="0", low=claim["omega"], high=claim["omega"]), "interval is empty"
    ),
    "further off than it is alone": (lambda claim, evidence: claim["enclosed_within"].update(v_0="1"), "the only one"),
    "a wider interval": (lambda claim, evidence: claim.update(high="30.4"), "other ends"),
    "another disk": (lambda claim, evidence: claim["parameters"].update(e="0.0026"), "Krawczyk|return|move|section"),
    "no disk": (lambda claim, evidence: claim["parameters"].update(e="0.05"), "no disk's"),
    "a smaller box": (lambda claim, evidence: claim["unique_within"].update(v_0="1e-12"), "Krawczyk"),
    "an empty box": (lambda claim, evidence: claim["unique_within"].update(v_0="0"), "empty"),
    "nearer than shown": (lambda claim, evidence: claim["enclosed_within"].update(v_0="1e-13"), "v_0 is not"),
    "another period": (lambda claim, evidence: claim["numbers"]["period"].update(value="1.094"), "period"),
    "a multiplier with too many digits": (
        lambda claim, evidence: claim["numbers"]["multiplier_slow"].update(uncertainty="1e-9"), "multiplier_slow"
    ),
    "beta too near": (lambda claim, evidence: claim.update(beta_below="0.2"), "upright"),
    "unstable": (lambda claim, evidence: claim.update(stable=False), "stability"),
    "the curve is moved": (lambda claim, evidence: _moved(claim["curve"]["gamma_bar_0"]), "Krawczyk"),
    "the degrees differ": (lambda claim, evidence: claim["curve"]["v_0"].pop(), "unlike degrees"),
    "half the period is another one": (lambda claim, evidence: evidence.update(half=["1", "0", "0", "0", "0"]),
                                       "return|move|section|enclosure"),
    "a step is missing": (lambda claim, evidence: evidence["steps"].pop(7), "return|move|section|missing"),
}  # fmt: skip


def _moved(coefficients: list[str]) -> None:
    coefficients[0] = str(Fraction(coefficients[0]) + Fraction(1, 10**6))


@pytest.mark.slow(minutes=1)
def test_a_certificate_is_accepted_and_what_is_tampered_with_is_not() -> None:
    content = json.loads(proved().certificate())
    assert claims.proved(content) == proved().statement
    for spoil, said in TAMPERED.values():
        spoiled = json.loads(json.dumps(content))
        spoil(spoiled["claim"], spoiled["evidence"])
        with pytest.raises(claims.Unproved, match="digest"):
            claims.proved(spoiled)
        spoiled["sha256"] = claims.digest(spoiled)
        with pytest.raises((claims.Unproved, claims.Refused), match=said):
            claims.proved(spoiled)
