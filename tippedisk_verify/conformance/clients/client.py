"""Answers a sheet of questions on the reduced tippedisk model with numpy and scipy.

    python client.py SHEET.csv ANSWERS.csv

Derivatives are complex-step derivatives: the model is written so that it accepts complex arguments, and the imaginary
part of f(x + 1e-100 i) / 1e-100 is f'(x) to full accuracy.  The same trick differentiates whole trajectories.
"""

import csv
import sys
from functools import lru_cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

PARAMETERS = ("r", "e", "m", "A", "B", "g", "mu", "epsilon", "Omega")
RUN = 10.0
TINY = 1e-100
QUARTER = np.pi / 2
NAMES = (
    "period",
    "gamma_bar_0",
    "v_0",
    "beta_max",
    "multiplier_slow",
    "log_multiplier_slow",
    "log_multiplier_fast",
    "dperiod_domega",
)


def model(p, smooth, beta, gamma, v):
    """All the functions of the model; p holds PARAMETERS in this order."""
    r, e, m, A, B, g, mu, eps, Omega = p
    Bbar = B - m * e**2
    sb, cb, sg, cg = np.sin(beta), np.cos(beta), np.sin(gamma), np.cos(gamma)
    rho = r + e * sg
    inertia = A * cg**2 + Bbar * sg**2
    f = {"M": inertia + m * rho**2 * cb**2}
    f["h"] = (
        inertia * Omega**2 * sb * cb
        - 2 * (A - Bbar) * Omega * v * cb * sg * cg
        + m * rho**2 * v**2 * sb * cb
        + m * e * rho * Omega**2 * sb * cb**3 * sg
        - m * e * rho * (3 * sb**2 - 2) * Omega * v * cb * cg
    )
    f["f_G"] = -m * g * rho * cb
    f["w_y"] = rho * sb
    slip = f["gamma_y"] = rho * v * sb - e * Omega * sb**2 * cg
    f["gamma_rate"] = -Omega * cb
    # |slip| by the sign of the real part, so that it stays differentiable in the complex sense
    f["lambda_Ty"] = -mu * m * g * slip / ((slip if slip.real >= 0 else -slip) + eps if smooth else eps)
    f["v_rate"] = (f["h"] + f["f_G"] + f["w_y"] * f["lambda_Ty"]) / f["M"]
    return f


def field(p, smooth):
    def rate(_, y):
        f = model(p, smooth, *y)
        return [y[2], f["gamma_rate"], f["v_rate"]]

    return rate


def jacobian(p, smooth, y):
    rate = field(p, smooth)
    return np.array([np.imag(rate(0, y + 1j * TINY * unit)) / TINY for unit in np.eye(3)]).T


LOCAL = 1e-12  # per step: a run of some thousand steps then keeps 9 digits, and no level asks doubles for more


def integrate(p, smooth, y0, time, max_step, events=()):
    return solve_ivp(
        field(p, smooth), (0, time), y0, "DOP853", rtol=LOCAL, atol=LOCAL, max_step=max_step, events=list(events)
    )


def equilibrium(p, inverted):
    y = np.array([QUARTER, QUARTER if inverted else -QUARTER, 0])
    values = np.linalg.eigvals(jacobian(p, False, y)).astype(complex)
    values = sorted(values, key=lambda x: (-round(x.real, 9), -x.imag))
    return {
        f"lambda_{i + 1}_{part}": getattr(x, name)
        for i, x in enumerate(values)
        for part, name in (("re", "real"), ("im", "imag"))
    }


@lru_cache(None)
def trajectory(p, smooth, y0):
    """The points of the solution, its crossings of beta = pi/2, and the time it falls flat (or None)."""

    def section(_, y):
        return y[0] - QUARTER

    def flat(_, y):
        return np.sin(y[0])

    flat.terminal = True
    # the steps are kept short for the interpolant, and for the kink of the smooth law
    sol = integrate(p, smooth, y0, RUN, 2e-3, (section, flat))
    crossings = []
    for t in sol.t_events[0]:
        if t < 0.01:  # the start lies on the section
            continue
        # One exact step from the last point before the crossing, and one Newton correction: the interpolant behind
        # the events is less accurate than the steps.
        y = state_at(p, smooth, sol, t)
        d = (QUARTER - y[0]) / y[2]
        crossings.append((t + d, *(y + d * np.array(field(p, smooth)(0, y)))[1:]))
    return sol, crossings, sol.t_events[1][0] if len(sol.t_events[1]) else None


def state_at(p, smooth, sol, t):
    """The state at time t, integrated from the last point before it."""
    i = max(np.searchsorted(sol.t, t) - 1, 0)
    return integrate(p, smooth, sol.y[:, i], t - sol.t[i], np.inf).y[:, -1] if t > 0 else sol.y[:, 0]


def answer_trajectory(p, smooth, row):
    sol, crossings, flat = trajectory(p, smooth, tuple(float(row[c]) for c in ("beta", "gamma", "v")))
    what = row["quantity"]
    if what == "flat_time":
        return flat
    if what.startswith("crossing_"):
        n = int(row["n"])
        return crossings[n - 1][("time", "gamma", "v").index(what[9:])] if n <= len(crossings) else None
    t = float(row["t"])
    return state_at(p, smooth, sol, t)[("beta", "gamma", "v").index(what)] if t <= sol.t[-1] else None


