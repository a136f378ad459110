"""The formulas of levels 3 to 5 as one writes them down, and all of them by kind of question."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache, partial
from types import SimpleNamespace
from typing import Any

from tippedisk_verify.conformance.diagnosis.arithmetic import arithmetics
from tippedisk_verify.conformance.diagnosis.slips import Names, Written
from tippedisk_verify.conformance.diagnosis.written import (
    EQUILIBRIA,
    FACTORS,
    INPUT,
    REAL,
    SINES,
    STEPS,
    TURNING,
    Formula,
    Numbers,
    Run,
    eigenvalues_of,
    given,
    set_parameters,
    states,
)
from tippedisk_verify.reference_values.store import Quantity
from tippedisk_verify.theory.jets import Jet

__all__ = ["formulas_of"]

_HIGHEST = 5  # order of the slow manifold

# ------------------------------------------------------------------------------------------ level 3
_HOPF = """\
def third(x, y, z):
    return 2 * (x * y * conj(z) + x * conj(y) * z + conj(x) * y * z)
Bbar = B - m * e**2
reach = r + e
omega_crit = sqrt(m * g * (r + e)**2 / (Bbar * r))
Omega = omega_crit
speed = Omega
Omega_of_eigenvectors = Omega = speed
root = eigenvalue(Omega)
frequency = imag(root)
period = 2 * pi / frequency
damping = mu * m * g / epsilon
A_32 = -damping * reach * e * Omega / Bbar
A_33 = -damping * reach**2 / Bbar
beta = root
gamma = Omega
v = root**2
size = sqrt(abs(beta)**2 + abs(gamma)**2 + abs(v)**2)
beta = beta / size
gamma = gamma / size
v = v / size
left = ((root - A_33) * root, A_32, root)
scale = left[0] * beta + left[1] * gamma + left[2] * v
def product(gamma_part, v_part):
    return (left[1] * gamma_part + left[2] * v_part) / scale
A_32 = A_32 / Omega * speed
Omega = speed
eigenvalue_slope = product(beta, A_32 / Omega * gamma - 2 * Omega * beta)
q = (beta, gamma, v)
beta, gamma, v = q
Omega_of_cubic_terms = Omega = speed
cubic_gamma = -Omega * third(beta, beta, beta) / 6
cubic_h = (Bbar - A) * Omega**2 * third(beta, gamma, gamma) \\
    + (2 * Bbar / 3 - m * e * reach) * Omega**2 * third(beta, beta, beta) \\
    - (2 * (A - Bbar) + m * e * reach) * Omega * third(beta, gamma, v) - m * reach**2 * third(beta, v, v)
cubic_f_G = -m * g * e / 2 * third(beta, gamma, gamma) - m * g * reach / 6 * third(beta, beta, beta)
cubic_friction = damping * (Omega * e * (4 * e + r) / 6 * third(gamma, gamma, gamma) \\
    + 3 * Omega * e * reach / 2 * third(beta, beta, gamma) + reach**2 * third(beta, beta, v) \\
    + e * reach * third(gamma, gamma, v))
restoring = m * g * reach - Bbar * Omega**2
cubic_M = (A - Bbar) * (restoring * third(beta, gamma, gamma) - damping * reach**2 * third(gamma, gamma, v) \\
    - damping * reach * e * Omega * third(gamma, gamma, gamma)) \\
    + m * reach**2 * (restoring * third(beta, beta, beta) - damping * reach**2 * third(beta, beta, v) \\
    - damping * reach * e * Omega * third(beta, beta, gamma))
cubic_v = (cubic_h + cubic_f_G + cubic_friction - cubic_M / Bbar) / Bbar
Omega = speed
beta, gamma, v = q
c_1 = product(cubic_gamma, cubic_v) / 2
first_lyapunov_coefficient = real(c_1) / frequency
transversality = real(eigenvalue_slope)
growth = transversality / real(c_1)
by_printed_law = 8 * e * Bbar * r * Omega / (reach * ((A * (r - 2 * e) \\
    - Bbar * (2 * r**2 + e * reach) / (2 * reach)) * Omega**2 + m * g * e * reach))
