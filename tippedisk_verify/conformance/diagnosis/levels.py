"""Levels 1 to 5: the predictions of definitions for a table's entries, and the searches for single
quantities.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Table
from tippedisk_verify.conformance.diagnosis.regression import Problem
from tippedisk_verify.conformance.diagnosis.terms import IMAGINARY_STEP, Values

__all__ = ["PARTS", "PREDICTED", "base_of", "matrix", "problems"]

Results = dict[str, Any]  #: by a quantity's name, one value to an entry
Cells = Mapping[str, Array]  #: answer, truth, allowed and left of a quantity, by entry
#: In their order
PARTS = ("Bbar", "gamma_rate", "w_y", "f_G", "gamma_y", "M", "h_1", "h_2", "h_3", "h_4", "h_5", "h")
_RATES = (*PARTS, "lambda_Ty", "v_rate", "dv_rate_dbeta", "dv_rate_dgamma", "dv_rate_dv")
_HOPF = (
    "omega_crit",
    "period",
    "transversality",
    "first_lyapunov_coefficient",
    "amplitude_squared_slope",
    "period_slope",
)
#: Sums that vanish, linear in the definitions' terms; of other quantities it is the answer less the
#: definition.
_IDENTITIES = {
    "v_rate": "M answer - force",
    "amplitude_squared": "(r + e) denominator answer + 4 e excess",
    "h_next": "drag answer - recursion",
}
_ORDERS = range(6)
_NODES, _RADIUS = 16, 0.09  #: of the circles [rad] on which the slow manifold is differentiated
_TURN = np.exp(2j * np.pi * np.arange(_NODES) / _NODES)


def base_of(definitions: Mapping[str, Any], table: Table, **more: Any) -> Values:
    """The definitions with the inputs of a table's entries."""
    side = np.where(table.given["equilibrium"] == "noninverted", -1.0, 1.0)
    words = {"side": side, "consistent": (table.given["form"] == "consistent") * 1.0, "pi": np.pi}
    return Values(definitions, {**table.given, **words, **more})


# ---- what definitions predict
def rates(values: Values) -> Results:
    """Level 1: every definition is an answer."""
    return {name: values[name] for name in _RATES}


def matrix(values: Values, **given: Any) -> Array:
    """The matrix of the linearised equations, at the equilibrium unless other inputs are given."""
    at = Values(
        values.definitions,
        {**values.given, "beta": np.pi / 2, "gamma": values["side"] * np.pi / 2, "v": 0.0, **given},
    )
    found = np.zeros((len(values["r"]), 3, 3))
    found[:, 0, 2], found[:, 1, 0] = 1.0, at["d(gamma_rate)/d(beta)"]
    found[:, 2] = np.moveaxis(
        np.array([at[f"dv_rate_d{x}"] + 0 * at["Omega"] for x in ("beta", "gamma", "v")]), 0, -1
    )
    return found


def _closed_matrix(values: Values) -> Array:
    found = np.zeros((len(values["r"]), 3, 3))
    found[:, 0, 2], found[:, 1, 0] = 1.0, values["Omega"]
    found[:, 2] = np.array([values[f"A_3{n}"] for n in (1, 2, 3)]).T
    return found


def _spectrum(
    values: Values,
    of: Callable[[Values], Array],
    solve: Callable[[Array], Array] = np.linalg.eigvals,
) -> Results:
    """Level 2: the eigenvalues of a matrix, by descending real part, then imaginary part."""
    here = of(values)
    finite = np.asarray(np.isfinite(here).all(axis=(1, 2)))
    z = solve(np.where(finite[:, None, None], here, 0.0)).astype(complex)
    z = np.take_along_axis(z, np.lexsort((-z.imag, -np.round(z.real, 9)), axis=-1), axis=-1)
    return {
        f"lambda_{n + 1}_{part}": of(z[:, n])
        for n in range(3)
        for part, of in (("re", np.real), ("im", np.imag))
    }


