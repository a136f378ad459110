"""Other right ways of writing functions of the specimen: a mistake in a program that has it so is one change in them.

Each is held against the specimen in the tests. It is no mistake itself, and nothing is said of it.
"""

from __future__ import annotations

import ast
from functools import cache
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.specimen import Specimen, specimen
from tippedisk_verify.conformance.diagnosis.trees import substituted

__all__ = ["ways"]

_TINY = 1e-20

_COMPLEX_STEPS = """
def derivatives(p, Omega, smooth, beta, gamma, v):
    step = 1e-30
    dv_rate_dbeta = equations(p, Omega, smooth, beta + 1j * step, gamma, v)[7].imag / step
    dv_rate_dgamma = equations(p, Omega, smooth, beta, gamma + 1j * step, v)[7].imag / step
    dv_rate_dv = equations(p, Omega, smooth, beta, gamma, v + 1j * step)[7].imag / step
    dv_rate_domega = equations(p, Omega + 1j * step, smooth, beta, gamma, v)[7].imag / step
    v_rate = equations(p, Omega, smooth, beta, gamma, v)[7]
    return dv_rate_dbeta, dv_rate_dgamma, dv_rate_dv, dv_rate_domega, v_rate
"""
_SOLVER = """
def hopf_eigenvectors(p, Omega, omega):
    matrix = linearisation(p, Omega, 1)
    eigenvalues, right = np.linalg.eig(matrix)
    pair = np.argmax(eigenvalues.imag, axis=-1)
    q = np.array([right[k, :, pair[k]] for k in range(len(pair))]).T
    q = q / sqrt(sum(abs(q) ** 2)) * abs(q[1]) / q[1]
    eigenvalues, left = np.linalg.eig(np.swapaxes(matrix, 1, 2))
    pair = np.argmax(eigenvalues.imag, axis=-1)
    p_star = np.array([left[k, :, pair[k]] for k in range(len(pair))]).T
    p_star = p_star / sum(p_star * q)
    return q, p_star

def pair_frequency(p, Omega):
    eigenvalues = np.linalg.eigvals(linearisation(p, Omega, 1))
    return np.max(eigenvalues.imag, axis=-1)
"""
_ROOTS_OF_MODULI = """
def sqrt(x):
    return np.sqrt(abs(x))
"""


#: What stands in the text of a function, and what may stand there as well.
_PARTS = (
    ("- added) / (2 * (r + e))", ") / (2 * (r + e)) + addition"),
    ("added = np.where(form == 'printed', 0, e ** 2)",
     "addition = np.where(form == 'printed', 0, Bbar * e ** 2 / (2 * (r + e)))"),
    ("sqrt(e * Omega ** 2 / (r + e) + delta * C ** 2)", "Omega * sqrt(e / (r + e) - stiffness / (r + e) * C ** 2 / 8)"),
)  # fmt: skip
_RATE = "force / M", "equations(p, Omega, False, beta, gamma, v)[7]"
_SLOPE = (
    "epsilon / (abs(gamma_y) + epsilon) ** 2",
    "(1 / (abs(gamma_y) + epsilon) - abs(gamma_y) / (abs(gamma_y) + epsilon) ** 2)",
)


def _analytic(x: object) -> object:
    """The modulus of a real number, carried on for the imaginary parts of complex steps."""
    x = np.asarray(x)
    if np.iscomplexobj(x) and np.all(np.abs(x.imag) < _TINY):
        return np.where(x.real < 0, -x, x)
    return np.abs(x)


def _written_out(text: str, *names: str) -> str:
    """A function with the values of some of its names in place of these."""
    tree = ast.parse(text)
    values: dict[str, ast.expr] = {}
    function: Any = tree.body[0]
    for place, statement in enumerate(tuple(function.body)):
        function.body[place] = substituted(statement, values)
        name = getattr(getattr(statement, "targets", [None])[0], "id", "")
        if name in names:
            values[name] = function.body[place].value
    function.body = [one for one in function.body if getattr(getattr(one, "targets", [None])[0], "id", "") not in names]
    return ast.unparse(tree) + "\n"


def _replaced(text: str, *pairs: tuple[str, str]) -> str:
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


@cache
def ways() -> tuple[Specimen, ...]:
    """The specimen as it is, with other derivatives, and another right program."""
    plain = specimen()
    motion, hopf, law = (plain.text(name) for name in ("equations", "hopf", "one_harmonic_law"))
    terms = _written_out(motion, "inertia", "h_1", "h_2", "h_3", "h_4", "h_5", "normal_force", "force")
    other = (
        _replaced(terms, ("rho * v * sin(beta)", "w_y * v")),
        _replaced(plain.text("derivatives"), _SLOPE),
        _replaced(hopf, ("sqrt(e / (r + e)) * Omega", "pair_frequency(p, Omega)")),
        _SOLVER,
        _replaced(law, *_PARTS),
        _ROOTS_OF_MODULI,
        _written_out(plain.text("manifold_terms"), "w_y"),
    )
    steps = plain.patched("complex steps", _COMPLEX_STEPS, abs=_analytic)
    return (
        plain,
        steps,
        plain.patched("another program", "\n".join(other)),
        steps.patched("another program, complex steps", "\n".join((*other, _COMPLEX_STEPS))),
        plain.patched("period written out", _written_out(hopf, "omega")),
        plain.patched("residual of the equations", _replaced(plain.text("invariance_residual"), _RATE)),
    )