amplitude_squared_slope = 4 * abs(beta)**2 * growth
period_slope = -2 * pi / frequency**2 * (imag(c_1) * growth - imag(eigenvalue_slope))
answered = transversality
"""
#: The same with the symmetric form as three cubes.
_POLARISED = """\
def third(x, y, z):
    plus = (x + conj(x)) * (y + conj(y)) * (z + conj(z))
    minus = (x - conj(x)) * (y - conj(y)) * (z - conj(z))
    bar = conj(x) * conj(y) * conj(z)
    return plus - minus - 2 * bar
""" + _HOPF[_HOPF.index("Bbar") :]
_SPEEDS = tuple(
    f"Bbar = B - m * e**2\nomega_crit = {text}\n"
    for text in ("sqrt(m * g * (r + e)**2 / (Bbar * r))", "(r + e) * sqrt(m * g / (Bbar * r))")
)
_AT_HOPF = (
    (*FACTORS, "reach", "r + 2 * e", "frequency", "damping", "pi", "omega_crit", "growth", "period"),
    ("omega_crit", "30.92", "30.89", "30.9", "30.07", "30", "31"), ("frequency", "imag(eigenvalue_slope)"),
    ("sqrt(m * g * (r + e)**2 / (Bbar * r))", "30.92"), ("scale", "conj(scale)", "abs(scale)"),
    ("beta", "gamma", "v"), ("root", "conj(root)", "A_33"),
    ("c_1", "eigenvalue_slope", "conj(c_1)"),
    ("2 * pi / frequency", "2 * pi / (Omega * sqrt(e / r))", "2 * pi / (Omega * sqrt(r / (r + e)))"),
    ("transversality", *(f"real(eigenvalue(Omega + {d})) / {d}" for d in STEPS),
     *(f"-real(eigenvalue(Omega - {d})) / {d}" for d in STEPS),
     *(f"real(eigenvalue(Omega + {d}) - eigenvalue(Omega - {d})) / (2 * {d})" for d in STEPS)),
    ("real(c_1)", "imag(c_1)", "abs(c_1)"),
    ("real(eigenvalue_slope)", "imag(eigenvalue_slope)", "abs(eigenvalue_slope)"),
    ("product(beta, A_32 / Omega * gamma - 2 * Omega * beta)",
     *(f"(eigenvalue(Omega + {d}) - eigenvalue(Omega)) / {d}" for d in STEPS),
     *(f"(eigenvalue(Omega) - eigenvalue(Omega - {d})) / {d}" for d in STEPS),
     *(f"(eigenvalue(Omega + {d}) - eigenvalue(Omega - {d})) / (2 * {d})" for d in STEPS)),
    ("4 * abs(beta)**2 * growth", "by_printed_law", "4 * abs(gamma)**2 * growth", "4 * abs(v)**2 * growth"),
    ("sqrt(abs(beta)**2 + abs(gamma)**2 + abs(v)**2)", "beta", "gamma", "v", "1"),
    ("cubic_gamma", "0"), ("cubic_v", "0"), ("cubic_M", "0"),
    ("product(cubic_gamma, cubic_v)", "conj(left[1] / scale) * cubic_gamma + conj(left[2] / scale) * cubic_v"),
    ("(left[1] * gamma_part + left[2] * v_part) / scale",
     "(conj(left[1]) * gamma_part + conj(left[2]) * v_part) / conj(scale)",
     "(conj(left[1]) * gamma_part + conj(left[2]) * v_part) / scale"),
    ("((root - A_33) * root, A_32, root)", "(conj(beta), conj(gamma), conj(v))", "(beta, gamma, v)",
     "(conj((root - A_33) * root), conj(A_32), conj(root))"),
    ("q", "(q[0], q[1], 0)", "(q[0], 0, q[2])", "(0, q[1], q[2])",
     "(q[1], q[0], q[2])", "(real(q[0]), real(q[1]), real(q[2]))", "(imag(q[0]), imag(q[1]), imag(q[2]))",
     *(f"(q[0] / {by}, q[1] / {by}, q[2] / {by})" for by in ("q[0]", "q[1]", "q[2]", "abs(q[0])", "frequency"))),
    ("2 * (x * y * conj(z) + x * conj(y) * z + conj(x) * y * z)", "6 * x * y * z", "6 * abs(x) * abs(y) * abs(z)",
     "6 * x * y * conj(z)", "6 * conj(x) * y * z"),
    ("-2 * pi / frequency**2 * (imag(c_1) * growth - imag(eigenvalue_slope))",
     "-pi * Omega**2 / frequency**3 * (r - e) / (8 * reach) * -by_printed_law"
     " + 2 * pi * Omega * e / (reach * frequency**3)"),
)  # fmt: skip


def _hopf(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    names = given(here)
    p = SimpleNamespace(**names)
    bbar, reach, damping = p.B - p.m * p.e**2, p.r + p.e, p.mu * p.m * p.g / p.epsilon

    @lru_cache
    def eigenvalue(speed: float) -> complex:
        last = [p.m * p.g * reach - bbar * speed**2, -damping * reach * p.e * speed, -damping * reach**2]
        values = eigenvalues_of([[0, 0, 1], [speed, 0, 0], [x / bbar for x in last]])
        return complex(max(values, key=lambda value: value.imag))

    complexes: Names = {
        "conj": lambda z: z.conjugate(), "real": lambda z: z.real, "imag": lambda z: z.imag, "eigenvalue": eigenvalue,
    }  # fmt: skip
    found = run(REAL | names | complexes)
    names = {"transversality": "answered"}  # what else follows from it may be right
    yield {quantity.name: found[names.get(quantity.name, quantity.name)] for quantity in here}


def _speed(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    yield {"omega_crit": run(REAL | given(here))["omega_crit"]}


# ------------------------------------------------------------------------------------------ level 4
_CHI = """\
Omega = given_Omega
Bbar = B - m * e**2
omega_crit = sqrt(m * g * (r + e)**2 / (Bbar * r))
chi = A * (r - 2 * e) - Bbar * (2 * r**2 + e * (r + e)) / (2 * (r + e))
chi = chi + Bbar * e**2 / (2 * (r + e)) if consistent else chi
stiffness = r if consistent else r - e
"""
_BALANCES: tuple[str, ...] = (
    _CHI
    + """\