def _where_noninverted(values: Values, **given: Any) -> Array:
    return np.where((values["side"] < 0)[:, None, None], matrix(values, **given), matrix(values))


def _at_critical_speed(values: Values) -> Array:
    return matrix(values, Omega=np.sqrt(values["omega_crit_squared"]))


def _scaled(row: int, column: int | slice, factor: float, values: Values) -> Array:
    found = matrix(values)
    found[:, row, column] *= factor
    return found


def hopf(values: Values) -> Results:
    """Level 3, from the Taylor coefficients of the equations."""
    speed = np.sqrt(values["omega_crit_squared"] + 0 * values["r"])
    at = Values(values.definitions, {**values.given, **normal_form(values, speed)})
    return {name: at["hopf_period" if name == "period" else name] for name in _HOPF}


@np.errstate(all="ignore")
def normal_form(values: Values, speed: Array) -> dict[str, Array]:
    """Return the parts of the definitions of level 3 at a speed: sums over the eigenvectors."""
    j = matrix(values, Omega=speed)
    omega = np.sqrt(-j[:, 2, 0])
    q = np.array([1j * omega, j[:, 1, 0], -(omega**2)])
    p = np.array([1j * omega * (1j * omega - j[:, 2, 2]), j[:, 2, 1] + 0j, 1j * omega])
    raw = p
    q, p = (x / np.sqrt((np.abs(x) ** 2).sum(axis=0)) for x in (q, p))
    c = [_cubic(values, speed, x) for x in (q + q.conj(), q - q.conj(), q.conj())]
    cubic, product = (c[0] - c[1] - 2 * c[2]) / 6, (p * q).sum(axis=0)
    by_speed = (matrix(values, Omega=1.5 * speed) - matrix(values, Omega=0.5 * speed)) / speed[
        :, None, None
    ]  # of squares
    found = {"hopf_speed": speed, "derived_omega": omega}
    found |= {f"q_{name}": np.abs(x) for name, x in zip(("beta", "gamma", "v"), q, strict=True)}
    for prefix, a in {
        "": p / product,
        "bare_": p,
        "raw_": raw,
        "turned_": p / product.conj(),
        "right_": q.conj(),
    }.items():
        sums = {
            "g_gamma": a[1] * cubic[0],
            "g_v": a[2] * cubic[1],
            "rate_21": a[1] * by_speed[:, 1, 0] * q[0],
        }
        sums |= {f"rate_3{n + 1}": a[2] * by_speed[:, 2, n] * q[n] for n in (0, 1)}
        found |= {
            f"{prefix}{name}_{part}": of(z)
            for name, z in sums.items()
            for part, of in (("real", np.real), ("imag", np.imag))
        }
    return found


def _cubic(values: Values, speed: Array, q: Array) -> Array:
    """The third derivatives of gamma' and v' along a direction, from values on a circle."""
    turn = np.exp(2j * np.pi * np.arange(32) / 32)[:, None]
    radius = 0.2 / np.sqrt((np.abs(q) ** 2).sum(axis=0))
    state = {
        x: place + turn * radius * part
        for x, place, part in zip(
            ("beta", "gamma", "v"), (np.pi / 2, np.pi / 2, 0.0), q, strict=True
        )
    }
    at = Values(values.definitions, {**values.given, **state, "Omega": speed})
    return np.array(
        [np.mean(at[name] / turn**3, axis=0) * 6 / radius**3 for name in ("gamma_rate", "v_rate")]
    )


def harmonic(values: Values) -> Results:
    """Level 4: the one-harmonic law."""
    square = values["amplitude_squared"]
    frequency = np.sqrt(
        Values(values.definitions, {**values.given, "answered_squared": square})[
            "frequency_squared"
        ]
    )
    return {"amplitude": np.sqrt(square), "frequency": frequency, "period": 2 * np.pi / frequency}


