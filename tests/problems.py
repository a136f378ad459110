"""The catalogue of cases: parameter sets, speeds, starts, and strategies for random ones."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import mpmath
import numpy
from hypothesis import strategies as st

from tests.model import transcription as paper
from tippedisk_verify import Exact, InputError, Measured, Parameters, exact, omega_crit
from tippedisk_verify.model.parameters import NAMED_SETS
from tippedisk_verify.numbers.exact import rational_in_context

#: The paper's two initial states.
STARTS: tuple[tuple[Exact, Exact, Exact], ...] = (
    (exact("pi/2"), exact("-pi/2"), exact(2)),
    (exact("pi/2"), exact("pi/2 + 0.4"), exact(0)),
)
SETS = tuple(NAMED_SETS.values())


def decimals(low: str, high: str, places: int = 6) -> st.SearchStrategy[Fraction]:
    """Decimals with that many places between two bounds."""
    unit = 10**places
    return st.integers(int(Fraction(low) * unit), int(Fraction(high) * unit)).map(
        lambda n: Fraction(n, unit)
    )


@st.composite
def physical_parameters(draw: st.DrawFn) -> Parameters:
    """Any tippedisk that can exist: random lengths, mass, inertias with B <= A, and friction
    over two decades.
    """
    r = draw(decimals("0.005", "0.5"))
    e = r * draw(decimals("0.01", "0.9"))
    m = draw(decimals("0.01", "10"))
    B = m * e**2 + m * r**2 * draw(decimals("0.05", "1"))
    A = B * draw(decimals("1", "2"))
    mu = draw(decimals("0.02", "2"))
    epsilon = draw(decimals("0.01", "1"))
    try:
        return Parameters(
            r=r, e=e, m=m, A=A, B=B, g=draw(decimals("1", "20")), mu=mu, epsilon=epsilon
        )
    # Pragma: no cover - the construction above satisfies every condition
    except InputError as fault:
        raise AssertionError(fault) from fault


def speed_below(parameters: Parameters, distance: str | Fraction) -> Fraction:
    """Omega_crit - distance, cut to 40 decimals: an exact speed."""
    return round(omega_crit(parameters, 60).value - Fraction(distance), 40)


def held(values: Iterable[Any], truths: Iterable[Any], widths: Iterable[Any]) -> bool:
    """Whether each half-width holds the truth."""
    numbers = (numpy.ravel(part) for part in (values, truths, widths))
    return all(
        Measured.of(value, width).holds(truth) for value, truth, width in zip(*numbers, strict=True)
    )


#: States well inside the domain.
states = st.tuples(decimals("0.3", "2.8"), decimals("-7", "7"), decimals("-10", "10"))


class PaperTerms(NamedTuple):
    """The quantities of Eq. 3DOF by the tests' own transcription of the paper, sums as tuples
    of their terms.
    """

    mass: tuple[Any, ...]
    gyroscopic: tuple[Any, ...]
    gravity: Any
    direction: Any
    friction: Any


def paper_terms(parameters: Parameters, omega: Any, state: Sequence[Any]) -> PaperTerms:
    """The paper's quantities at a state, under the disk's friction law, in the precision mpmath is
    set to.

    The state may be complex.
    """
    c = parameters.constants_in_context(mpmath.mp)
    r, e, m, A, Bbar = c.r, c.e, c.m, c.A, c.Bbar
    beta, gamma, v = state
    gamma_y = sum(paper.lateral_sliding_velocity(r, e, omega, beta, gamma, v))
    law = paper.linear_friction if parameters.friction == "linear" else paper.smooth_friction
    return PaperTerms(
        mass=paper.mass_matrix(A, Bbar, m, r, e, beta, gamma),
        gyroscopic=paper.gyroscopic_forces(A, Bbar, m, r, e, omega, beta, gamma, v),
        gravity=paper.gravitational_force(m, c.g, r, e, beta, gamma),
        direction=paper.force_direction(r, e, beta, gamma),
        friction=law(c.mu, m, c.g, c.epsilon, gamma_y),
    )


def paper_rates(parameters: Parameters, omega: Fraction, state: Sequence[Any]) -> list[Any]:
    """The vector field by `paper_terms`."""
    speed, (beta, _, v) = rational_in_context(mpmath.mp, omega), state
    mass, gyroscopic, *forces = paper_terms(parameters, speed, state)
    return list(paper.state_rates(sum(mass), sum(gyroscopic), *forces, speed, beta, v))
