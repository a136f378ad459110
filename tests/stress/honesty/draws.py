"""Random disks, speeds and states, each repeatable from a seed and an index.

Disks lie around the paper's and far from it: eccentricities from nothing to nearly the radius, inertias from equal to
far apart and on both sides of what makes the Hopf point supercritical, friction over decades. Every drawn value is a
decimal of a few digits, so that a draw can be written down.
"""

from __future__ import annotations

import math
from fractions import Fraction
from random import Random

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.exact import PI, Exact, exact
from tippedisk_verify.model.parameters import NAMED_SETS, PRINTED, Parameters
from tippedisk_verify.theory.hopf import omega_crit

__all__ = [
    "FAMILIES",
    "FAR",
    "STRUCTURED",
    "decay",
    "decimal",
    "disk",
    "generator",
    "log_uniform",
    "speed",
    "state",
    "written",
]

#: Where disks around the paper's, and extreme ones, are drawn from; `FAR` is apart.
FAMILIES = ("named", "nearby", "friction", "near-equal", "spread", "tiny-eccentricity", "heavy")
#: Disks far from the paper's in everything at once.
FAR = ("far",)
#: Those that nearly always have the paper's structure: a supercritical Hopf point and a connection below it.
STRUCTURED = ("named", "nearby", "friction")


def generator(seed: int, index: int) -> Random:
    """The random numbers of one draw: they depend on the seed and the index alone."""
    return Random(f"{seed}/{index}")


def decimal(value: float, digits: int = 6) -> Fraction:
    """``value`` as a decimal of that many significant digits, exactly."""
    return Fraction(f"{value:.{digits - 1}e}")


def log_uniform(random: Random, low: float, high: float) -> float:
    """Between two positive bounds, each decade as likely as the other."""
    return math.exp(random.uniform(math.log(low), math.log(high)))


def disk(random: Random, family: str) -> Parameters:
    """A tippedisk that can exist, of one of `FAMILIES` or of `FAR`."""
    while True:
        try:
            return _disk(random, family)
        except InputError:  # an impossible combination: draw again
            continue


def _disk(random: Random, family: str) -> Parameters:
    if family == "named":
        return NAMED_SETS[random.choice(sorted(NAMED_SETS))]
    if family == "friction":
        return PRINTED.changed(
            mu=decimal(log_uniform(random, 0.01, 3.0)), epsilon=decimal(log_uniform(random, 0.001, 3.0))
        )
    if family == "nearby":
        names = ("r", "e", "m", "A", "B", "g", "mu", "epsilon")
        return PRINTED.changed(
            **{name: decimal(float(getattr(PRINTED, name)) * random.uniform(0.9, 1.1)) for name in names}
        )
    if family == "far":
        return _far(random)
    r = decimal(log_uniform(random, 0.005, 0.5))
    share = {"tiny-eccentricity": log_uniform(random, 1e-7, 1e-2), "heavy": random.uniform(0.4, 0.95)}.get(
        family, random.uniform(0.01, 0.4)
    )
    e, m = r * decimal(share), decimal(log_uniform(random, 0.01, 10))
    B = m * e * e + m * r * r * decimal(random.uniform(0.05, 1))
    excess = log_uniform(random, 1e-9, 0.05) if family == "near-equal" else random.uniform(0, 1)
    A = B * (1 + decimal(excess))
    g, mu = decimal(random.uniform(1, 20)), decimal(log_uniform(random, 0.02, 2))
    return Parameters(r=r, e=e, m=m, A=A, B=B, g=g, mu=mu, epsilon=decimal(log_uniform(random, 0.01, 1)))


def _far(random: Random) -> Parameters:
    """Radii from 1 to 30 cm, e / r from 0.005 to 0.6, friction over decades, both kinds of Hopf point."""
    r, share = log_uniform(random, 0.01, 0.3), log_uniform(random, 0.005, 0.6)
    m, inertia = log_uniform(random, 0.01, 10), random.uniform(0.1, 0.5)  # Bbar / (m r^2); 1/4 is a thin disk's
    least = 1 + share**2 / inertia  # A = B
    # A / Bbar from which on the Hopf point is supercritical; beyond e = r/2 none is.
    bound = (2 - share) / (2 * (1 + share) * (1 - 2 * share)) if share < 0.5 else math.inf
    above = bound < math.inf and (least > bound or random.random() < 0.6)
    ratio = max(least, bound) * (1 + log_uniform(random, 1e-3, 1)) if above else random.uniform(least, min(bound, 4))
    bbar = inertia * m * r**2
    return Parameters(
        r=decimal(r),
        e=decimal(share * r),
        m=decimal(m),
        A=decimal(ratio * bbar),
        B=decimal(bbar + m * (share * r) ** 2),
        g=random.choice((decimal(9.81), decimal(9.80665), decimal(random.uniform(1, 20)))),
        mu=decimal(log_uniform(random, 0.05, 1)),
        epsilon=decimal(log_uniform(random, 1e-3, 1)),
    )


def decay(parameters: Parameters) -> float:
    """How fast sliding dies down where the disk spins inverted [1/s], and Omega_crit where that is faster."""
    p = parameters
    rate = p.mu * p.g / p.epsilon * (p.r + p.e) ** 2 * p.m / p.Bbar
    return max(float(rate), float(omega_crit(parameters)))


def speed(random: Random, parameters: Parameters) -> Fraction:
    """Omega [rad/s]: near Omega_crit, next to it, or anywhere within a factor of ten."""
    crit = float(omega_crit(parameters))
    return decimal(
        random.choice(
            (
                crit * random.uniform(0.95, 1.05),
                crit * (1 + random.choice((-1, 1)) * log_uniform(random, 1e-9, 0.1)),
                crit * log_uniform(random, 0.1, 10),
            )
        ),
        random.choice((4, 6, 12)),
    )


def state(random: Random) -> tuple[Exact, Exact, Exact]:
    """(beta, gamma, v) [rad, rad, rad/s] inside the domain, at times next to an equilibrium, as near as 1e-24."""
    kind = random.random()
    if kind < 0.3:
        away = log_uniform(random, 1e-8, 0.3) if kind < 0.2 else log_uniform(random, 1e-24, 1e-8)
        side = Fraction(random.choice((1, -1)), 2)
        beta, gamma, v = (exact(decimal(away * random.uniform(-1, 1))) for _ in range(3))
        return beta + PI * Fraction(1, 2), gamma + PI * side, v
    beta = (
        exact("pi/2") if random.random() < 0.25 else exact(decimal(random.uniform(0.1, 3.04)))
    )  # where starts often are
    return (
        beta,
        exact(decimal(random.uniform(-7, 7))),
        exact(decimal(random.uniform(-1, 1) * log_uniform(random, 0.1, 50))),
    )


def written(parameters: Parameters) -> str:
    """The set in one line: its name, or its values."""
    if parameters.name in NAMED_SETS:
        return parameters.name
    values = parameters.decimals()
    return "{" + ", ".join(f"{name} = {value}" for name, value in values.items()) + "}"
