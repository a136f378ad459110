"""The formulas of levels 1 to 5 as one writes them down, for slips to be made in them.

Each text is read by its names; numbers go in by the questions' inputs, and what a text gives is what is answered. A
test holds every text without slips against the reference values.
"""

from __future__ import annotations

import cmath
import math
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from types import SimpleNamespace
from typing import Any

from tippedisk_verify.conformance.slips import Names, Written
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.reference_values.draws import parameters_of
from tippedisk_verify.reference_values.store import Quantity
from tippedisk_verify.theory.jets import Jet

__all__ = ["MEANINGS", "Formula", "formulas_of"]

Run = Callable[[Mapping[str, Any]], Names]
Numbers = dict[str, Any]  # what is answered; two numbers where either may be
_STEP = 1e-40  # imaginary: the derivative is exact to rounding
_HIGHEST = 5  # order of the slow manifold


@dataclass(frozen=True)
class Formula:
    """A text, what its expressions are mistaken for, what it answers, and how."""

    source: str
    groups: tuple[tuple[str, ...], ...]
    gives: tuple[str, ...]  #: beginnings of the names of the quantities that it explains
    answers: Callable[[Run, Sequence[Quantity]], Iterator[Numbers]]  #: to the questions of one entry, step by step
    only: tuple[str, ...] = ()  #: statements to change, by what they assign, if not all
    alone: bool = False  #: whether all else follows from what it gives, so that no other answer has to be explained


_INPUT = tuple(
    (name, f"-{name}", f"single({name})", *(f"round({name}, {n})" for n in range(7)),
     *((f"2 * pi * {name}", f"{name} / (2 * pi)", f"2 * {name}", f"{name} / 2", f"{name} * pi / 30", f"{name} * 30 / pi") if name == "given_Omega" else
       (f"radians({name})", f"degrees({name})", f"pi / 2 + {name}", f"{name} - pi / 2", f"pi - {name}",
        f"pi / 2 - {name}", f"pi + {name}", f"2 * {name}", f"{name} / 2")))
    for name in ("given_Omega", "given_beta", "given_gamma")
)  # fmt: skip
_FACTORS = (
    "r", "e", "rho", "m", "A", "B", "Bbar", "g", "mu", "epsilon", "Omega", "v", "1", "r + e", "r - e",
)  # fmt: skip
_SINES = ("sin(beta)", "cos(beta)", "sin(gamma)", "cos(gamma)")

