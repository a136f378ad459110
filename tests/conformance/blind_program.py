"""A program that answers a sheet of questions, levels 1 to 9, written from the paper's equations
alone.

The lines `# ---- name` cut its text into parts: `mistakes.py` runs changed texts, and a run is
remembered as long as the head of the text and the parts that it names are as they were.
"""

import cmath
import functools
import itertools
import math
from pathlib import Path

import numpy as np
from blind_theory import harmonic_balance, hopf_point, slow_manifold
from scipy.integrate import odeint

PARAMETERS = ("r", "e", "m", "A", "B", "g", "mu", "epsilon")
HALF_PI = math.pi / 2
FAILURES = (ArithmeticError, LookupError, ValueError, np.linalg.LinAlgError)
KEPT = {}  # results of runs and their failures, by the text that they depend on
TEXT = globals().get("TEXT") or Path(__file__).read_text()
HEAD, *PIECES = TEXT.split("\n# ---- ")
PARTS = {piece.split("\n", 1)[0]: piece for piece in PIECES}


def kept(*parts):
    """Remember a function's results as long as these parts of the text stay the same."""

    def decorate(function):
        @functools.wraps(function)
        def call(*given):
            key = (function.__name__, given, HEAD, *(PARTS[part] for part in parts))
            if key not in KEPT:
                try:
                    KEPT[key] = function(*given)
                except FAILURES as failure:
                    KEPT[key] = failure
            if isinstance(KEPT[key], Exception):
                raise KEPT[key]
            return KEPT[key]

        return call

    return decorate


# ---- model
def model(o, p, Omega, smooth, beta, gamma, v):
    """Every function of the model; o is math or cmath."""
    r, e, m, A, B, g, mu, eps = p
    Bbar = B - m * e**2
    sb, cb, sg, cg = o.sin(beta), o.cos(beta), o.sin(gamma), o.cos(gamma)
    rho = r + e * sg
    inertia = A * cg**2 + Bbar * sg**2
    M = inertia + m * rho**2 * cb**2
    h1 = inertia * Omega**2 * sb * cb
    h2 = -2 * (A - Bbar) * Omega * v * cb * sg * cg
    h3 = m * rho**2 * v**2 * sb * cb
    h4 = m * e * rho * Omega**2 * sb * cb**3 * sg
    h5 = -m * e * rho * (3 * sb**2 - 2) * Omega * v * cb * cg
    h = h1 + h2 + h3 + h4 + h5
    f_G = -m * g * rho * cb
    w_y = rho * sb
    gamma_y = rho * v * sb - e * Omega * sb**2 * cg
    size = gamma_y if gamma_y.real >= 0 else -gamma_y
    lambda_Ty = -mu * m * g / eps * gamma_y
    if smooth:
        lambda_Ty = -mu * m * g * gamma_y / (size + eps)
    gamma_rate = -Omega * cb
    v_rate = (h + f_G + w_y * lambda_Ty) / M
    return M, h, f_G, w_y, gamma_y, lambda_Ty, gamma_rate, v_rate, Bbar, h1, h2, h3, h4, h5


def rates(p, Omega, smooth, y):
    f = model(math, p, Omega, smooth, *y)
    return [y[2], f[6], f[7]]


def gradient(p, Omega, smooth, y):
    """Derivatives of gamma' and v' by beta, gamma, v and Omega, with imaginary steps."""
    columns = []
    for k in range(4):
        z = [*y, Omega]
        z[k] = complex(z[k], 1e-30)
        f = model(cmath, p, z[3], smooth, *z[:3])
        columns.append((complex(f[6]).imag / 1e-30, complex(f[7]).imag / 1e-30))
    return columns


# ---- jacobian
def jacobian(p, Omega, smooth, y):
    (gb, vb), (gg, vg), (gv, vv), _ = gradient(p, Omega, smooth, y)
    return np.array([[0, 0, 1], [gb, gg, gv], [vb, vg, vv]])


# ---- integrator
def integrate(f, y0, times):
    """States at these times, the first of which is the start."""
    states, notes = odeint(
        lambda t, y: f(y.tolist()),
        y0,
        times,
        full_output=True,
        rtol=1e-13,
        atol=1e-13,
        mxstep=5000,
        tfirst=True,
    )
    if notes["message"] != "Integration successful.":
        raise ArithmeticError(notes["message"])
    return states