def _slope(f: Array, axis: int, radius: Array) -> Array:
    """The derivative by beta (axis 0) or gamma (1) of a function that is known on circles
    about each state.
    """
    k, shape = np.arange(_NODES), [-1 if n == axis else 1 for n in range(3)]
    return np.asarray(
        np.fft.ifft(np.fft.fft(f, axis=axis) * k.reshape(shape), axis=axis)
        / (radius * _TURN.reshape(shape))
    )


def radius_of(values: Values) -> Array:
    """The radius of the circles about each state: small near sin(beta) = 0, where the orders
    diverge.
    """
    return np.asarray(_RADIUS * np.abs(np.sin(values["beta"])))


def orders(values: Values, last: int) -> tuple[list[Array], Callable[[int], dict[str, Any]]]:
    """The orders of the slow manifold on circles about each state, and what goes into the
    recursion for each.
    """
    radius = radius_of(values)
    shifts = radius * _TURN[:, None, None], radius * _TURN[None, :, None]
    state = {x: values[x] + shift for x, shift in zip(("beta", "gamma"), shifts, strict=True)}
    definitions = {name: terms for name, terms in values.definitions.items() if name not in state}
    base = Values(definitions, {**values.given, **state, "v": 1.0})
    h = [base["h_0"] + 0 * base["drag"]]

    def sums(n: int) -> dict[str, Any]:
        slopes, back = [_slope(one, 0, radius) for one in h[:n]], list(reversed(h[:n]))
        products = [a * b for a, b in zip(back, slopes, strict=True)]
        found = {
            "h_h": sum(a * b for a, b in zip(h, back, strict=False)),
            "h_dh": sum(products),
            "h_last": h[n - 1],
        }
        found |= {
            "dh_last": _slope(h[n - 1], 1, radius),
            "h_zero": h[0],
            "dh_zero": _slope(h[0], 1, radius),
            "dh_other": slopes[-1],
        }
        found |= {
            "h_h_last": h[n - 1] ** 2,
            "h_h_zero": h[0] * h[n - 1],
            "h_dh_zero": h[0] * slopes[-1],
        }
        found |= {
            "h_h_own": sum(a**2 for a in h[:n]),
            "h_dh_own": sum(a * b for a, b in zip(h, slopes, strict=False)),
        }
        found["h_dh_last"] = h[n - 1] * slopes[-1]
        return {**found, "h_dh_short": sum(products[:-1]) + 0 * h[0], "first": np.float64(n == 1)}

    base["recursion_parts"]  # kept for all orders
    for n in range(1, last + 1):
        h += [Values(base.definitions, {**base.given, **sums(n)}, base.known)["h_next"]]
    return h, sums


def manifold(values: Values) -> Results:
    """Level 5: the orders of the slow manifold, and what they leave of the invariance equation."""
    h, _ = orders(values, _ORDERS[-1])
    found = {f"h_{n}": _centre(one) for n, one in enumerate(h)}
    sums = [
        Values(values.definitions, {**values.given, **_partial(values, h[: n + 1])})
        for n in _ORDERS
    ]
    return found | {f"residual_{n}": one["residual"] for n, one in enumerate(sums)}


def _centre(x: Any) -> Any:
    return x.mean(axis=(0, 1)).real if np.ndim(x) == 3 else x


def _partial(values: Values, h: list[Array]) -> dict[str, Any]:
    """v and its derivatives by the series up to an order, and those of its last term and
    without it.
    """
    radius = radius_of(values)
    found: dict[str, Any] = {}
    series = {
        "v": h,
        "slope_beta": [_slope(one, 0, radius) for one in h],
        "slope_gamma": [_slope(one, 1, radius) for one in h],
    }
    for name, orders_of in series.items():
        terms = [values["epsilon"] ** k * _centre(one) for k, one in enumerate(orders_of)]
        found |= {
            name: sum(terms),
            f"{name}_last": terms[-1],
            f"{name}_before": sum(terms[:-1]) + 0 * values["epsilon"],
        }
    return found


