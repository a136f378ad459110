"""Levels 1 to 5: the definitions of the quantities, and the values that they give for a table.

A *problem* has the answers to one quantity, and an identity that is linear in the terms of the
quantity's definition. `regression` searches for changes by such identities. `PREDICTIONS` has the
formulas by which a program with known mistakes would answer. An answer that one of them gives
counts as explained.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.dictionary import Change
from tippedisk_verify.conformance.diagnosis.regression import (
    RegressionProblem,
    program_with_changes,
)
from tippedisk_verify.conformance.diagnosis.tables import Array, ComparedAnswers, Table
from tippedisk_verify.conformance.diagnosis.terms import EquationValues
from tippedisk_verify.model.equations import STATE_NAMES

__all__ = [
    "MISTAKEN_PREDICTIONS",
    "PREDICTIONS",
    "Results",
    "predicted_answers",
    "regression_problems",
]

Results = dict[str, Any]  #: values by the name of the quantity, one to an entry
_ORDERS = range(6)
_RATES = (
    *("Bbar", "gamma_rate", "w_y", "f_G", "gamma_y", "M"),
    *("h_1", "h_2", "h_3", "h_4", "h_5", "h", "lambda_Ty", "v_rate"),
)
_DERIVATIVES = ("dv_rate_dbeta", "dv_rate_dgamma", "dv_rate_dv")
_LINEARISED_ENTRIES = ("d(gamma_rate)/d(beta)", *_DERIVATIVES)
# The definitions of the quantities, in the order of the equations
_DEFINITIONS: dict[str, dict[str, str]] = {
    "rhs": {name: name for name in (*_RATES, *_DERIVATIVES)},
    "equilibrium": {name: name for name in ("A_31", "A_32", "A_33")},
    "hopf": {
        "omega_crit": "omega_crit",
        "period": "hopf_period",
        "transversality": "transversality",
        "first_lyapunov_coefficient": "first_lyapunov_coefficient",
        "amplitude_squared_slope": "amplitude_squared_slope",
        "period_slope": "period_slope",
    },
    "harmonic-balance": {
        "amplitude": "amplitude",
        "frequency": "frequency",
        "period": "law_period",
    },
    "slow-manifold": {
        **{f"h_{n}": "h_next" if n else "h_0" for n in _ORDERS},
        **{f"residual_{n}": "residual" for n in _ORDERS},
    },
}
# By quantity: the definition in whose place the answers are put, where other definitions use it
_REPLACED_BY_ANSWERS = {
    "v_rate": "answered_rate",
    "omega_crit": "hopf_speed",
    "amplitude": "answered_amplitude",
    "frequency": "answered_frequency",
}
# Identities: sums that vanish for right answers, and are linear in the definitions' terms. For
# other quantities the identity is the answer minus the definition.
_IDENTITIES = {
    "v_rate": "M answer - force",
    "amplitude": "(r + e) denominator answer^2 + 4 e excess",
    "frequency": "answer^2 - frequency_squared",
    "h_next": "drag answer - recursion",
}
# The nodes, and the radius [rad], of the circles on which the slow manifold is differentiated
_CIRCLE_NODES, _CIRCLE_RADIUS = 16, 0.09
_ROOTS_OF_UNITY = np.exp(2j * np.pi * np.arange(_CIRCLE_NODES) / _CIRCLE_NODES)


# ---- what definitions predict
def predict_results(kind: str, values: EquationValues) -> Results:
    """Return the values that a program computes for all quantities of a kind, by name, one value to
    an entry.

    Args:
        kind: The kind of the questions, such as "rhs".
        values: The definitions with the inputs of the entries.
    """
    parts = _FURTHER_INPUTS[kind](values) if kind in _FURTHER_INPUTS else {}
    return {
        name: (values.at_inputs(**parts[name]) if name in parts else values)[definition]
        for name, definition in _DEFINITIONS[kind].items()
    }


def linearised_matrices(
    values: EquationValues, entries: Sequence[str] = _LINEARISED_ENTRIES, **place: Any
) -> Array:
    """Return the matrices of the linearised equations, as an array of shape (entries, 3, 3).

    Args:
        values: The definitions with the inputs of the entries.
        entries: The definitions of the derivative of gamma' by beta, and of those of v' by beta,
            gamma and v.
        place: The state and the speed by symbol, as numbers or as text. By default they are the
            entry's equilibrium and speed.
    """
    place = {"beta": "1/2 pi", "gamma": "1/2 side pi", "v": "0", **place}
    at = values.at_inputs(
        **{x: values[f"({at})"] if isinstance(at, str) else at for x, at in place.items()}
    )
    matrices = np.zeros((len(values.inputs["r"]), 3, 3))
    matrices[:, 0, 2] = 1.0
    matrices[:, 1, 0], matrices[:, 2, 0], matrices[:, 2, 1], matrices[:, 2, 2] = (
        at[name] for name in entries
    )
    return matrices


def _spectrum(
    matrices: Array,
    solve: Callable[[Array], Array] = np.linalg.eigvals,
    key: Callable[[Array], Array] = np.real,
    key_direction: int = -1,
    imaginary_direction: int = -1,
) -> Results:
    """Return the real and imaginary parts of three eigenvalues by name, such as ``lambda_1_re``.

    By default they are sorted by descending real part, then by descending imaginary part.

    Args:
        matrices: The matrices, one to an entry.
        solve: The function that computes the eigenvalues.
        key: The function of the eigenvalues by which they are sorted.
        key_direction: 1 for ascending keys, -1 for descending ones.
        imaginary_direction: 1 to sort those with equal keys by ascending imaginary part, -1 by
            descending one.
    """
    finite = np.isfinite(matrices).all(axis=(1, 2), keepdims=True)
    z = solve(np.where(finite, matrices, 0.0)).astype(complex)
    order = np.lexsort((imaginary_direction * z.imag, key_direction * np.round(key(z), 9)), axis=-1)
    z = np.take_along_axis(z, order, axis=-1)
    return {f"lambda_{n + 1}_re": z[:, n].real for n in range(3)} | {
        f"lambda_{n + 1}_im": z[:, n].imag for n in range(3)
    }


@np.errstate(all="ignore")
def hopf_inputs(values: EquationValues) -> dict[str, dict[str, Array]]:
    """Return the inputs from which each quantity at the Hopf point is computed, by its name.

    They are sums over the critical eigenvector q and the adjoint eigenvector p at the Hopf speed.
    They are given for the right normalisation of p, and for those that people use by mistake.

    Args:
        values: The definitions with the inputs of the entries.
    """
    speed = np.sqrt(values["hopf_speed"] ** 2 + 0 * values.inputs["r"])
    j = linearised_matrices(values, Omega=speed)
    omega = np.sqrt(-j[:, 2, 0])
    q = np.array([1j * omega, j[:, 1, 0], -(omega**2)])
    p = np.array([1j * omega * (1j * omega - j[:, 2, 2]), j[:, 2, 1] + 0j, 1j * omega])
    q, normal = (x / np.sqrt((np.abs(x) ** 2).sum(axis=0)) for x in (q, p))
    c = [_cubic(values, speed, x) for x in (q + q.conj(), q - q.conj(), q.conj())]
    cubic, product = (c[0] - c[1] - 2 * c[2]) / 6, (normal * q).sum(axis=0)
    faster, slower = (
        linearised_matrices(values, Omega=1.5 * speed),
        linearised_matrices(values, Omega=0.5 * speed),
    )
    by_speed = (faster - slower) / speed[:, None, None]  # exact: linear in the speed's square
    inputs = {f"q_{name}": np.abs(x) for name, x in zip(STATE_NAMES, q, strict=True)}
    # The index of a component of the adjoint eigenvector, and the factor that it gets
    adjoint_terms = {
        "g_gamma": (1, cubic[0]),
        "g_v": (2, cubic[1]),
        "rate_21": (1, by_speed[:, 1, 0] * q[0]),
        "rate_31": (2, by_speed[:, 2, 0] * q[0]),
        "rate_32": (2, by_speed[:, 2, 1] * q[1]),
    }
    adjoints = {
        "": normal / product,
        "unit_": normal,
        "unscaled_": p,
        "conjugate_": normal / product.conj(),
        "eigenvector_": q.conj(),
    }
    for prefix, adjoint in adjoints.items():
        for name, (row, factor) in adjoint_terms.items():
            inputs[f"{prefix}{name}_real"] = (adjoint[row] * factor).real
            inputs[f"{prefix}{name}_imag"] = (adjoint[row] * factor).imag
    return dict.fromkeys(_DEFINITIONS["hopf"], inputs)


def _cubic(values: EquationValues, speed: Array, q: Array) -> Array:
    """Return the third derivatives of gamma' and v' along a direction at the inverted equilibrium.

    They are computed from the values on a circle in the complex plane. The shape is (2, entries).

    Args:
        values: The definitions with the inputs of the entries.
        speed: The speed of each entry.
        q: The direction in (beta, gamma, v), of shape (3, entries).
    """
    turn = np.exp(2j * np.pi * np.arange(32) / 32)[:, None]
    radius = 0.2 / np.sqrt((np.abs(q) ** 2).sum(axis=0))
    state = {
        x: place + turn * radius * part
        for x, place, part in zip(STATE_NAMES, (np.pi / 2, np.pi / 2, 0.0), q, strict=True)
    }
    at = values.at_inputs(**state, Omega=speed)
    return np.array(
        [np.mean(at[name] / turn**3, axis=0) * 6 / radius**3 for name in ("gamma_rate", "v_rate")]
    )


def _slope(f: Array, axis: int, radius: Array) -> Array:
    """Return the derivative of a function with respect to beta or gamma, from values on circles.

    Args:
        f: The values on circles about each state: one axis for beta, one for gamma, one for
            entries.
        axis: The axis of the variable: 0 for beta, 1 for gamma.
        radius: The radius of the circles [rad], one to an entry.

    Returns:
        The derivative at the same points, as an array of the same shape.
    """
    k, shape = np.arange(_CIRCLE_NODES), [-1 if n == axis else 1 for n in range(3)]
    return np.asarray(
        np.fft.ifft(np.fft.fft(f, axis=axis) * k.reshape(shape), axis=axis)
        / (radius * _ROOTS_OF_UNITY.reshape(shape))
    )


def slow_manifold_inputs(values: EquationValues) -> dict[str, dict[str, Any]]:
    """Return the inputs of the definitions of each order and each residual on the slow manifold.

    They are given by the quantity's name: the sums over lower orders for an order, and v with its
    derivatives for a residual. The wrong sums that people write in their place are among them.

    Args:
        values: The definitions with the inputs of the entries.
    """
    # The circles are small near sin(beta) = 0, where the orders diverge.
    radius = np.asarray(_CIRCLE_RADIUS * np.abs(np.sin(values["beta"])))
    shifts = radius * _ROOTS_OF_UNITY[:, None, None], radius * _ROOTS_OF_UNITY[None, :, None]
    state = {x: values[x] + shift for x, shift in zip(("beta", "gamma"), shifts, strict=True)}
    base = values.with_inputs(**state, v=1.0)
    h = [base["h_0"] + 0 * base["drag"]]
    base["recursion_parts"]  # computed once for all orders
    inputs = {"residual_0": _truncated_series(values, h, radius)}
    for n in _ORDERS[1:]:
        sums = _lower_order_sums(h, radius)
        inputs[f"h_{n}"] = {key: _mean_on_circles(x) for key, x in sums.items()} | {"v": 1.0}
        h += [
            EquationValues(base.definitions, {**base.inputs, **sums}, dict(base.computed))["h_next"]
        ]
        inputs[f"residual_{n}"] = _truncated_series(values, h, radius)
    return inputs


def _lower_order_sums(h: list[Array], radius: Array) -> dict[str, Any]:
    """Return the sums over lower orders from which the next order is computed, by symbol.

    The wrong sums that people write in their place are among them.

    Args:
        h: The orders so far, each by its values on circles about each state.
        radius: The radius of the circles [rad], one to an entry.
    """
    slopes, back = [_slope(one, 0, radius) for one in h], list(reversed(h))
    products = [a * b for a, b in zip(back, slopes, strict=True)]
    return {
        "first": np.float64(len(h) == 1),
        "h_h": sum(a * b for a, b in zip(h, back, strict=True)),
        "h_dh": sum(products),
        "h_last": h[-1],
        "dh_last": _slope(h[-1], 1, radius),
        # The wrong sums that people write in their place
        "h_zero": h[0],
        "dh_zero": _slope(h[0], 1, radius),
        "dh_other": slopes[-1],
        "h_h_last": h[-1] ** 2,
        "h_h_zero": h[0] * h[-1],
        "h_h_own": sum(a**2 for a in h),
        "h_dh_zero": h[0] * slopes[-1],
        "h_dh_own": sum(a * b for a, b in zip(h, slopes, strict=True)),
        "h_dh_last": h[-1] * slopes[-1],
        "h_dh_short": sum(products[:-1]) + 0 * h[0],
    }


def _mean_on_circles(x: Any) -> Any:
    return x.mean(axis=(0, 1)).real if np.ndim(x) == 3 else x


def _truncated_series(values: EquationValues, h: list[Array], radius: Array) -> dict[str, Any]:
    """Return v and its derivatives with respect to beta and gamma by the series so far, by symbol.

    Names with ``_last`` stand for the last term alone, and those with ``_before`` for the other
    terms.

    Args:
        values: The definitions with the inputs of the entries.
        h: The orders so far, each by its values on circles about each state.
        radius: The radius of the circles [rad], one to an entry.
    """
    sums, slopes = dict[str, Any](), [[_slope(one, axis, radius) for one in h] for axis in (0, 1)]
    for name, orders in zip(("v", "slope_beta", "slope_gamma"), (h, *slopes), strict=True):
        terms = [values["epsilon"] ** k * _mean_on_circles(one) for k, one in enumerate(orders)]
        sums[name], sums[f"{name}_last"] = sum(terms), terms[-1]
        sums[f"{name}_before"] = sum(terms[:-1]) + 0 * values["epsilon"]
    return sums


# Functions that compute further inputs of the definitions by quantity, for some kinds
_FURTHER_INPUTS: dict[str, Callable[[EquationValues], dict[str, dict[str, Any]]]] = {
    "hopf": hopf_inputs,
    "slow-manifold": slow_manifold_inputs,
}
#: Functions that compute the quantities of a kind from a program's values, by different formulas
PREDICTIONS: dict[str, tuple[Callable[[EquationValues], Results], ...]] = {
    **{kind: (partial(predict_results, kind),) for kind in _DEFINITIONS},
    "equilibrium": (
        lambda values: _spectrum(
            linearised_matrices(values, ("Omega", *_DEFINITIONS["equilibrium"]))
        ),
        lambda values: _spectrum(linearised_matrices(values)),
    ),
}
# States and speeds at which the equations are linearised by mistake, by the sentence about it
_WRONG_EQUILIBRIA = {
    "noninverted spinning is taken at (3 pi/2, pi/2, 0)": {
        "beta": "pi - 1/2 side pi",
        "gamma": "1/2 pi",
    },
    "noninverted spinning is taken at gamma = 0": {"gamma": "1/4 pi + 1/4 side pi"},
    "inverted spinning is taken for both equilibria": {"gamma": "1/2 pi"},
    "noninverted spinning is taken for both equilibria": {"gamma": "-1/2 pi"},
    "both equilibria are taken at gamma = 0": {"gamma": "0"},
    "the equilibria are taken at beta = 0": {"beta": "0"},
    "the eigenvalues are at Omega_crit": {"Omega": "sqrt(omega_crit_squared)"},
    "the eigenvalues are at Omega = 30.92": {"Omega": "30.92"},
    "the eigenvalues are at the first entry's Omega": {"Omega": "first(Omega)"},
}
# Matrices by which the right one is multiplied from the left, by the sentence about the mistake
_MATRIX_FACTORS = {
    "the matrix has the rows of gamma and v exchanged": np.eye(3)[[0, 2, 1]],
    "the matrix has the rows of beta and gamma exchanged": np.eye(3)[[1, 0, 2]],
    "the matrix has no d(gamma')/d(beta)": np.diag([1.0, 0.0, 1.0]),
    "d(gamma')/d(beta) has the wrong sign in the matrix": np.diag([1.0, -1.0, 1.0]),
    "the matrix has the wrong sign": -np.eye(3),
}
# Keys by which eigenvalues may be sorted
_SORT_KEYS: dict[str, Callable[[Array], Array]] = {
    "real parts": np.real,
    "moduli": np.abs,
    "imaginary parts": np.imag,
    "moduli of the imaginary parts": lambda z: np.abs(z.imag),
}
_IDENTITY_MATRIX = np.eye(3)


def _mistaken_spectrum(
    place: Mapping[str, str] | None = None, factor: Array = _IDENTITY_MATRIX, **how: Any
) -> Callable[[EquationValues], Results]:
    """Return a function that computes eigenvalues with a mistake, from a program's values.

    Args:
        place: The state and speed at which the equations are linearised instead.
        factor: A matrix by which the right one is multiplied from the left.
        how: Options of `_spectrum`, by which the eigenvalues are found and sorted.
    """
    return lambda values: _spectrum(factor @ linearised_matrices(values, **(place or {})), **how)


#: Functions that compute the quantities of a kind with a mistake, by the sentence about it
MISTAKEN_PREDICTIONS: dict[str, dict[str, Callable[[EquationValues], Results]]] = {
    "equilibrium": {
        **{
            sentence: _mistaken_spectrum(place=place)
            for sentence, place in _WRONG_EQUILIBRIA.items()
        },
        **{
            sentence: _mistaken_spectrum(factor=factor)
            for sentence, factor in _MATRIX_FACTORS.items()
        },
        **{
            f"the eigenvalues are those of a symmetric matrix ({part} part)": _mistaken_spectrum(
                solve=partial(np.linalg.eigvalsh, UPLO=part[0].upper())
            )
            for part in ("lower", "upper")
        },
        **{
            f"the eigenvalues are in another order: {sense} {text}"
            f", the {sign} imaginary part first": _mistaken_spectrum(
                key=key, key_direction=key_direction, imaginary_direction=sign_direction
            )
            for text, key in _SORT_KEYS.items()
            for key_direction, sense in ((1, "ascending"), (-1, "descending"))
            for sign_direction, sign in ((1, "negative"), (-1, "positive"))
        },
    },
}


@np.errstate(all="ignore")
def predicted_answers(
    table: Table,
    change_set: Iterable[Change],
    function: Callable[[EquationValues], Results] | None = None,
) -> Array:
    """Return the answers that a program with some mistakes would give to a table's questions.

    They are NaN where the program computes no value.

    Args:
        table: The table, with the inputs of its entries.
        change_set: The changes of the equations that the program has.
        function: A function from the program's values to the quantities; by default the right
            formulas.
    """
    values = program_with_changes(table.friction, change_set, table.inputs)
    return table.matched_values((function or PREDICTIONS[table.kind][0])(values))


# ---- the searches
def regression_problems(table: Table, change_set: Iterable[Change]) -> list[RegressionProblem]:
    """Return the quantities of a table in which mistakes can be searched for, each as a problem.

    A problem has the answers to one quantity and its definition. The problems are in the order of
    the equations. Where a definition depends on other quantities, the program's own answers to them
    are used, so that a mistake in them is not counted twice. Derivatives of v' are no problems: wrong
    ones follow from the equations, or from how they are computed.

    Args:
        table: The table.
        change_set: The changes of the equations that the program is known to have.
    """
    base = program_with_changes(table.friction, change_set, table.inputs)
    base = base.with_inputs(
        **{
            definition: np.where(
                np.isfinite(answer := table.column(name).answer), answer, base[definition]
            )
            for name, definition in _REPLACED_BY_ANSWERS.items()
            if name in table.names
        }
    )
    parts = _FURTHER_INPUTS[table.kind](base) if table.kind in _FURTHER_INPUTS else {}
    matrix_entries = (
        _answered_matrix_entries(table, base["Omega"]) if table.kind == "equilibrium" else {}
    )
    problems = []
    for name, definition in _DEFINITIONS.get(table.kind, {}).items():
        answers = matrix_entries.get(name) or table.column(name)
        rows = np.flatnonzero(np.isfinite(answers.answer))
        inputs = {**base.inputs, **parts.get(name, {})}
        problems += [
            RegressionProblem(
                answers.answer[rows],
                answers.truth[rows],
                answers.allowed[rows],
                answers.unexplained[rows],
                table,
                name,
                definition,
                _IDENTITIES.get(definition, f"answer - {definition}"),
                {key: x[rows] if np.ndim(x) else x for key, x in inputs.items()},
            )
        ]
    return [
        problem for problem in problems if problem.answer.size and problem.name not in _DERIVATIVES
    ]


def _answered_matrix_entries(table: Table, omega: Array) -> dict[str, ComparedAnswers]:
    """Return A_31, A_32 and A_33 of the matrices that have the answered eigenvalues, by name.

    They follow from the coefficients of the characteristic polynomial. They count as wrong where
    they differ from those of the true eigenvalues by more than is allowed.

    Args:
        table: The table of the eigenvalues.
        omega: The speed of each entry.
    """
    cells = [[table.column(f"lambda_{n}_{part}") for part in ("re", "im")] for n in (1, 2, 3)]
    allowed_sum = sum(re.allowed + im.allowed for re, im in cells)
    answers, truths = (
        np.array([getattr(re, which) + 1j * getattr(im, which) for re, im in cells])
        for which in ("answer", "truth")
    )
    size = np.abs(truths).sum(axis=0)
    right, entries = _coefficients(truths, omega), dict[str, ComparedAnswers]()
    for name, answer in _coefficients(answers, omega).items():
        allowed = allowed_sum * {"A_31": size, "A_32": size**2 / omega}.get(name, 1.0)
        entries[name] = ComparedAnswers(
            answer, right[name], allowed, np.abs(answer - right[name]) > allowed
        )
    return entries


def _coefficients(z: Array, omega: Array) -> dict[str, Array]:
    pairs = z[0] * z[1] + z[0] * z[2] + z[1] * z[2]
    return dict(
        zip(
            _DEFINITIONS["equilibrium"],
            (-pairs.real, z.prod(axis=0).real / omega, z.sum(axis=0).real),
            strict=True,
        )
    )