C = 2 * sqrt(e / (r + e)) * sqrt(-(Bbar * r * Omega**2 - m * g * (r + e)**2) / (chi * Omega**2 + m * g * e * (r + e)))
frequency = Omega * sqrt(e / (r + e) - 1 / 8 * (stiffness / (r + e)) * C**2)
period = 2 * pi / frequency
amplitude = C
""",
    _CHI
    + """\
C_squared = -4 * e / (r + e) * (Bbar * r * Omega**2 - m * g * (r + e)**2) / (chi * Omega**2 + m * g * e * (r + e))
delta = -stiffness * Omega**2 / (8 * (r + e))
frequency = sqrt(e * Omega**2 / (r + e) + delta * C_squared)
period = 2 * pi / frequency
amplitude = sqrt(C_squared)
""",
)
_BALANCES += (  # from the coefficients of the two balances
    _CHI
    + """\
square = e / (r + e) * Omega**2
kappa_1 = (Bbar - 3 * A + 2 * m * e * (r + e)) * Omega**2 / 4 - m * (r + e)**2 * square / 2 \\
    + m * g * e * Omega**2 / square / 8 - (Bbar - A) * Omega**4 / square / 4 + m * g * (r + e) / 8
C = sqrt(-(Bbar * r * Omega**2 - m * g * (r + e)**2) / (kappa_1 * (r + e) + Bbar * stiffness * Omega**2 / 8))
frequency = Omega * sqrt(e / (r + e) - 1 / 8 * (stiffness / (r + e)) * C**2)
period = 2 * pi / frequency
amplitude = C
""",
)
_BALANCES += (  # of a slip that makes C^2 negative some go on with its modulus
    _BALANCES[0].replace("* sqrt(-(Bbar", "* sqrt(abs(-(Bbar").replace("(r + e)))\nfrequency", "(r + e))))\nfrequency"),
)
_AT_BALANCE = (
    (*FACTORS, "r + 2 * e", "stiffness", "chi", "C", "omega_crit"), INPUT[0], ("chi", "1.31e-07"),
    ("A * (r - 2 * e) - Bbar * (2 * r**2 + e * (r + e)) / (2 * (r + e))", "1.31e-07"),
    ("Bbar * r * Omega**2 - m * g * (r + e)**2", "2 * Bbar * r * omega_crit * (Omega - omega_crit)"),
    ("C", "frequency * C", "Omega * C / frequency"), ("sqrt(C_squared)", "sqrt(C_squared) * Omega / frequency"),
    ("C_squared", "amplitude"), ("sqrt(C_squared)", "C_squared / 2"),
    ("2 * pi / frequency", "2 * pi / (Omega * sqrt(e / (r + e)))", "2 * pi / Omega", "2 * pi / (Omega * sqrt(e / r))",
     "2 * pi / (Omega * sqrt(e / (r + e))) * (1 + C**2 / 16)",
     "2 * pi / (Omega * sqrt(e / (r + e))) * (1 + stiffness * C**2 / (16 * e))"),
    ("Omega * sqrt(e / (r + e) - 1 / 8 * (stiffness / (r + e)) * C**2)",
     "Omega * sqrt(e / (r + e)) * (1 - stiffness / (16 * e) * C**2)"),
    ("C", "C / 2", "2 * C"), ("r - 2 * e", "r + e", "r - e"), ("frequency", "Omega", "C", "delta"),
)  # fmt: skip


def _balance(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    names = given(here)
    found = run(REAL | names | {"consistent": names["form"] == "consistent"})
    yield {quantity.name: found[quantity.name] for quantity in here}


# ------------------------------------------------------------------------------------------ level 5
_FIELD = """\
Omega = given_Omega
beta = coordinate(given_beta, 0)
gamma = coordinate(given_gamma, 1)
Bbar = B - m * e**2
rho = r + e * sin(gamma)
M = A * cos(gamma)**2 + Bbar * sin(gamma)**2 + m * rho**2 * cos(beta)**2
free = (A * cos(gamma)**2 + Bbar * sin(gamma)**2) * Omega**2 * sin(beta) * cos(beta) \\
    + m * e * rho * Omega**2 * sin(beta) * cos(beta)**3 * sin(gamma) - m * g * rho * cos(beta)
