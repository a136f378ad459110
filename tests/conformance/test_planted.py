"""Planted faults of the right-hand side: most are named, none is named wrongly. `planted` has the list.

The lists of unseen programs (`faults`) hold the same of all levels.
"""

from __future__ import annotations

import math
import random

import pytest

from tests.conformance.planted import FAULTS, Fault, Program, outputs, rhs, right
from tippedisk_verify.conformance.diagnosis import Diagnosis, diagnosed
from tippedisk_verify.conformance.grading import graded
from tippedisk_verify.conformance.sheet import Answers
from tippedisk_verify.reference_values.store import Quantity, Store, stored

#: Beyond what a diagnosis knows: two numbers at once.
UNNAMED = {"h5-bracket"}


def _small_term(q: Quantity, store: Store) -> float | None:
    return right(q) * (1 + 1e-4 * math.sin(float(q.inputs["gamma"]))) if q.name == "dv_rate_dgamma" else None


def _noise(q: Quantity, store: Store) -> float | None:
    return right(q) * (1 + 1e-3 * random.Random(q.id).gauss(0, 1))


def _wandering(q: Quantity, store: Store) -> float | None:
    return right(q) + 0.01 * math.sin(float(q.name.split("#")[1])) if "crossing_time#" in q.name else None


_RHS = ("printed/both/rhs/0", "printed/linear/rhs/0")
_FLY = ("printed/linear/trajectory/d1/", "printed/linear/trajectory/e1/")
#: Looks like something that has a name, and is not.
OTHERS = (
    Fault("mu-and-g", "", rhs(Program(mu=0.31, g=9.8))),
    Fault("noise", "", outputs(_noise, *_RHS)),
    Fault("crossing-times-wander", "", outputs(_wandering, *_FLY)),
    Fault("cycles-of-noise", "", outputs(_noise, "printed/linear/limit-cycle/")),
)  # fmt: skip
#: Found by a fit alone: two terms at once, and a factor that depends on the place; and by a slip alone.
FITTED = (
    Fault("h1-and-h4", "in h has the wrong sign", rhs(Program(("h1 - h2", "-h1 - h2"), ("+ h4", "- h4")))),
    Fault("one-derivative", "times 0.0001 sin gamma", outputs(_small_term, *_RHS)),
    Fault("rho-beta", "in rho: r + e sin(beta) for", rhs(Program(("e*sg", "e*sb")))),
    Fault("squared-size", "in lambda_ty: gamma_y^2 + epsilon for", rhs(Program(("(size + eps)", "(size*size + eps)")))),
)
SAMPLE = FAULTS[::9]


def _diagnosed(fault: Fault, store: Store) -> list[Diagnosis]:
    given = {id_: ("doubles", answer) for id_, answer in fault.answers(store).items()}
    return diagnosed(graded(Answers(given), store), store)


def _judged(fault: Fault, diagnoses: list[Diagnosis]) -> str:
    """Wrong as soon as one of the diagnoses names something else."""
    assert diagnoses, f"{fault.name} changes nothing"
    named = [" or ".join(cause for _, cause in one.causes).lower() for one in diagnoses if one.causes]
    if not named:
        return "unexplained"
    return "named" if all(fault.named_by(said) for said in named) else "wrong"


def test_the_list_is_one_of_different_faults() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)


@pytest.mark.parametrize("fault", [*SAMPLE, *FITTED], ids=lambda fault: fault.name)
def test_a_planted_fault_is_named(fault: Fault) -> None:
    assert _judged(fault, _diagnosed(fault, stored())) == ("unexplained" if fault.name in UNNAMED else "named")


@pytest.mark.parametrize("fault", OTHERS, ids=lambda fault: fault.name)
def test_what_only_looks_like_a_known_mistake_stays_unexplained(fault: Fault) -> None:
    assert _judged(fault, _diagnosed(fault, stored())) == "unexplained"