# ------------------------------------------------------------------------------------------ level 1
_PARTS = """\
Bbar = B - m * e**2
rho = r + e * sin(gamma)
M = A * cos(gamma)**2 + Bbar * sin(gamma)**2 + m * rho**2 * cos(beta)**2
h = (A * cos(gamma)**2 + Bbar * sin(gamma)**2) * Omega**2 * sin(beta) * cos(beta) \\
    - 2 * (A - Bbar) * Omega * v * cos(beta) * sin(gamma) * cos(gamma) \\
    + m * rho**2 * v**2 * sin(beta) * cos(beta) + m * e * rho * Omega**2 * sin(beta) * cos(beta)**3 * sin(gamma) \\
    - m * e * rho * (3 * sin(beta)**2 - 2) * Omega * v * cos(beta) * cos(gamma)
f_G = -m * g * rho * cos(beta)
w_y = rho * sin(beta)
gamma_y = rho * v * sin(beta) - e * Omega * sin(beta)**2 * cos(gamma)
"""
_LAW = {
    "linear": "lambda_Ty = -mu * m * g / epsilon * gamma_y\n",
    "smooth": "lambda_Ty = -mu * m * g * gamma_y / (abs(gamma_y) + epsilon)\n",
}
_RATES = "gamma_rate = -Omega * cos(beta)\nv_rate = (h + f_G + w_y * lambda_Ty) / M\n"
#: The same with everything named that occurs twice.
_NAMED = """\
sb = sin(beta)
cb = cos(beta)
sg = sin(gamma)
cg = cos(gamma)
Bbar = B - m * e**2
rho = r + e * sg
inertia = A * cg**2 + Bbar * sg**2
coupling = m * e * rho
M = inertia + m * rho**2 * cb**2
h = inertia * Omega**2 * sb * cb - 2 * (A - Bbar) * Omega * v * cb * sg * cg + m * rho**2 * v**2 * sb * cb \\
    + coupling * (Omega**2 * sb * cb**3 * sg - (3 * sb**2 - 2) * Omega * v * cb * cg)
f_G = -m * g * rho * cb
w_y = rho * sb
gamma_y = w_y * v - e * Omega * sb**2 * cg
"""
_SHARED = ("sb", "cb", "sg", "cg", "inertia", "coupling", "h", "gamma_y")
_DERIVATIVES = """\
dM_dbeta = -2 * m * rho**2 * sin(beta) * cos(beta)
dM_dgamma = -2 * (A - Bbar) * sin(gamma) * cos(gamma) + 2 * m * rho * e * cos(gamma) * cos(beta)**2
dh_dbeta = (A * cos(gamma)**2 + Bbar * sin(gamma)**2) * Omega**2 * (cos(beta)**2 - sin(beta)**2) \\
    + 2 * (A - Bbar) * Omega * v * sin(beta) * sin(gamma) * cos(gamma) \\
    + m * rho**2 * v**2 * (cos(beta)**2 - sin(beta)**2) \\
    + m * e * rho * Omega**2 * sin(gamma) * (cos(beta)**4 - 3 * sin(beta)**2 * cos(beta)**2) \\
    - m * e * rho * Omega * v * cos(gamma) * (6 * sin(beta) * cos(beta)**2 - (3 * sin(beta)**2 - 2) * sin(beta))
dh_dgamma = -2 * (A - Bbar) * sin(gamma) * cos(gamma) * Omega**2 * sin(beta) * cos(beta) \\
    - 2 * (A - Bbar) * Omega * v * cos(beta) * (cos(gamma)**2 - sin(gamma)**2) \\
    + 2 * m * rho * e * cos(gamma) * v**2 * sin(beta) * cos(beta) \\
    + m * e * Omega**2 * sin(beta) * cos(beta)**3 * (rho * cos(gamma) + e * cos(gamma) * sin(gamma)) \\
    - m * e * (3 * sin(beta)**2 - 2) * Omega * v * cos(beta) * (e * cos(gamma)**2 - rho * sin(gamma))
dh_dv = -2 * (A - Bbar) * Omega * cos(beta) * sin(gamma) * cos(gamma) + 2 * m * rho**2 * v * sin(beta) * cos(beta) \\
    - m * e * rho * (3 * sin(beta)**2 - 2) * Omega * cos(beta) * cos(gamma)
df_G_dbeta = m * g * rho * sin(beta)
df_G_dgamma = -m * g * e * cos(gamma) * cos(beta)
dw_y_dbeta = rho * cos(beta)
dw_y_dgamma = e * cos(gamma) * sin(beta)
dgamma_y_dbeta = rho * v * cos(beta) - 2 * e * Omega * sin(beta) * cos(beta) * cos(gamma)
dgamma_y_dgamma = e * cos(gamma) * v * sin(beta) + e * Omega * sin(beta)**2 * sin(gamma)
dgamma_y_dv = rho * sin(beta)
"""
_SLOPE = {
    "linear": "slope = -mu * m * g / epsilon\n",
    "smooth": "slope = -mu * m * g * epsilon / (abs(gamma_y) + epsilon)**2\n",
}
_CHAIN = """\
dv_rate_dbeta = (dh_dbeta + df_G_dbeta + dw_y_dbeta * lambda_Ty + w_y * slope * dgamma_y_dbeta) / M \\
    - (h + f_G + w_y * lambda_Ty) * dM_dbeta / M**2
dv_rate_dgamma = (dh_dgamma + df_G_dgamma + dw_y_dgamma * lambda_Ty + w_y * slope * dgamma_y_dgamma) / M \\
    - (h + f_G + w_y * lambda_Ty) * dM_dgamma / M**2
dv_rate_dv = (dh_dv + w_y * slope * dgamma_y_dv) / M
"""
_SMOOTHED = (
    "abs(gamma_y) + epsilon", "max(abs(gamma_y), epsilon)", "sqrt(gamma_y**2 + epsilon**2)", "sqrt(gamma_y**2 + epsilon)",
    "gamma_y**2 + epsilon", "gamma_y**2 + epsilon**2",
)  # fmt: skip
_AT_STATES = (
    (*_FACTORS, "M", "w_y", "h", "gamma_y", "f_G", "lambda_Ty"), _SINES, ("sb", "cb", "sg", "cg"), ("beta", "gamma"),
    _SMOOTHED, ("inertia", "A", "Bbar", "B", "M"),
)  # fmt: skip
_OF_STATES = ("M", "h", "f_G", "w_y", "gamma_y", "lambda_Ty", "gamma_rate", "v_rate")