def crossing(f, y, width):
    """Time after the state y, and state, at which beta = pi/2 within a step of the grid."""
    rest = (HALF_PI - y[0]) / y[2]
    for _ in range(3):
        z = integrate(f, y, [0, rest])[-1]
        shift = (HALF_PI - z[0]) / z[2]
        rest = min(max(rest + shift, 0), width)
    return rest, z + shift * np.array(f(z.tolist()))


# ---- trajectories
GRID = np.round(np.arange(5001) * 2e-3, 3)


@kept("model", "integrator", "trajectories")
def run(p, Omega, smooth, start):
    """The orbit on the grid, its crossings, and the time at which it lies flat."""

    def f(y):
        return rates(p, Omega, smooth, y)

    orbit = integrate(f, list(start), GRID)
    beta = orbit[:, 0]
    outside = np.flatnonzero((beta <= 0) | (beta >= math.pi))
    flat = None
    last = len(GRID) - 1
    if len(outside):
        last = outside[0] - 1
        edge = 0 if beta[last + 1] <= 0 else math.pi
        y, rest = orbit[last], 1e-3
        for _ in range(6):
            z = integrate(f, y, [0, rest])[-1]
            rest += (edge - z[0]) / z[2]
        flat = GRID[last] + rest
    found = []
    for i in range(last):
        if GRID[i] > 0.0095 and (beta[i] - HALF_PI) * (beta[i + 1] - HALF_PI) < 0:
            rest, y = crossing(f, orbit[i], GRID[i + 1] - GRID[i])
            found.append((GRID[i] + rest, y[1], y[2]))
    return orbit, found, flat, last


# ---- cycles
@kept("model", "integrator", "cycles")
def half_cycle(p, Omega, smooth, guess):
    """Newton on the half map: half the period, the start, the map's derivative by start and
    Omega, and more.
    """

    def f(y):
        return rates(p, Omega, smooth, y)

    def variational(y):
        s = y[:3]
        (gb, vb), (gg, vg), (gv, vv), (gO, vO) = gradient(p, Omega, smooth, s)
        base = rates(p, Omega, smooth, s)
        change = []
        for k in range(3):
            b, g, v = y[3 + 3 * k : 6 + 3 * k]
            source = (gO, vO) if k == 2 else (0, 0)
            change += [
                v,
                gb * b + gg * g + gv * v + source[0],
                vb * b + vg * g + vv * v + source[1],
            ]
        return [*base, *change, vv]

    x = np.array(guess)
    for _ in range(8):
        start = [HALF_PI, HALF_PI + x[0], x[1]]
        times = np.arange(0, 12, 4e-3)
        coarse = integrate(f, start, times[:400])
        if not np.any(np.diff(np.sign(coarse[3:, 0] - HALF_PI)) > 0):
            coarse = integrate(f, start, times)
        i = np.flatnonzero(np.diff(np.sign(coarse[3:, 0] - HALF_PI)) > 0)[0] + 3
        rest, _ = crossing(f, coarse[i], 4e-3)
        half = times[i] + rest
        y = integrate(variational, [*start, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0], [0, half])[-1]
        speed = np.array(f(y[:3].tolist()))
        change = y[3:12].reshape(3, 3).T
        dtime = -change[0] / speed[0]
        by = -(change + np.outer(speed, dtime))[1:]
        step = np.linalg.solve(np.eye(2) - by[:, :2], [HALF_PI - y[1] - x[0], -y[2] - x[1]])
        x = x + step
        # The next step is its square.
        if max(abs(step)) < 1e-9:
            break
    else:
        raise ArithmeticError("no cycle")
    turn = np.flatnonzero(np.diff(np.sign(coarse[:, 2])) > 0)[0]
    low = coarse[turn].tolist()
    rest = 2e-3
    for _ in range(4):
        z = integrate(f, low, [0, rest])[-1]
        rest -= z[2] / f(z.tolist())[2]
    deepest = integrate(f, low, [0, rest])[-1][0]
    return half, x, by, dtime, y[12], deepest, coarse[turn][0]