linear = -2 * (A - Bbar) * Omega * cos(beta) * sin(gamma) * cos(gamma) \\
    - m * e * rho * (3 * sin(beta)**2 - 2) * Omega * cos(beta) * cos(gamma)
quadratic = m * rho**2 * sin(beta) * cos(beta)
drag = mu * m * g * rho**2 * sin(beta)**2
h_0 = e * Omega * sin(beta) * cos(gamma) / rho
drift = Omega * cos(beta)
"""
_TURNING = "A * cos(gamma)**2 + Bbar * sin(gamma)**2"
_FIELD_SHARED = _FIELD.replace(f"M = {_TURNING}", f"inertia = {_TURNING}\nM = inertia").replace(
    f"({_TURNING})", "inertia"
)
_RECURSION = """\
h = [h_0]
for n in orders:
    change = -drift * by_gamma(h[n - 1])
    force = 0
    force += linear * h[n - 1]
    if n == 1:
        force += free
    for i in range(n):
        change += h[n - 1 - i] * by_beta(h[i])
    for i in range(n):
        force += quadratic * h[i] * h[n - 1 - i]
    h_n = (force - M * change) / drag
    h.append(h_n)
"""
#: The same with the loops over products as one.
_RECURSION_TOGETHER = _RECURSION.replace("    for i in range(n):\n        force", "        force")
_RESIDUAL = """\
residual = []
total = 0
dh_dbeta = 0
dh_dgamma = 0
for n in range(6):
    total += epsilon**n * h[n]
    dh_dbeta += epsilon**n * by_beta(h[n])
    dh_dgamma += epsilon**n * by_gamma(h[n])
    force = free + linear * total + quadratic * total**2
    residual_n = epsilon * (dh_dbeta * total - drift * dh_dgamma) - (epsilon * force - drag * (total - h_0)) / M
    residual.append(residual_n)
