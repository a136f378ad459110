"""A program that answers a sheet of questions, levels 1 to 5.

Levels 1 and 2 are written from the paper's equations alone. Every derivative follows from the
equations, so a mistake in one of them shows wherever a program would have it. The other levels are
the client's (conformance/clients/client.py). `mistakes.py` runs both with changed texts.
"""

import cmath
import itertools
import math

import numpy as np
from client import harmonic_balance, hopf, slow_manifold

PARAMETERS = ("r", "e", "m", "A", "B", "g", "mu", "epsilon")
HALF_PI = math.pi / 2
FAILURES = (ArithmeticError, LookupError, ValueError, np.linalg.LinAlgError)


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


def gradient(p, Omega, smooth, y):
    """Derivatives of gamma' and v' by beta, gamma, v and Omega, with imaginary steps.

    They subtract nothing, so a step whose square is below the last bit has no error.
    """
    columns = []
    for k in range(4):
        z = [*y, Omega]
        z[k] = complex(z[k], 1e-30)
        f = model(cmath, p, z[3], smooth, *z[:3])
        columns.append((complex(f[6]).imag / 1e-30, complex(f[7]).imag / 1e-30))
    return columns


def jacobian(p, Omega, smooth, y):
    (gb, vb), (gg, vg), (gv, vv), _ = gradient(p, Omega, smooth, y)
    return np.array([[0, 0, 1], [gb, gg, gv], [vb, vg, vv]])


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


def by_client(function):
    """Return a solver that asks the client, which works on arrays of entries, for one."""

    def solve(p, row):
        inputs = {
            name: np.array([float(row[name] or "nan")]) for name in ("Omega", "beta", "gamma")
        }
        inputs["form"] = np.array([row["form"]])
        found = function(tuple(np.array([x]) for x in p), False, inputs, {"h_5"})
        return {name: value[0] for name, value in found.items()}

    return solve


SOLVERS = {
    "rhs": rhs,
    "equilibrium": equilibrium,
    "hopf": by_client(hopf),
    "harmonic-balance": by_client(harmonic_balance),
    "slow-manifold": by_client(slow_manifold),
}


def answered(rows):
    """Return the answers to these questions, as text by id."""
    answers = {}
    for _, rows_of_one in itertools.groupby(rows, key=lambda row: row["id"].rsplit("/", 1)[0]):
        entry = list(rows_of_one)
        p = tuple(float(entry[0][name]) for name in PARAMETERS)
        try:
            found = SOLVERS[entry[0]["kind"]](p, entry[0])
        except FAILURES:
            continue
        for row in entry:
            value = found.get(row["quantity"])
            if value is not None and math.isfinite(value):
                answers[row["id"]] = repr(float(value))
    return answers