# ---- heteroclinic
@kept("model", "jacobian", "integrator", "heteroclinic")
def connection(p, smooth):
    """The speed at which the noninverted saddle's unstable manifold runs into its copy."""

    def passes(Omega):
        values, vectors = np.linalg.eig(jacobian(p, Omega, smooth, [HALF_PI, -HALF_PI, 0.0]))
        away = vectors[:, np.argmax(values.real)].real
        start = np.array([HALF_PI, -HALF_PI, 0]) + 1e-7 * away * np.sign(away[0])
        orbit = integrate(lambda y: rates(p, Omega, smooth, y), start, np.arange(0, 10, 0.01))
        gone = np.flatnonzero((orbit[:, 1] > 3 * HALF_PI + 0.1) | (orbit[:, 0] < HALF_PI - 0.05))
        return len(gone) == 0 or orbit[gone[0], 1] > 3 * HALF_PI

    low, high = 29.8, 30.4
    # Some hundred units in the last place of 30
    while high - low > 1e-12:
        middle = (low + high) / 2
        low, high = (middle, high) if passes(middle) else (low, middle)
    return (low + high) / 2


# ---- equilibria
def spectrum(p, Omega, smooth, gamma):
    values = np.linalg.eigvals(jacobian(p, Omega, smooth, [HALF_PI, gamma, 0.0])).astype(complex)
    return sorted(values, key=lambda x: (-round(x.real, 9), -x.imag))


def equilibrium(p, row):
    gamma = HALF_PI if row["equilibrium"] == "inverted" else -HALF_PI
    found = {}
    for i, value in enumerate(spectrum(p, float(row["Omega"]), False, gamma)):
        found[f"lambda_{i + 1}_re"] = value.real
        found[f"lambda_{i + 1}_im"] = value.imag
    return found


# ---- answers
def parameters(row):
    return tuple(float(row[name]) for name in PARAMETERS)


def hopf(p, row):
    return hopf_point(p, model, jacobian)


def rhs(p, row):
    smooth = row["friction"] == "smooth"
    Omega = float(row["Omega"])
    y = [float(row[name]) for name in ("beta", "gamma", "v")]
    names = ("M", "h", "f_G", "w_y", "gamma_y", "lambda_Ty", "gamma_rate", "v_rate")
    names += ("Bbar", "h_1", "h_2", "h_3", "h_4", "h_5")
    found = dict(zip(names, model(math, p, Omega, smooth, *y), strict=True))
    J = jacobian(p, Omega, smooth, y)
    found["dv_rate_dbeta"] = J[2, 0]
    found["dv_rate_dgamma"] = J[2, 1]
    found["dv_rate_dv"] = J[2, 2]
    return found


def manifold(p, row):
    return slow_manifold(p, float(row["Omega"]), float(row["beta"]), float(row["gamma"]))


def trajectory(p, row):
    start = tuple(float(row[name]) for name in ("beta", "gamma", "v"))
    orbit, crossings, flat, last = run(p, float(row["Omega"]), row["friction"] == "smooth", start)
    found = {}
    if row["t"]:
        i = round(float(row["t"]) / 2e-3)
        if i <= last:
            found = {"beta": orbit[i, 0], "gamma": orbit[i, 1], "v": orbit[i, 2]}
    if row["n"]:
        n = int(row["n"]) - 1
        if n < len(crossings):
            time, gamma, v = crossings[n]
            found = {"crossing_time": time, "crossing_gamma": gamma, "crossing_v": v}
    if row["quantity"] == "flat_time":
        found["flat_time"] = flat
    return found


def cycle(p, row):
    Omega = float(row["Omega"])
    smooth = row["friction"] == "smooth"
    half, x, by, dtime, divergence, deepest, _ = half_cycle(
        p, Omega, smooth, GUESSES[row["id"].rsplit("/", 1)[0]]
    )
    by_x = by[:, :2]
    by_Omega = np.linalg.solve(np.eye(2) - by_x, by[:, 2])
    slow = max(abs(np.linalg.eigvals(by_x))) ** 2
    return {
        "period": 2 * half,
        "gamma_bar_0": x[0],
        "v_0": x[1],
        "beta_max": HALF_PI - deepest,
        "multiplier_slow": slow,
        "log_multiplier_slow": math.log(slow),
        "log_multiplier_fast": 2 * divergence - math.log(slow),
        "dperiod_domega": 2 * (dtime[:2] @ by_Omega + dtime[2]),
        "dgamma_bar_0_domega": by_Omega[0],
        "dv_0_domega": by_Omega[1],
    }