"""
#: The same with both derivatives as a pair.
_RESIDUAL_TOGETHER = """\
residual = []
total = 0
gradients = 0
for n in range(6):
    total += epsilon**n * h[n]
    gradients += epsilon**n * gradient_of(h[n])
    gradient = gradients
    force = free + linear * total + quadratic * total**2
    rate = (epsilon * force - drag * (total - h_0)) / M
    residual_n = epsilon * (real(gradient) * total - drift * imag(gradient)) - rate
    residual.append(residual_n)
"""
_AT_MANIFOLD = (
    FACTORS, SINES, *INPUT, TURNING, ("beta", "gamma"), ("h_0", "h[0]", "h[n]", "total"),
    ("free", "linear", "quadratic", "drag"),
    ("by_beta", "by_gamma"), ("M", "Bbar", "A", "1"), ("dh_dbeta", "dh_dgamma"),
    ("n == 1", "n >= 1", "n == 0", "n == 2"), ("h[n - 1]", "h[0]"), ("h[n - 1 - i]", "h[i]"),
    ("gradients", "gradient_of(h[0])", "gradient_of(h[n])"),
    ("epsilon * force", "epsilon * free + linear * total + quadratic * total**2"),
    ("n", "i"), ("total", "h[n]"), ("epsilon**n", "epsilon**(n + 1)", "epsilon"),
    ("range(n)", "range(n - 1)", "range(1, n)", "range(1)", "range(n // 2)", "range((n + 1) // 2)", "(0, n - 1)"),
    ("h[n - 1 - i] * by_beta(h[i])", "h[i] * by_beta(h[n - 1 - i])", "h[n - 1] * by_beta(h[n - 1]) / n"),
    ("quadratic * h[i] * h[n - 1 - i]", "quadratic * h[n - 1]**2 / n", "quadratic * h[0] * h[n - 1] / n"),
    *((name, f"value_of({name})") for name in ("M", "drag", "linear", "quadratic", "drift")),
)  # fmt: skip


@lru_cache(maxsize=256)
def _coordinate(degree: int, angle: float, axis: int) -> Jet:
    """beta (axis 0) or gamma (1) as a jet."""
    jet = Jet.constant(angle, degree)
    jet.c[1 - axis][axis] = 1.0
    return jet


@lru_cache(maxsize=256)
def _sine(angle: Any, quarters: int = 0) -> Any:
    """The sine of a number or a jet plus so many right angles."""
    jet = angle if isinstance(angle, Jet) else Jet.constant(angle, 0)
    sine, cosine = math.sin(jet.value), math.cos(jet.value)
    cycle, move = (sine, cosine, -sine, -cosine), jet - jet.value
    total, power = Jet.constant(0.0, jet.degree), Jet.constant(1.0, jet.degree)
    for order in range(jet.degree + 1):
        total, power = total + power * (cycle[(order + quarters) % 4] / math.factorial(order)), power * move
    return total if isinstance(angle, Jet) else total.value


_JETS: Names = REAL | {
    "sin": _sine, "cos": partial(_sine, quarters=1), "by_beta": Jet.by_beta, "by_gamma": Jet.by_gamma,
    "value_of": lambda jet: jet.value, "gradient_of": lambda jet: complex(jet.c[1][0], jet.c[0][1]),
    "real": lambda z: z.real, "imag": lambda z: z.imag,
}  # fmt: skip
_RESIDUALS = Written(_RESIDUAL, ())


def _series(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    """The orders, low ones first, and residuals of the same terms, of right ones, or with gamma' alone right."""
    names, found = given(here), {}
    for highest in (1, 2, 3, _HIGHEST):
        degree = highest + (highest == _HIGHEST)
        jets = {"coordinate": partial(_coordinate, degree), "orders": range(1, highest + 1), "degree": degree}
        found = run(_JETS | names | jets)
        yield {f"h_{n}": order.value for n, order in enumerate(found["h"])}
    right = _terms(here[0].set, *(names[name] for name in ("Omega", "beta", "gamma")))
    alike = {name: getattr(found[name], "value", found[name]) for name in right if name != "h"}
    each = [
        _residuals(_RESIDUALS.run, _JETS | names | terms | {"h": [order.cut(1) for order in found["h"]]})
        for terms in (alike, right, alike | {"drift": right["drift"]})
    ]
    yield {name: tuple(one[name] for one in each) for name in each[0]}


