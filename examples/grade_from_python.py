"""An implementation of one's own, with SciPy, graded number by number."""

import math
from collections.abc import Sequence

from scipy.integrate import solve_ivp

import tippedisk_verify as tv

r, e, m, A, B, g, mu, epsilon = 0.045, 2.5e-3, 0.435, 0.249e-3, 0.227e-3, 9.81, 0.3, 0.1
Bbar = B - m * e**2
omega_crit = math.sqrt((r + e) ** 2 / r * m * g / Bbar)
omega = omega_crit - 0.5


def tippedisk(t: float, state: Sequence[float]) -> tuple[float, float, float]:
    beta, gamma, v = state
    sb, cb, sg, cg = math.sin(beta), math.cos(beta), math.sin(gamma), math.cos(gamma)
    rho = r + e * sg
    inertia = A * cg**2 + Bbar * sg**2
    mass = inertia + m * rho**2 * cb**2
    h = (
        inertia * omega**2 * sb * cb
        - 2 * (A - Bbar) * omega * v * cb * sg * cg
        + m * rho**2 * v**2 * sb * cb
    )
    h += (
        m * e * rho * omega**2 * sb * cb**3 * sg
        - m * e * rho * (3 * sb**2 - 2) * omega * v * cb * cg
    )
    sliding = rho * v * sb - e * omega * sb**2 * cg
    friction = -mu * m * g / epsilon * sliding
    return v, -omega * cb, (h - m * g * rho * cb + rho * sb * friction) / mass


def upright(t: float, state: Sequence[float]) -> float:
    return state[0] - math.pi / 2


upright.direction = -1  # type: ignore[attr-defined]  # SciPy reads it there
run = solve_ivp(
    tippedisk,
    (0, 120),
    (math.pi / 2, math.pi / 2 + 1.7, -1.7),
    "LSODA",
    events=upright,
    rtol=1e-9,
    atol=1e-10,
)
period = run.t_events[0][-1] - run.t_events[0][-2]
_, gamma, v = run.y_events[0][-1]

report = tv.grade(
    {
        "table1/linear/hopf/point/omega_crit": omega_crit,
        "table1/linear/limit-cycle/crit-0.5/period": period,
        "table1/linear/limit-cycle/crit-0.5/gamma_bar_0": gamma - math.pi / 2,
        "table1/linear/limit-cycle/crit-0.5/v_0": v,
    }
)
for grade in report.grades:
    print(f"{grade.id:52s} {grade.digits:5.1f} digits: {grade.verdict}")
assert report.passed, report

# A reference value is a number wherever Python takes one.
truth = tv.reference("table1/linear/limit-cycle/crit-0.5/period")
print(f"the period is off by {period - truth:.2g} s, and known to {float(truth.uncertainty):.1e} s")
assert math.isclose(period, truth, rel_tol=1e-7)