#: Wrong matrices in place of that of the linearised equations, by the sentence about the answers.
_MATRICES: dict[str, Callable[[Values], Array]] = {
    "noninverted spinning is taken at (3 pi/2, pi/2, 0)": partial(
        _where_noninverted, beta=1.5 * np.pi, gamma=np.pi / 2
    ),
    "noninverted spinning is taken at gamma = 0": partial(_where_noninverted, gamma=0.0),
    "inverted spinning is taken for both equilibria": partial(matrix, gamma=np.pi / 2),
    "noninverted spinning is taken for both equilibria": partial(matrix, gamma=-np.pi / 2),
    "both equilibria are taken at gamma = 0": partial(matrix, gamma=0.0),
    "the equilibria are taken at beta = 0": partial(matrix, beta=0.0),
    "the eigenvalues are at Omega_crit": _at_critical_speed,
    "the eigenvalues are at Omega = 30.92": partial(matrix, Omega=30.92),
    "the eigenvalues are at the first entry's Omega": lambda values: matrix(
        values, Omega=values["Omega"][0]
    ),
    "the matrix has the rows of gamma and v exchanged": lambda values: matrix(values)[:, [0, 2, 1]],
    "the matrix has the rows of beta and gamma exchanged": lambda values: matrix(values)[
        :, [1, 0, 2]
    ],
    "the matrix has no d(gamma')/d(beta)": partial(_scaled, 1, 0, 0.0),
    "d(gamma')/d(beta) has the wrong sign in the matrix": partial(_scaled, 1, 0, -1.0),
    "the matrix has the wrong sign": lambda values: -matrix(values),
}
#: By kind of question, the functions that answers may come from, by their sentence. The right
#: functions come first, with an empty sentence.
PREDICTED: dict[str, dict[str, Callable[[Values], Results]]] = {
    "rhs": {"": rates},
    "hopf": {"": hopf},
    "harmonic-balance": {"": harmonic},
    "slow-manifold": {"": manifold},
    "equilibrium": {
        "": partial(_spectrum, of=_closed_matrix),
        " ": partial(_spectrum, of=matrix),
        **{says: partial(_spectrum, of=of) for says, of in _MATRICES.items()},
        "the eigenvalues are those of a symmetric matrix (lower part)": partial(
            _spectrum, of=matrix, solve=np.linalg.eigvalsh
        ),
        "the eigenvalues are those of a symmetric matrix (upper part)": partial(
            _spectrum, of=matrix, solve=partial(np.linalg.eigvalsh, UPLO="U")
        ),
    },
}


# ---- the searches
def problems(table: Table, definitions: Mapping[str, Any]) -> Iterator[Problem]:
    """The quantities of a table that can be looked for alone, in the order of the equations."""
    base = base_of(definitions, table)
    columns = {
        name: {
            x: table.column(name, getattr(table, x)) for x in ("answer", "truth", "allowed", "left")
        }
        for name in np.unique(table.names)
    }
    if table.kind == "rhs":
        yield from (_problem(name, base, columns[name]) for name in _RATES[:-3] if name in columns)
        yield from (_derivative(name, base, columns) for name in _RATES[-3:] if name in columns)
    elif table.kind == "equilibrium" and len(columns) == 6:
        yield from _coefficients(base, columns)
    elif table.kind == "hopf":
        speed = (
            columns["omega_crit"]["answer"]
            if "omega_crit" in columns
            else np.sqrt(base["omega_crit_squared"])
        )
        base = Values(definitions, {**base.given, **normal_form(base, speed)})
        yield from (
            _problem(name, base, columns[name], "hopf_period" if name == "period" else name)
            for name in _HOPF
            if name in columns
        )
    elif table.kind == "harmonic-balance":
        yield from _law(base, columns)
    elif table.kind == "slow-manifold":
        yield from _first_order(base, columns)