def _side(z: Any) -> float:
    return -1.0 if z.real < 0 else 1.0


_REAL: Names = {
    "sin": math.sin, "cos": math.cos, "sqrt": math.sqrt, "abs": abs, "max": max, "pi": math.pi,
    "radians": math.radians, "degrees": math.degrees, "round": round, "range": range,
}  # fmt: skip
#: For derivatives by imaginary steps.
_COMPLEX: Names = _REAL | {
    "sin": cmath.sin, "cos": cmath.cos, "sqrt": cmath.sqrt, "abs": lambda z: _side(z) * z,
    "max": lambda x, y: x if x.real >= y.real else y,
}  # fmt: skip


def _single(value: float) -> float:
    return float(struct.unpack("f", struct.pack("f", float(value)))[0])


@lru_cache
def _parameters(set_name: str) -> Names:
    p = parameters_of(set_name)
    return {name: float(getattr(p, name)) for name in SYMBOLS} | {"single": _single}


#: Names in the texts that are not the paper's.
MEANINGS = {
    "side": "1 for inverted, -1 for noninverted", "damping": "mu m g / epsilon", "reach": "r + e",
    "stiffness": "r - e as printed, r in the consistent law", "growth": "|z|^2 per Omega_crit - Omega",
    "by_printed_law": "the slope of the printed one-harmonic law", "free": "h and f_G without v", "drift": "-gamma'",
    "linear": "h's factor of v", "quadratic": "h's factor of v^2", "drag": "mu m g rho^2 sin(beta)^2",
    "by_beta": "derivative by beta", "by_gamma": "derivative by gamma", "inertia": "A cos^2 gamma + Bbar sin^2 gamma",
    "coupling": "m e rho", "total": "the truncated series", "change": "dh/dt of the order n - 1", "cb": "cos beta",
    "sb": "sin beta", "cg": "cos gamma", "sg": "sin gamma", "third": "the third derivative, symmetric",
    "eigenvalue_slope": "d lambda/d Omega", "product": "with the adjoint eigenvector",
    "slope": "d lambda_Ty/d gamma_y", "scale": "the product of both eigenvectors", "size": "the eigenvector's norm",
}  # fmt: skip


def _given(here: Sequence[Quantity]) -> Names:
    """Parameters and inputs; those that are no numbers as they are."""
    names = dict(_parameters(here[0].set))
    for name, text in here[0].inputs.items():
        try:
            names[name] = names[f"given_{name}"] = float(text)
        except ValueError:
            names[name] = text
    return names