def half_turn(p, x):
    """From (pi/2, pi/2 + x[0], x[1]), v < 0, to the next beta = pi/2: time, state there, largest |beta - pi/2|."""

    def section(_, y):
        return y[0] - QUARTER

    section.terminal, section.direction = True, 1

    def turn(_, y):
        return y[2]

    sol = integrate(p, False, [QUARTER, QUARTER + x[0], x[1]], 5, 5e-3, (section, turn))
    if not len(sol.t_events[0]):
        raise ArithmeticError("no return")
    t, y = sol.t[-1], sol.y[:, -1]
    d = (QUARTER - y[0]) / y[2]
    y = y + d * np.array(field(p, False)(0, y))
    return t + d, y, max(abs(z[0] - QUARTER) for z in sol.y_events[1])


def half_map(p, x):
    """Half a turn and the symmetry (beta, gamma, v) -> (pi - beta, pi - gamma, -v): cycles are its fixed points."""
    y = half_turn(p, x)[1]
    return np.array([QUARTER - y[1], -y[2]])


def differentiated(p, x, time, direction):
    """Derivative by (gamma, v, Omega) along `direction`, of the arrival time and of the half map."""
    q = [*p[:-1], p[-1] + 1j * TINY * direction[2]]
    y = integrate(
        q, False, np.array([QUARTER, QUARTER + x[0], x[1]]) + 1j * TINY * np.array([0, *direction[:2]]), time, 2e-3
    ).y[:, -1]
    change = y.imag / TINY
    dtime = -change[0] / y[2].real
    change += dtime * np.real(field(p, False)(0, y.real))
    return dtime, -change[1:]


def divergence(p, x, time):
    """Integral of the divergence of the vector field, d(v_rate)/dv, over the half turn."""

    def rate(_, y):
        f = model(p, False, *y[:3])
        above, below = model(p, False, y[0], y[1], y[2] + 1), model(p, False, y[0], y[1], y[2] - 1)
        # v_rate is a polynomial of degree 2 in v, for which the central difference is exact
        return [y[2], f["gamma_rate"], f["v_rate"], (above["v_rate"] - below["v_rate"]) / 2]

    return solve_ivp(rate, (0, time), [QUARTER, QUARTER + x[0], x[1], 0], "DOP853", rtol=LOCAL, atol=LOCAL).y[3, -1]


@lru_cache(None)
def cycle(p):
    """Limit cycle of the linear law."""
    for start in (1.69, 2.5, 1.0):
        try:
            x = np.array([start, -start])
            for _ in range(6):  # the cycle attracts
                x = half_map(p, x)
            x = root(lambda z: half_map(p, z) - z, x, tol=1e-12, options={"eps": 1e-8}).x  # a start for Newton
            time = half_turn(p, x)[0]
            for _ in range(3):  # full accuracy by Newton with the exact derivative
                columns = [differentiated(p, x, time, unit) for unit in np.eye(3)]
                dtime, D = np.array([c[0] for c in columns]), np.array([c[1] for c in columns]).T
                x = x + np.linalg.solve(np.eye(2) - D[:, :2], half_map(p, x) - x)
                time, _, beta_max = half_turn(p, x)
            if x[1] < 0 and abs(x[0]) > 1e-3 and np.max(np.abs(half_map(p, x) - x)) < 1e-9:
                break
        except (ArithmeticError, ValueError):
            continue
    else:
        return {}
    slow = max(np.abs(np.linalg.eigvals(D[:, :2]))) ** 2
    by_omega = np.linalg.solve(np.eye(2) - D[:, :2], D[:, 2])
    # the fast multiplier, of the order 1e-42, follows from Liouville's formula
    log_fast = 2 * divergence(p, x, time) - np.log(slow)
    dperiod = 2 * (dtime[:2] @ by_omega + dtime[2])
    return dict(zip(NAMES, (2 * time, x[0], x[1], beta_max, slow, np.log(slow), log_fast, dperiod), strict=True))


def answer(row):
    p = tuple(float(row[c] or "nan") for c in PARAMETERS)
    smooth = row["friction"] == "smooth"
    what = row["quantity"]
    if row["kind"] == "rhs":
        y = np.array([float(row[c]) for c in ("beta", "gamma", "v")])
        if what.startswith("dv_rate_d"):
            return jacobian(p, smooth, y)[2, ("beta", "gamma", "v").index(what[9:])]
        return model(p, smooth, *y).get(what)
    if row["kind"] == "equilibrium":
        return equilibrium(p, row["equilibrium"] == "inverted").get(what)
    if row["kind"] == "trajectory":
        return answer_trajectory(p, smooth, row)
    if row["kind"] == "limit-cycle" and not smooth:
        return cycle(p).get(what)
    return None


def main():
    with open(sys.argv[1], newline="") as sheet, open(sys.argv[2], "w", newline="") as answers:
        reader = csv.DictReader(sheet)
        writer = csv.DictWriter(answers, reader.fieldnames, lineterminator="\n")
        writer.writeheader()
        for row in reader:
            value = answer(row)
            row["answer"] = ""
            if value is not None and np.isfinite(value):
                row["answer"], row["from"] = f"{value:.17g}", "doubles"
            writer.writerow(row)


main()