def heteroclinic(p, row):
    smooth = row["friction"] == "smooth"
    Omega = connection(p, smooth)
    lambda_u, lambda_s, lambda_ss = [z.real for z in spectrum(p, Omega, smooth, -HALF_PI)]
    return {"omega_h": Omega, "lambda_u": lambda_u, "lambda_s": lambda_s, "lambda_ss": lambda_ss}


def text(value):
    return repr(float(value))


def answered(rows, levels=range(1, 10)):
    """The answers of these questions, as text by id."""
    answers = {}
    for _, rows_of_one in itertools.groupby(rows, key=lambda row: row["id"].rsplit("/", 1)[0]):
        group = list(rows_of_one)
        if int(group[0]["level"]) not in levels:
            continue
        found, asked = {}, None
        for row in group:
            key = (row["t"], row["n"], row["quantity"] == "flat_time")
            if key != asked:
                try:
                    found = SOLVERS[row["kind"]](parameters(row), row)
                except FAILURES:
                    found = {}
                asked = key
            value = found.get(row["quantity"])
            if value is not None and math.isfinite(value):
                answers[row["id"]] = text(value)
    return answers


SOLVERS = {
    "rhs": rhs,
    "equilibrium": equilibrium,
    "hopf": hopf,
    "harmonic-balance": harmonic_balance,
    "slow-manifold": manifold,
    "trajectory": trajectory,
    "limit-cycle": cycle,
    "near-heteroclinic": cycle,
    "heteroclinic": heteroclinic,
}

# ---- guesses
GUESSES = {
    "table1/linear/limit-cycle/crit-0.01": (0.198959425, -0.321617357),
    "table1/linear/limit-cycle/crit-0.05": (0.450090171, -0.710773119),
    "table1/linear/limit-cycle/crit-0.1": (0.64632677, -0.989144671),
    "table1/linear/limit-cycle/crit-0.2": (0.945180362, -1.346385863),
    "table1/linear/limit-cycle/crit-0.3": (1.202951983, -1.568976637),
    "table1/linear/limit-cycle/crit-0.4": (1.45321719, -1.692163383),
    "table1/linear/limit-cycle/crit-0.5": (1.716286805, -1.710002162),
    "table1/linear/limit-cycle/crit-0.6": (2.014894083, -1.583612529),
    "table1/linear/limit-cycle/crit-0.7": (2.381373816, -1.224851616),
    "table1/smooth/limit-cycle/crit-0.01": (0.198959445, -0.321617405),
    "table1/smooth/limit-cycle/crit-0.05": (0.450092823, -0.710779163),
    "table1/smooth/limit-cycle/crit-0.1": (0.646350006, -0.989193283),
    "table1/smooth/limit-cycle/crit-0.2": (0.94540784, -1.346767409),
    "table1/smooth/limit-cycle/crit-0.3": (1.203925682, -1.570147826),
    "table1/smooth/limit-cycle/crit-0.4": (1.456301493, -1.694207962),
    "table1/smooth/limit-cycle/crit-0.5": (1.724995522, -1.710492534),
    "table1/smooth/limit-cycle/crit-0.6": (2.039354403, -1.568775618),
    "table1/smooth/limit-cycle/crit-0.7": (2.45318221, -1.13314732),
    "table1/linear/near-heteroclinic/het+1e-1": (2.544179199, -1.003866577),
    "table1/linear/near-heteroclinic/het+1e-2": (3.021003434, -0.215696055),
    "table1/linear/near-heteroclinic/het+1e-3": (3.111902477, -0.053225618),
    "table1/linear/near-heteroclinic/het+1e-4": (3.133740509, -0.014078244),
    "table1/linear/near-heteroclinic/het+1e-5": (3.139451817, -0.003838369),
    "table1/linear/near-heteroclinic/het+1e-6": (3.141000082, -0.001062438),
    "table1/smooth/near-heteroclinic/het+1e-1": (2.461769211, -1.121513058),
    "table1/smooth/near-heteroclinic/het+1e-2": (3.004024505, -0.246240715),
    "table1/smooth/near-heteroclinic/het+1e-3": (3.107880108, -0.060521383),
    "table1/smooth/near-heteroclinic/het+1e-4": (3.132691868, -0.01598116),
    "table1/smooth/near-heteroclinic/het+1e-5": (3.139168827, -0.004351947),
    "table1/smooth/near-heteroclinic/het+1e-6": (3.140922559, -0.001203142),
}