def _residuals(run: Run, names: Names) -> Numbers:
    values = run(names)["residual"]
    return {f"residual_{n}": getattr(value, "value", value) for n, value in enumerate(values)}


@lru_cache(maxsize=64)
def _terms(set_name: str, omega: float, beta: float, gamma: float) -> Names:
    """The right terms at a place, and the right orders."""
    names: Names = set_parameters(set_name) | {"given_Omega": omega, "given_beta": beta, "given_gamma": gamma}
    jets = {"coordinate": partial(_coordinate, _HIGHEST + 1), "orders": range(1, _HIGHEST + 1)}
    found = _SERIES.run(_JETS | names | jets)
    terms = {name: found[name].value for name in ("M", "free", "linear", "quadratic", "drag", "h_0", "drift")}
    return terms | {"h": [order.cut(1) for order in found["h"]]}


_SERIES = Written(_FIELD + _RECURSION, ())


def _residual_alone(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    names = given(here)
    place = (names[name] for name in ("Omega", "beta", "gamma"))
    right = _terms(here[0].set, *place)
    numbers = {"h": right["h"], "coordinate": lambda angle, axis: angle}
    yield _residuals(run, _JETS | names | numbers) | {f"h_{n}": h.value for n, h in enumerate(right["h"])}


# ------------------------------------------------------------------------------------------ by kind
def formulas_of(kind: str, friction: str) -> tuple[Formula, ...]:
    """What is written of a kind of question, the plainest text first."""
    texts = {
        "rhs": states(friction),
        "equilibrium": EQUILIBRIA,
        "hopf": (
            Formula(_HOPF, _AT_HOPF, ("",), _hopf),
            Formula(_POLARISED, _AT_HOPF, ("",), _hopf, ("",)),
            # Far from the critical speed there may be no pair: the other answers are whatever a program makes of that.
            *(Formula(text, _AT_HOPF, ("omega_crit",), _speed, alone=True) for text in _SPEEDS),
        ),
        "harmonic-balance": tuple(Formula(text, _AT_BALANCE, ("",), _balance) for text in _BALANCES),
        "slow-manifold": (
            Formula(_FIELD + _RECURSION, _AT_MANIFOLD, ("",), _series, others=arithmetics),
            Formula(_FIELD + _RECURSION_TOGETHER, _AT_MANIFOLD, ("",), _series, ("",)),
            Formula(_FIELD_SHARED + _RECURSION, _AT_MANIFOLD, ("",), _series, ("inertia",)),
            Formula(_FIELD + _RESIDUAL, _AT_MANIFOLD, ("residual",), _residual_alone),
            Formula(_FIELD + _RESIDUAL_TOGETHER, _AT_MANIFOLD, ("residual",), _residual_alone, ("",)),
        ),
    }  # fmt: skip
    return texts.get(kind, ())