def _rhs(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    names = _given(here)
    asked = {quantity.name for quantity in here}
    parts = run(_REAL | names)
    yield {name: parts[name] for name in _OF_STATES if name in asked}
    for name in ("beta", "gamma", "v"):
        if (slope := f"dv_rate_d{name}") in asked:
            moved = run(_COMPLEX | names | {name: complex(names[name], _STEP)})
            yield {slope: complex(moved["v_rate"]).imag / _STEP}


def _slopes(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    parts = run(_REAL | _given(here))
    yield {quantity.name: parts[quantity.name] for quantity in here if quantity.name.startswith("dv_rate_d")}


# ------------------------------------------------------------------------------------------ level 2
_MATRIX = """\
Omega = given_Omega
Bbar = B - m * e**2
rho = r + side * e
M = Bbar
A_21 = Omega
A_31 = (m * g * rho - Bbar * Omega**2) / M
A_32 = -mu * m * g / epsilon * rho * side * e * Omega / M
A_33 = -mu * m * g / epsilon * rho**2 / M
matrix = [[0, 0, 1], [A_21, 0, 0], [A_31, A_32, A_33]]
values = eigenvalues(matrix)
"""
_POLYNOMIAL = """\
Bbar = B - m * e**2
rho = r + side * e
damping = mu * m * g / epsilon
a_2 = damping * rho**2 / Bbar
a_1 = Omega**2 - m * g * rho / Bbar
a_0 = damping * rho * side * e * Omega**2 / Bbar
values = roots([1, a_2, a_1, a_0])
"""
_STEPS = ("1", "0.5", "0.1", "0.05", "0.01", "0.005", "0.001", "0.0001")
_AT_EQUILIBRIA = (
    (*_FACTORS, "M", "side * e"), ("side", "1", "-1", "-side"), ("A_21", "A_31", "A_32", "A_33", "0", "1"),
    ("a_2", "a_1", "a_0", "0"), _INPUT[0], ("side * e", "e", "-e", "0"),
    ("eigenvalues(matrix)", "eigenvalues(lower_triangle(matrix))", "eigenvalues(upper_triangle(matrix))",
     "eigenvalues(in_single_precision(matrix))", *(f"eigenvalues(differences({d}))" for d in _STEPS), "eigenvalues(matrix) / Omega", "eigenvalues(matrix) * Omega"),
)  # fmt: skip


def _eigenvalues(matrix: Any) -> Any:
    import numpy

    return numpy.linalg.eigvals(numpy.array(matrix)).astype(complex)


def _roots(coefficients: Any) -> Any:
    import numpy

    return numpy.roots(coefficients)


def _triangle(matrix: Any, sign: int) -> Any:
    """The symmetric matrix with this triangle: the lower one for 1."""
    return [[matrix[max(i, j)][min(i, j)] if sign > 0 else matrix[min(i, j)][max(i, j)] for j in range(3)]
            for i in range(3)]  # fmt: skip


def _in_single(matrix: Any) -> Any:
    import numpy

    return numpy.array(matrix, dtype=numpy.float32)


_MATRICES: Names = _REAL | {
    "eigenvalues": _eigenvalues, "roots": _roots, "lower_triangle": partial(_triangle, sign=1),
    "upper_triangle": partial(_triangle, sign=-1), "in_single_precision": _in_single,
}  # fmt: skip


_RIGHT = Written(_PARTS + _LAW["linear"] + _RATES, ())


def _spectrum(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    names = _given(here)
    names["side"] = 1 if names["equilibrium"] == "inverted" else -1
    model = _RIGHT.run

    def differences(step: float) -> Any:
        """The matrix by central differences."""
        start, columns = {"beta": math.pi / 2, "gamma": names["side"] * math.pi / 2, "v": 0.0}, []
        for name, value in start.items():
            sides = [model(_REAL | names | start | {name: value + sign * step}) for sign in (1, -1)]
            columns.append([(sides[0][rate] - sides[1][rate]) / (2 * step) for rate in ("v", "gamma_rate", "v_rate")])
        return list(zip(*columns, strict=True))

    values = sorted(
        map(complex, run(_MATRICES | names | {"differences": differences})["values"]), key=lambda value: (-round(value.real, 7), -value.imag)
    )
    yield {
        f"lambda_{n}_{part}": getattr(value, name)
        for n, value in enumerate(values, start=1)
        for part, name in (("re", "real"), ("im", "imag"))
    }


# ------------------------------------------------------------------------------------------ level 3
_HOPF = """\
def third(x, y, z):
    return 2 * (x * y * conj(z) + x * conj(y) * z + conj(x) * y * z)
Bbar = B - m * e**2
reach = r + e
omega_crit = sqrt(m * g * (r + e)**2 / (Bbar * r))
Omega = omega_crit
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
scale = (root - A_33) * root * beta + A_32 * gamma + root * v
def product(gamma_part, v_part):
    return (A_32 * gamma_part + root * v_part) / scale
eigenvalue_slope = product(beta, A_32 / Omega * gamma - 2 * Omega * beta)
cubic_gamma = -Omega * third(beta, beta, beta) / 6
cubic_h = (Bbar - A) * Omega**2 * third(beta, gamma, gamma) \\
    + (2 * Bbar / 3 - m * e * reach) * Omega**2 * third(beta, beta, beta) \\
    - (2 * (A - Bbar) + m * e * reach) * Omega * third(beta, gamma, v) - m * reach**2 * third(beta, v, v)
cubic_f_G = -m * g * e / 2 * third(beta, gamma, gamma) - m * g * reach / 6 * third(beta, beta, beta)
cubic_friction = damping * (Omega * e * (4 * e + r) / 6 * third(gamma, gamma, gamma) \\
    + 3 * Omega * e * reach / 2 * third(beta, beta, gamma) + reach**2 * third(beta, beta, v) \\
    + e * reach * third(gamma, gamma, v))
stiffness = m * g * reach - Bbar * Omega**2
cubic_M = (A - Bbar) * (stiffness * third(beta, gamma, gamma) - damping * reach**2 * third(gamma, gamma, v) \\
    - damping * reach * e * Omega * third(gamma, gamma, gamma)) \\
    + m * reach**2 * (stiffness * third(beta, beta, beta) - damping * reach**2 * third(beta, beta, v) \\
    - damping * reach * e * Omega * third(beta, beta, gamma))
cubic_v = (cubic_h + cubic_f_G + cubic_friction - cubic_M / Bbar) / Bbar
c_1 = product(cubic_gamma, cubic_v) / 2
first_lyapunov_coefficient = real(c_1) / frequency
transversality = real(eigenvalue_slope)
growth = transversality / real(c_1)
by_printed_law = 8 * e * Bbar * r * Omega / (reach * ((A * (r - 2 * e) \\
    - Bbar * (2 * r**2 + e * reach) / (2 * reach)) * Omega**2 + m * g * e * reach))
amplitude_squared_slope = 4 * abs(beta)**2 * growth
period_slope = -2 * pi / frequency**2 * (imag(c_1) * growth - imag(eigenvalue_slope))
"""
_SPEEDS = tuple(
    f"Bbar = B - m * e**2\nomega_crit = {text}\n"
    for text in ("sqrt(m * g * (r + e)**2 / (Bbar * r))", "(r + e) * sqrt(m * g / (Bbar * r))")
)
_AT_HOPF = (
    (*_FACTORS, "reach", "r + 2 * e", "frequency", "damping", "pi", "omega_crit", "growth", "period"),
    ("omega_crit", "30.92", "30.89", "30.9", "30.07", "30", "31"), ("frequency", "imag(eigenvalue_slope)"),
    ("sqrt(m * g * (r + e)**2 / (Bbar * r))", "30.92"), ("scale", "conj(scale)", "abs(scale)"), ("beta", "gamma", "v"), ("root", "conj(root)", "A_33"),
    ("c_1", "eigenvalue_slope", "conj(c_1)"), ("real(c_1)", "imag(c_1)", "abs(c_1)"), ("real(eigenvalue_slope)", "imag(eigenvalue_slope)", "abs(eigenvalue_slope)"),
    ("product(beta, A_32 / Omega * gamma - 2 * Omega * beta)",
     *(f"(eigenvalue(Omega + {d}) - eigenvalue(Omega)) / {d}" for d in _STEPS),
     *(f"(eigenvalue(Omega) - eigenvalue(Omega - {d})) / {d}" for d in _STEPS),
     *(f"(eigenvalue(Omega + {d}) - eigenvalue(Omega - {d})) / (2 * {d})" for d in _STEPS)),
    ("4 * abs(beta)**2 * growth", "by_printed_law", "4 * abs(gamma)**2 * growth", "4 * abs(v)**2 * growth"),
    ("sqrt(abs(beta)**2 + abs(gamma)**2 + abs(v)**2)", "beta", "gamma", "v", "1"),
    ("cubic_gamma", "0"), ("cubic_v", "0"), ("cubic_M", "0"),
    ("-2 * pi / frequency**2 * (imag(c_1) * growth - imag(eigenvalue_slope))",
     "-pi * Omega**2 / frequency**3 * (r - e) / (8 * reach) * -by_printed_law"
     " + 2 * pi * Omega * e / (reach * frequency**3)"),
)  # fmt: skip


def _hopf(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    names = _given(here)
    p = SimpleNamespace(**names)
    bbar, reach, damping = p.B - p.m * p.e**2, p.r + p.e, p.mu * p.m * p.g / p.epsilon

    def eigenvalue(speed: float) -> complex:
        last = [p.m * p.g * reach - bbar * speed**2, -damping * reach * p.e * speed, -damping * reach**2]
        values = _eigenvalues([[0, 0, 1], [speed, 0, 0], [x / bbar for x in last]])
        return complex(max(values, key=lambda value: value.imag))

    complexes: Names = {
        "conj": lambda z: z.conjugate(), "real": lambda z: z.real, "imag": lambda z: z.imag, "eigenvalue": eigenvalue,
    }  # fmt: skip
    found = run(_REAL | names | complexes)
    yield {quantity.name: found[quantity.name] for quantity in here}


def _speed(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    yield {"omega_crit": run(_REAL | _given(here))["omega_crit"]}


# ------------------------------------------------------------------------------------------ level 4
_CHI = """\
Omega = given_Omega
Bbar = B - m * e**2
omega_crit = sqrt(m * g * (r + e)**2 / (Bbar * r))
chi = A * (r - 2 * e) - Bbar * (2 * r**2 + e * (r + e)) / (2 * (r + e))
chi = chi + Bbar * e**2 / (2 * (r + e)) if consistent else chi
stiffness = r if consistent else r - e
"""
_BALANCES = (
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
_AT_BALANCE = (
    (*_FACTORS, "r + 2 * e", "stiffness", "chi", "C", "omega_crit"), _INPUT[0], ("chi", "1.31e-07"),
    ("Bbar * r * Omega**2 - m * g * (r + e)**2", "2 * Bbar * r * omega_crit * (Omega - omega_crit)"),
    ("C", "frequency * C", "Omega * C / frequency"), ("sqrt(C_squared)", "sqrt(C_squared) * Omega / frequency"),
    ("C_squared", "amplitude"), ("sqrt(C_squared)", "C_squared / 2"),
    ("C", "C / 2", "2 * C"), ("r - 2 * e", "r + e", "r - e"), ("frequency", "Omega", "C", "delta"),
)  # fmt: skip


def _balance(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    names = _given(here)
    found = run(_REAL | names | {"consistent": names["form"] == "consistent"})
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
    force = linear * h[n - 1]
    if n == 1:
        force += free
    for i in range(n):
        change += h[n - 1 - i] * by_beta(h[i])
    for i in range(n):
        force += quadratic * h[i] * h[n - 1 - i]
    h_n = (force - M * change) / drag
    h.append(h_n)
"""
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
_AT_MANIFOLD = (
    _FACTORS, _SINES, *_INPUT, ("beta", "gamma"), ("h_0", "h[0]", "h[n]", "total"), ("free", "linear", "quadratic", "drag"),
    ("by_beta", "by_gamma"), ("M", "Bbar", "A", "1"), ("dh_dbeta", "dh_dgamma"), ("n == 1", "n >= 1"), ("h[n - 1]", "h[0]"),
    ("n", "i"), ("total", "h[n]"), ("epsilon**n", "epsilon**(n + 1)", "epsilon"),
    ("range(n)", "range(n - 1)", "range(1, n)", "range(1)", "range(n // 2)", "range((n + 1) // 2)", "(0, n - 1)"),
    ("h[n - 1 - i] * by_beta(h[i])", "h[i] * by_beta(h[n - 1 - i])"),
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


_JETS: Names = _REAL | {
    "sin": _sine, "cos": partial(_sine, quarters=1), "by_beta": Jet.by_beta, "by_gamma": Jet.by_gamma,
}  # fmt: skip
_RESIDUALS = Written(_RESIDUAL, ())


def _series(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    """The orders, low ones first, and residuals of the same terms or of right ones."""
    names, found = _given(here), {}
    for highest in (1, 2, 3, _HIGHEST):
        degree = highest + (highest == _HIGHEST)
        found = run(_JETS | names | {"coordinate": partial(_coordinate, degree), "orders": range(1, highest + 1)})
        yield {f"h_{n}": order.value for n, order in enumerate(found["h"])}
    right = _terms(here[0].set, *(names[name] for name in ("Omega", "beta", "gamma")))
    alike = {name: getattr(found[name], "value", found[name]) for name in right if name != "h"}
    both = [
        _residuals(_RESIDUALS.run, _JETS | names | terms | {"h": [order.cut(1) for order in found["h"]]})
        for terms in (alike, right)
    ]
    yield {name: (number, both[1][name]) for name, number in both[0].items()}


def _residuals(run: Run, names: Names) -> Numbers:
    values = run(names)["residual"]
    return {f"residual_{n}": getattr(value, "value", value) for n, value in enumerate(values)}


@lru_cache(maxsize=64)
def _terms(set_name: str, omega: float, beta: float, gamma: float) -> Names:
    """The right terms at a place, and the right orders."""
    names: Names = _parameters(set_name) | {"given_Omega": omega, "given_beta": beta, "given_gamma": gamma}
    jets = {"coordinate": partial(_coordinate, _HIGHEST + 1), "orders": range(1, _HIGHEST + 1)}
    found = _SERIES.run(_JETS | names | jets)
    terms = {name: found[name].value for name in ("M", "free", "linear", "quadratic", "drag", "h_0", "drift")}
    return terms | {"h": [order.cut(1) for order in found["h"]]}


_SERIES = Written(_FIELD + _RECURSION, ())


def _residual_alone(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    names = _given(here)
    place = (names[name] for name in ("Omega", "beta", "gamma"))
    right = _terms(here[0].set, *place)
    numbers = {"h": right["h"], "coordinate": lambda angle, axis: angle}
    yield _residuals(run, _JETS | names | numbers) | {f"h_{n}": h.value for n, h in enumerate(right["h"])}


# ------------------------------------------------------------------------------------------ by kind
def formulas_of(kind: str, friction: str) -> tuple[Formula, ...]:
    """What is written of a kind of question, the plainest text first."""
    law = _LAW.get(friction, _LAW["linear"])
    parts = _PARTS + law + _RATES
    derivatives = parts + _DERIVATIVES + _SLOPE.get(friction, _SLOPE["linear"]) + _CHAIN
    texts = {
        "rhs": (
            Formula(parts, _AT_STATES, ("",), _rhs),
            Formula(_NAMED + law + _RATES, _AT_STATES, ("",), _rhs, _SHARED),
            Formula(derivatives, _AT_STATES, ("dv_rate_d",), _slopes),
        ),
        "equilibrium": tuple(Formula(text, _AT_EQUILIBRIA, ("lambda",), _spectrum) for text in (_MATRIX, _POLYNOMIAL)),
        "hopf": (
            Formula(_HOPF, _AT_HOPF, ("",), _hopf),
            # Far from the critical speed there may be no pair: the other answers are whatever a program makes of that.
            *(Formula(text, _AT_HOPF, ("omega_crit",), _speed, alone=True) for text in _SPEEDS),
        ),
        "harmonic-balance": tuple(Formula(text, _AT_BALANCE, ("",), _balance) for text in _BALANCES),
        "slow-manifold": (
            Formula(_FIELD + _RECURSION, _AT_MANIFOLD, ("",), _series),
            Formula(_FIELD_SHARED + _RECURSION, _AT_MANIFOLD, ("",), _series, ("inertia",)),
            Formula(_FIELD + _RESIDUAL, _AT_MANIFOLD, ("residual",), _residual_alone),
        ),
    }  # fmt: skip
    return texts.get(kind, ())
