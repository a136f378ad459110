"""The formulas of levels 1 and 2 as one writes them down, for slips to be made in them.

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
from typing import Any

from tippedisk_verify.conformance.diagnosis.slips import Names, Written
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.reference_values.draws import parameters_of
from tippedisk_verify.reference_values.store import Quantity

__all__ = [
    *("EQUILIBRIA", "FACTORS", "INPUT", "LINEARISED", "MEANINGS", "REAL", "SINES", "STEPS", "TURNING"),
    *("Formula", "Numbers", "Run", "eigenvalues_of", "given", "set_parameters", "states"),
]

Run = Callable[[Mapping[str, Any]], Names]
Numbers = dict[str, Any]  # what is answered; several numbers where each may be
_STEP = 1e-40  # imaginary: the derivative is exact to rounding


@dataclass(frozen=True)
class Formula:
    """A text, what its expressions are mistaken for, what it answers, and how."""

    source: str
    groups: tuple[tuple[str, ...], ...]
    gives: tuple[str, ...]  #: beginnings of the names of the quantities that it explains
    answers: Callable[[Run, Sequence[Quantity]], Iterator[Numbers]]  #: to the questions of one entry, step by step
    only: tuple[str, ...] = ()  #: statements to change, by what they assign, if not all
    alone: bool = False  #: whether all else follows from what it gives, so that no other answer has to be explained
    #: other mistakes than slips in the text: what is wrong, and the names to run it with, from the right ones
    others: Callable[[], Iterator[tuple[str, Callable[[Mapping[str, Any]], Names]]]] = lambda: iter(())


INPUT = tuple(
    (name, f"-{name}", f"single({name})",
     *(f"{change}({name}, {n})" for change in ("round", "down", "up") for n in range(7)),
     f"2 * {name}", f"{name} / 2",
     *((f"2 * pi * {name}", f"{name} / (2 * pi)", f"{name} * pi / 30", f"{name} * 30 / pi")
       if name == "given_Omega" else
       (f"radians({name})", f"degrees({name})", f"pi / 2 + {name}", f"{name} - pi / 2", f"pi - {name}",
        f"pi / 2 - {name}", f"pi + {name}")))
    for name in ("given_Omega", "given_beta", "given_gamma")
)  # fmt: skip
FACTORS = (
    "r", "e", "rho", "m", "A", "B", "Bbar", "g", "mu", "epsilon", "Omega", "v", "1", "r + e", "r - e",
)  # fmt: skip
TURNING = (
    "A * cos(gamma)**2 + Bbar * sin(gamma)**2", "Bbar * cos(gamma)**2 + A * sin(gamma)**2",
    "A * sin(gamma)**2 + B * cos(gamma)**2",
)  # fmt: skip
#: For small angles, or small deviations from pi/2.
LINEARISED = (
    ("cos(beta)", "pi / 2 - beta", "1 - beta**2 / 2", "1"), ("sin(beta)", "beta", "1"),
    ("sin(gamma)", "gamma", "1"), ("cos(gamma)", "pi / 2 - gamma", "1 - gamma**2 / 2", "1"),
)  # fmt: skip
SINES = ("sin(beta)", "cos(beta)", "sin(gamma)", "cos(gamma)")

# ------------------------------------------------------------------------------------------ level 1
_SPEED = "Omega = given_Omega\n"
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
    "abs(gamma_y) + epsilon", "max(abs(gamma_y), epsilon)", "sqrt(gamma_y**2 + epsilon**2)",
    "sqrt(gamma_y**2 + epsilon)",
    "gamma_y**2 + epsilon", "gamma_y**2 + epsilon**2",
)  # fmt: skip
_AT_STATES = (
    (*FACTORS, "M", "w_y", "h", "gamma_y", "f_G", "lambda_Ty"), SINES, ("sb", "cb", "sg", "cg"), ("beta", "gamma"),
    _SMOOTHED, ("inertia", "A", "Bbar", "B", "M"), *LINEARISED, ("v", "beta", "gamma"), TURNING, INPUT[0],
    ("(h + f_G + w_y * lambda_Ty) / M", "(h + f_G) / Bbar + w_y * lambda_Ty / M", "(h + f_G) / M + w_y * lambda_Ty",
     "h + f_G + w_y * lambda_Ty / M"),
)  # fmt: skip
_OF_STATES = ("M", "h", "f_G", "w_y", "gamma_y", "lambda_Ty", "gamma_rate", "v_rate")


def _side(z: Any) -> float:
    return -1.0 if z.real < 0 else 1.0


def _to_steps(whole: Callable[[float], int], value: float, decimals: int = 0) -> float:
    """Rounded down or up to so many decimals."""
    return float(whole(value * 10**decimals) / 10**decimals)


REAL: Names = {
    "sin": math.sin, "cos": math.cos, "sqrt": math.sqrt, "abs": abs, "max": max, "pi": math.pi,
    "radians": math.radians, "degrees": math.degrees, "round": round, "range": range,
    "down": partial(_to_steps, math.floor), "up": partial(_to_steps, math.ceil),
}  # fmt: skip
#: For derivatives by imaginary steps.
_COMPLEX: Names = REAL | {
    "sin": cmath.sin, "cos": cmath.cos, "sqrt": cmath.sqrt, "abs": lambda z: _side(z) * z,
    "max": lambda x, y: x if x.real >= y.real else y,
}  # fmt: skip


def _single(value: float) -> float:
    return float(struct.unpack("f", struct.pack("f", float(value)))[0])


@lru_cache
def set_parameters(set_name: str) -> Names:
    p = parameters_of(set_name)
    return {name: float(getattr(p, name)) for name in SYMBOLS} | {"single": _single}


#: Names in the texts that are not the paper's.
MEANINGS = {
    "side": "1 for inverted, -1 for noninverted", "damping": "mu m g / epsilon", "reach": "r + e",
    "stiffness": "r - e as printed, r in the consistent law", "restoring": "m g (r + e) - Bbar Omega^2",
    "growth": "|z|^2 per Omega_crit - Omega",
    "by_printed_law": "the slope of the printed one-harmonic law", "free": "h and f_G without v", "drift": "-gamma'",
    "linear": "h's factor of v", "quadratic": "h's factor of v^2", "drag": "mu m g rho^2 sin(beta)^2",
    "by_beta": "derivative by beta", "by_gamma": "derivative by gamma", "inertia": "A cos^2 gamma + Bbar sin^2 gamma",
    "coupling": "m e rho", "total": "the truncated series",
    "gradients": "the sum of epsilon^n times the derivatives of h_n", "gradient": "of the truncated series",
    "change": "dh/dt of the order n - 1", "cb": "cos beta",
    "sb": "sin beta", "cg": "cos gamma", "sg": "sin gamma", "third": "the third derivative, symmetric",
    "eigenvalue_slope": "d lambda/d Omega", "product": "with the adjoint eigenvector",
    "slope": "d lambda_Ty/d gamma_y",
    "answered": "the answer for transversality",
    "value_of": "a number, whose derivatives are lost",
    "plus": "the cube of q + conj q", "minus": "the cube of q - conj q", "bar": "the cube of conj q in C(q, q, conj q)",
    "q": "the critical eigenvector", "left": "the adjoint eigenvector",
    "kappa_1": "of the sine balance; the paper prints the wrong sign of 2 m e (r + e)", "square": "omega^2",
    "strong_friction": "A_33, and the roots of the characteristic polynomial without its cubic part",
    "to_decimals": "each entry rounded to so many", "to_digits": "each entry rounded to so many",
    "rolling": "+-Omega sqrt(-side e / rho), and friction's A_33",
    "lower_triangle": "mirrored, which is what a solver for symmetric matrices reads",
    "upper_triangle": "mirrored, which is what a solver for symmetric matrices reads",
    "down": "rounded down to so many decimals", "up": "rounded up to so many decimals",
    "scale": "the product of both eigenvectors", "size": "the eigenvector's norm",
}  # fmt: skip


def given(here: Sequence[Quantity]) -> Names:
    """Parameters and inputs; those that are no numbers as they are."""
    names = dict(set_parameters(here[0].set))
    for name, text in here[0].inputs.items():
        try:
            names[name] = names[f"given_{name}"] = float(text)
        except ValueError:
            names[name] = text
    return names


def _rhs(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    names = given(here)
    asked = {quantity.name for quantity in here}
    parts = run(REAL | names)
    yield {name: parts[name] for name in _OF_STATES if name in asked}
    for name in ("beta", "gamma", "v"):
        if (slope := f"dv_rate_d{name}") in asked:
            moved = run(_COMPLEX | names | {name: complex(names[name], _STEP)})
            yield {slope: complex(moved["v_rate"]).imag / _STEP}


def _slopes(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    parts = run(REAL | given(here))
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
STEPS = ("1", "0.5", "0.1", "0.05", "0.01", "0.005", "0.001", "0.0001")
_AT_EQUILIBRIA = (
    (*FACTORS, "M", "side * e"), ("side", "1", "-1", "-side"), ("A_21", "A_31", "A_32", "A_33", "0", "1"),
    ("a_2", "a_1", "a_0", "0"), INPUT[0], ("side * e", "e", "-e", "0"),
    ("eigenvalues(matrix)", "eigenvalues(lower_triangle(matrix))", "eigenvalues(upper_triangle(matrix))",
     "eigenvalues(in_single_precision(matrix))", "singular_values(matrix)",
     *(f"eigenvalues(differences({d}))" for d in STEPS),
     "rolling(matrix)", "strong_friction(matrix)", "eigenvalues(symmetric_part(matrix))",
     *(f"eigenvalues({change}(matrix, {n}))" for change in ("to_decimals", "to_digits") for n in range(1, 8)),
     "eigenvalues(matrix) / Omega", "eigenvalues(matrix) * Omega"),
)  # fmt: skip


def eigenvalues_of(matrix: Any) -> Any:
    import numpy

    return numpy.linalg.eigvals(numpy.array(matrix)).astype(complex)


def _roots(coefficients: Any) -> Any:
    import numpy

    return numpy.roots(coefficients)


def _triangle(matrix: Any, sign: int) -> Any:
    """The symmetric matrix with this triangle: the lower one for 1."""
    return [[matrix[max(i, j)][min(i, j)] if sign > 0 else matrix[min(i, j)][max(i, j)] for j in range(3)]
            for i in range(3)]  # fmt: skip


def _singular(matrix: Any) -> Any:
    import numpy

    return numpy.linalg.svd(numpy.array(matrix), compute_uv=False).astype(complex)


def _in_single(matrix: Any) -> Any:
    import numpy

    return numpy.array(matrix, dtype=numpy.float32)


def _rolling(matrix: Any) -> Any:
    """The pair of pure rolling, and what friction alone gives."""
    root = cmath.sqrt(-matrix[1][0] * matrix[2][1] / matrix[2][2])
    return root, -root, matrix[2][2]


def _strong_friction(matrix: Any) -> Any:
    """The pair without the cubic part of the characteristic polynomial, and what friction alone gives."""
    *_, last = matrix
    return *_roots([-last[2], -last[0], -matrix[1][0] * last[1]]), last[2]


def _symmetric(matrix: Any) -> Any:
    return [[(matrix[i][j] + matrix[j][i]) / 2 for j in range(3)] for i in range(3)]


def _typed(form: str, matrix: Any, places: int) -> Any:
    return [[float(f"{float(x):.{places}{form}}") for x in row] for row in matrix]


_MATRICES: Names = REAL | {
    "eigenvalues": eigenvalues_of, "roots": _roots, "lower_triangle": partial(_triangle, sign=1),
    "upper_triangle": partial(_triangle, sign=-1), "in_single_precision": _in_single, "singular_values": _singular,
    "rolling": _rolling, "strong_friction": _strong_friction, "symmetric_part": _symmetric,
    "to_decimals": partial(_typed, "f"), "to_digits": partial(_typed, "g"),
}  # fmt: skip


_RIGHT = Written(_PARTS + _LAW["linear"] + _RATES, ())


def _spectrum(run: Run, here: Sequence[Quantity]) -> Iterator[Numbers]:
    names = given(here)
    names["side"] = 1 if names["equilibrium"] == "inverted" else -1
    model = _RIGHT.run

    def differences(step: float) -> Any:
        """The matrix by central differences."""
        start, columns = {"beta": math.pi / 2, "gamma": names["side"] * math.pi / 2, "v": 0.0}, []
        for name, value in start.items():
            sides = [model(REAL | names | start | {name: value + sign * step}) for sign in (1, -1)]
            columns.append([(sides[0][rate] - sides[1][rate]) / (2 * step) for rate in ("v", "gamma_rate", "v_rate")])
        return list(zip(*columns, strict=True))

    found = run(_MATRICES | names | {"differences": differences})["values"]
    values = sorted(map(complex, found), key=lambda value: (-round(value.real, 7), -value.imag))
    yield {
        f"lambda_{n}_{part}": getattr(value, name)
        for n, value in enumerate(values, start=1)
        for part, name in (("re", "real"), ("im", "imag"))
    }


def states(friction: str) -> tuple[Formula, ...]:
    """The texts of level 1 for a friction law; what is common to both laws is in each."""
    law = _LAW.get(friction, _LAW["linear"])
    parts = _SPEED + _PARTS + law + _RATES
    derivatives = parts + _DERIVATIVES + _SLOPE.get(friction, _SLOPE["linear"]) + _CHAIN
    return (
        Formula(parts, _AT_STATES, ("",), _rhs),
        Formula(_NAMED + law + _RATES, _AT_STATES, ("",), _rhs, _SHARED),
        Formula(derivatives, _AT_STATES, ("dv_rate_d",), _slopes),
    )


EQUILIBRIA = tuple(Formula(text, _AT_EQUILIBRIA, ("lambda",), _spectrum) for text in (_MATRIX, _POLYNOMIAL))