def _problem(name: str, base: Values, cells: Cells, definition: str = "", **given: Any) -> Problem:
    """The problem of a definition, where there are answers."""
    rows, definition = np.flatnonzero(np.isfinite(cells["answer"])), definition or name
    inputs = {key: x[rows] if np.ndim(x) else x for key, x in {**base.given, **given}.items()}
    answer, truth, allowed = (cells[x][rows] for x in ("answer", "truth", "allowed"))
    identity = _IDENTITIES.get(definition, f"answer - {definition}")
    return Problem(
        name, definition, answer, truth, allowed, cells["left"][rows] > 0, identity, inputs
    )


def _derivative(name: str, base: Values, columns: Mapping[str, Cells]) -> Problem:
    """The problem of a derivative of v', with the answers to v' itself where there are some."""
    variable = name.removeprefix("dv_rate_d")
    rate = columns["v_rate"]["answer"] if "v_rate" in columns else base["v_rate"]
    stepped = {variable: base[variable] + IMAGINARY_STEP * 1j, "rate": rate}
    problem = _problem(name, base, columns[name], "v_rate", **stepped)
    return replace(problem, rate=problem.given["rate"])


def _coefficients(base: Values, columns: Mapping[str, Cells]) -> Iterator[Problem]:
    """The entries of the matrix, from the coefficients of the eigenvalues' polynomial."""
    near = sum(columns[f"lambda_{n}_{part}"]["allowed"] for n in (1, 2, 3) for part in ("re", "im"))
    found = {}
    for which in ("answer", "truth"):
        z = [
            columns[f"lambda_{n}_re"][which] + 1j * columns[f"lambda_{n}_im"][which]
            for n in (1, 2, 3)
        ]
        pairs = z[0] * z[1] + z[0] * z[2] + z[1] * z[2]
        found[which] = (
            -pairs.real,
            (z[0] * z[1] * z[2]).real / base["Omega"],
            (z[0] + z[1] + z[2]).real,
        )
    size = np.abs(z).sum(axis=0)
    for n, unit in enumerate((size, size**2 / base["Omega"], 1.0)):
        answer, truth, allowed = found["answer"][n], found["truth"][n], near * unit
        cells = {
            "answer": answer,
            "truth": truth,
            "allowed": allowed,
            "left": np.abs(answer - truth) > allowed,
        }
        yield _problem(f"A_3{n + 1}", base, cells)


def _law(base: Values, columns: Mapping[str, Cells]) -> Iterator[Problem]:
    """The squares of amplitude and frequency, the latter as it follows from the answered
    amplitude; and the period.
    """
    squares = {}
    for name in ("amplitude", "frequency"):
        if name in columns:
            truth = np.abs(columns[name]["truth"])
            squares[name] = {
                **columns[name],
                "answer": columns[name]["answer"] ** 2,
                "truth": truth**2,
            }
            squares[name]["allowed"] = 2 * truth * columns[name]["allowed"]
    if "amplitude" in squares:
        yield _problem("amplitude", base, squares["amplitude"], "amplitude_squared")
    if len(squares) == 2:
        given = {"answered_squared": squares["amplitude"]["answer"]}
        yield _problem("frequency", base, squares["frequency"], "frequency_squared", **given)
    if "frequency" in columns and "period" in columns:
        yield _problem(
            "period",
            base,
            columns["period"],
            "law_period",
            answered_frequency=columns["frequency"]["answer"],
        )


def _first_order(base: Values, columns: Mapping[str, Cells]) -> Iterator[Problem]:
    """The first order that is wrong, with right ones before it; the first wrong residual if
    the orders are right.
    """
    failing = [
        name
        for name in (*(f"h_{n}" for n in _ORDERS), *(f"residual_{n}" for n in _ORDERS))
        if name in columns and (columns[name]["left"] > 0).any()
    ]
    for name in failing[:1]:
        n = int(name[-1])
        if name == "h_0":
            yield _problem(name, base, columns[name])
        elif name.startswith("h_"):
            more = {key: _centre(x) for key, x in orders(base, n - 1)[1](n).items()}
            yield _problem(name, base, columns[name], "h_next", v=1.0, **more)
        else:
            yield _problem(
                name, base, columns[name], "residual", **_partial(base, orders(base, n)[0])
            )
