"""The catalogue of cases: parameter sets, speeds, starts, and strategies for random ones."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import Any

import mpmath
import numpy
from hypothesis import strategies as st

from tests.model import transcription as paper
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.exact import Exact, exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import NAMED_SETS, Parameters

#: Speeds below, between and above the two critical ones, for the three sets that describe the paper's disk [rad/s].
SPEEDS = ("29.9", "30.2", "30.4", "30.8", "31.4")
#: The paper's two initial states.
STARTS: tuple[tuple[Exact, Exact, Exact], ...] = (
    (exact("pi/2"), exact("-pi/2"), exact(2)),
    (exact("pi/2"), exact("pi/2 + 0.4"), exact(0)),
)
SETS = tuple(NAMED_SETS.values())


def decimals(low: str, high: str, places: int = 6) -> st.SearchStrategy[Fraction]:
    """Decimals with that many places between two bounds."""
    unit = 10**places
    return st.integers(int(Fraction(low) * unit), int(Fraction(high) * unit)).map(lambda n: Fraction(n, unit))


@st.composite
def physical_parameters(draw: st.DrawFn) -> Parameters:
    """Any tippedisk that can exist: random lengths, mass, inertias with B <= A, and friction over two decades."""
    r = draw(decimals("0.005", "0.5"))
    e = r * draw(decimals("0.01", "0.9"))
    m = draw(decimals("0.01", "10"))
    B = m * e**2 + m * r**2 * draw(decimals("0.05", "1"))
    A = B * draw(decimals("1", "2"))
    mu = draw(decimals("0.02", "2"))
    epsilon = draw(decimals("0.01", "1"))
    try:
        return Parameters(r=r, e=e, m=m, A=A, B=B, g=draw(decimals("1", "20")), mu=mu, epsilon=epsilon)
    except InputError as fault:  # pragma: no cover - the construction above satisfies every condition
        raise AssertionError(fault) from fault


def held(values: Iterable[Any], truths: Iterable[Any], widths: Iterable[Any]) -> bool:
    """Whether each half-width holds the truth."""
    numbers = (numpy.ravel(part) for part in (values, truths, widths))
    return all(Measured.of(value, width).holds(truth) for value, truth, width in zip(*numbers, strict=True))


#: States well inside the domain.
states = st.tuples(decimals("0.3", "2.8"), decimals("-7", "7"), decimals("-10", "10"))


def paper_rates(parameters: Parameters, omega: Fraction, state: tuple[mpmath.mpf, ...]) -> list[mpmath.mpf]:
    """The linear law's field by the tests' own transcription of the paper, in the precision mpmath is set to."""
    p = parameters
    r, e, m, A, Bbar, g, mu, epsilon, speed = (
        mpmath.mpf(value.numerator) / value.denominator
        for value in (p.r, p.e, p.m, p.A, p.Bbar, p.g, p.mu, p.epsilon, omega)
    )
    beta, gamma, v = state
    gamma_y = sum(paper.lateral_sliding_velocity(r, e, speed, beta, gamma, v))
    return list(
        paper.state_rates(
            sum(paper.mass_matrix(A, Bbar, m, r, e, beta, gamma)),
            sum(paper.gyroscopic_forces(A, Bbar, m, r, e, speed, beta, gamma, v)),
            paper.gravitational_force(m, g, r, e, beta, gamma),
            paper.force_direction(r, e, beta, gamma),
            paper.linear_friction(mu, m, g, epsilon, gamma_y),
            speed,
            beta,
            v,
        )
    )
