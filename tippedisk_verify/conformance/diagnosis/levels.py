"""Levels 1 to 5: what definitions predict for a table's entries, and the identities by which the
answers to single quantities are searched.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Answered, Array, Table
from tippedisk_verify.conformance.diagnosis.regression import Problem
from tippedisk_verify.conformance.diagnosis.terms import Values

__all__ = ["PREDICTED", "VARIANTS", "Results", "base_of", "problems"]

Results = dict[str, Any]  #: by a quantity's name, one value to an entry
#: The quantities of level 1, in the order of the equations, and the derivatives of the last one.
_RATES = (
    "Bbar",
    "gamma_rate",
    "w_y",
    "f_G",
    "gamma_y",
    "M",
    "h_1",
    "h_2",
    "h_3",
    "h_4",
    "h_5",
    "h",
    "lambda_Ty",
    "v_rate",
)
_DERIVATIVES = ("dv_rate_dbeta", "dv_rate_dgamma", "dv_rate_dv")
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
    **{
        f"answered_d{x}": f"M answer + d(M)/d({x}) answered_rate - d(force)/d({x})"
        for x in ("beta", "gamma", "v")
    },
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
    """Return the quantities of level 1, each of which is a definition."""
    return {name: values[name] for name in (*_RATES, *_DERIVATIVES)}


def matrix(values: Values, **place: Any) -> Array:
    """Return the matrices of the linearised equations, one to an entry.

    Args:
        values: The definitions with the inputs of the entries.
        place: State and speed, as numbers or as text; by default the entry's equilibrium and speed.
    """
    place = {"beta": "1/2 pi", "gamma": "1/2 side pi", "v": "0", **place}
    numbers = {x: values[f"({at})"] if isinstance(at, str) else at for x, at in place.items()}
    at = values.at(**numbers)
    return _assembled(at["d(gamma_rate)/d(beta)"], [at[name] for name in _DERIVATIVES], values)


def _closed_matrix(values: Values) -> Array:
    """Return the matrices by the closed forms of their entries."""
    return _assembled(values["Omega"], [values[name] for name in ("A_31", "A_32", "A_33")], values)


def _assembled(gamma_slope: Any, last_row: list[Any], values: Values) -> Array:
    """Return the matrices of beta' = v, gamma' and v' from their entries that are not constant."""
    found = np.zeros((len(values["r"]), 3, 3))
    found[:, 0, 2], found[:, 1, 0] = 1.0, gamma_slope
    found[:, 2, 0], found[:, 2, 1], found[:, 2, 2] = last_row
    return found


def _spectrum(matrices: Array, solve: Callable[[Array], Array] = np.linalg.eigvals) -> Results:
    """Return the eigenvalues of matrices, by descending real part, then imaginary part."""
    finite = np.isfinite(matrices).all(axis=(1, 2), keepdims=True)
    z = solve(np.where(finite, matrices, 0.0)).astype(complex)
    z = np.take_along_axis(z, np.lexsort((-z.imag, -np.round(z.real, 9)), axis=-1), axis=-1)
    found = {f"lambda_{n + 1}_re": z[:, n].real for n in range(3)}
    return found | {f"lambda_{n + 1}_im": z[:, n].imag for n in range(3)}


def hopf(values: Values) -> Results:
    """Level 3, from the Taylor coefficients of the equations."""
    speed = np.sqrt(values["omega_crit_squared"] + 0 * values["r"])
    at = values.at(**normal_form(values, speed))
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
    faster, slower = matrix(values, Omega=1.5 * speed), matrix(values, Omega=0.5 * speed)
    by_speed = (faster - slower) / speed[:, None, None]  # exact, of squares of the speed
    found = {"hopf_speed": speed, "derived_omega": omega}
    found |= {f"q_{name}": np.abs(x) for name, x in zip(("beta", "gamma", "v"), q, strict=True)}
    # The component of the adjoint eigenvector, and what it is multiplied by
    parts = {
        "g_gamma": (1, cubic[0]),
        "g_v": (2, cubic[1]),
        "rate_21": (1, by_speed[:, 1, 0] * q[0]),
        "rate_31": (2, by_speed[:, 2, 0] * q[0]),
        "rate_32": (2, by_speed[:, 2, 1] * q[1]),
    }
    scaled = {"": p / product, "bare_": p, "raw_": raw, "turned_": p / product.conj()}
    for prefix, adjoint in {**scaled, "right_": q.conj()}.items():
        for name, (row, factor) in parts.items():
            found[f"{prefix}{name}_real"] = (adjoint[row] * factor).real
            found[f"{prefix}{name}_imag"] = (adjoint[row] * factor).imag
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
    at = values.at(**state, Omega=speed)
    return np.array(
        [np.mean(at[name] / turn**3, axis=0) * 6 / radius**3 for name in ("gamma_rate", "v_rate")]
    )


def harmonic(values: Values) -> Results:
    """Level 4: the one-harmonic law."""
    square = values["amplitude_squared"]
    frequency = np.sqrt(values.at(answered_squared=square)["frequency_squared"])
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
        return {
            "first": np.float64(n == 1),
            "h_h": sum(a * b for a, b in zip(h, back, strict=False)),
            "h_dh": sum(products),
            "h_last": h[n - 1],
            "dh_last": _slope(h[n - 1], 1, radius),
            # What is written in their place
            "h_zero": h[0],
            "dh_zero": _slope(h[0], 1, radius),
            "dh_other": slopes[-1],
            "h_h_last": h[n - 1] ** 2,
            "h_h_zero": h[0] * h[n - 1],
            "h_h_own": sum(a**2 for a in h[:n]),
            "h_dh_zero": h[0] * slopes[-1],
            "h_dh_own": sum(a * b for a, b in zip(h, slopes, strict=False)),
            "h_dh_last": h[n - 1] * slopes[-1],
            "h_dh_short": sum(products[:-1]) + 0 * h[0],
        }

    base["recursion_parts"]  # kept for all orders
    for n in range(1, last + 1):
        h += [Values(base.definitions, {**base.given, **sums(n)}, dict(base.known))["h_next"]]
    return h, sums


def manifold(values: Values) -> Results:
    """Level 5: the orders of the slow manifold, and what they leave of the invariance equation."""
    h, _ = orders(values, _ORDERS[-1])
    found = {f"h_{n}": _centre(one) for n, one in enumerate(h)}
    for n in _ORDERS:
        found[f"residual_{n}"] = values.at(**_partial(values, h[: n + 1]))["residual"]
    return found


def _centre(x: Any) -> Any:
    return x.mean(axis=(0, 1)).real if np.ndim(x) == 3 else x


def _partial(values: Values, h: list[Array]) -> dict[str, Any]:
    """Return v and its derivatives by the series up to an order, by its last term only, and
    without it.
    """
    radius, found = radius_of(values), dict[str, Any]()
    slopes = {
        "slope_beta": [_slope(one, 0, radius) for one in h],
        "slope_gamma": [_slope(one, 1, radius) for one in h],
    }
    for name, series in {"v": h, **slopes}.items():
        terms = [values["epsilon"] ** k * _centre(one) for k, one in enumerate(series)]
        found[name], found[f"{name}_last"] = sum(terms), terms[-1]
        found[f"{name}_before"] = sum(terms[:-1]) + 0 * values["epsilon"]
    return found


#: Functions that give the right answers to questions of a kind, by different formulas
PREDICTED: dict[str, tuple[Callable[[Values], Results], ...]] = {
    "rhs": (rates,),
    "equilibrium": (
        lambda values: _spectrum(_closed_matrix(values)),
        lambda values: _spectrum(matrix(values)),
    ),
    "hopf": (hopf,),
    "harmonic-balance": (harmonic,),
    "slow-manifold": (manifold,),
}
#: Places at which the equations are linearised instead, by the sentence about the eigenvalues
_PLACES = {
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
#: Matrices that multiply the right one from the left, by the sentence about it
_FACTORS = {
    "the matrix has the rows of gamma and v exchanged": np.eye(3)[[0, 2, 1]],
    "the matrix has the rows of beta and gamma exchanged": np.eye(3)[[1, 0, 2]],
    "the matrix has no d(gamma')/d(beta)": np.diag([1.0, 0.0, 1.0]),
    "d(gamma')/d(beta) has the wrong sign in the matrix": np.diag([1.0, -1.0, 1.0]),
    "the matrix has the wrong sign": -np.eye(3),
}


_UNIT = np.eye(3)


def _variant(
    place: Mapping[str, str] | None = None, factor: Array = _UNIT, symmetric: str = ""
) -> Callable[[Values], Results]:
    """Return the function that gives the eigenvalues of another matrix.

    Args:
        place: State and speed that replace the right ones.
        factor: Matrix that multiplies the right one from the left.
        symmetric: "L" or "U" for the symmetric matrix with this lower or upper part.
    """
    solve = partial(np.linalg.eigvalsh, UPLO=symmetric) if symmetric else np.linalg.eigvals
    return lambda values: _spectrum(factor @ matrix(values, **(place or {})), solve)


#: Functions that give all answers of a kind where something else was computed, by their sentence
VARIANTS: dict[str, dict[str, Callable[[Values], Results]]] = {
    "equilibrium": {
        **{says: _variant(place=place) for says, place in _PLACES.items()},
        **{says: _variant(factor=factor) for says, factor in _FACTORS.items()},
        **{
            f"the eigenvalues are those of a symmetric matrix ({part} part)": _variant(
                symmetric=part[0].upper()
            )
            for part in ("lower", "upper")
        },
    },
}


# ---- the searches
def problems(table: Table, definitions: Mapping[str, Any]) -> list[Problem]:
    """Return the quantities of a table that can be searched alone, in the order of the
    equations.
    """
    found = _PROBLEMS[table.kind](table, base_of(definitions, table))
    return [problem for problem in found if problem.answer.size]


def _problem(
    name: str, base: Values, cells: Answered, definition: str = "", **given: Any
) -> Problem:
    """Return the problem of a definition, where there are answers."""
    rows, definition = np.flatnonzero(np.isfinite(cells.answer)), definition or name
    inputs = {key: x[rows] if np.ndim(x) else x for key, x in {**base.given, **given}.items()}
    return Problem(
        cells.answer[rows],
        cells.truth[rows],
        cells.allowed[rows],
        cells.left[rows],
        name,
        definition,
        _IDENTITIES.get(definition, f"answer - {definition}"),
        inputs,
    )


def _or_else(answers: Array, values: Any) -> Array:
    """Return answers, and other values where there are none."""
    return np.where(np.isfinite(answers), answers, values)


def _of_rates(table: Table, base: Values) -> Iterator[Problem]:
    """Level 1: the definitions, and the derivatives of v' with the answers to v' itself."""
    for name in _RATES:
        yield _problem(name, base, table.column(name))
    rate = _or_else(table.column("v_rate").answer, base["v_rate"])
    for name in _DERIVATIVES:
        definition = name.replace("dv_rate", "answered")
        yield _problem(name, base, table.column(name), definition, answered_rate=rate)


def _of_matrix(table: Table, base: Values) -> Iterator[Problem]:
    """Level 2: the entries of the matrix, from the coefficients of the eigenvalues' polynomial."""
    cells = [[table.column(f"lambda_{n}_{part}") for part in ("re", "im")] for n in (1, 2, 3)]
    z = np.array([re.answer + 1j * im.answer for re, im in cells])
    right = np.array([re.truth + 1j * im.truth for re, im in cells])
    near, size = sum(re.allowed + im.allowed for re, im in cells), np.abs(right).sum(axis=0)
    answers, truths = _entries(z, base["Omega"]), _entries(right, base["Omega"])
    units = (size, size**2 / base["Omega"], 1.0)
    for n, (answer, truth, unit) in enumerate(zip(answers, truths, units, strict=True)):
        wrong = np.abs(answer - truth) > near * unit
        yield _problem(f"A_3{n + 1}", base, Answered(answer, truth, near * unit, wrong))


def _entries(z: Array, omega: Array) -> tuple[Array, Array, Array]:
    """Return A_31, A_32 and A_33 of a matrix with these eigenvalues."""
    pairs = z[0] * z[1] + z[0] * z[2] + z[1] * z[2]
    return -pairs.real, z.prod(axis=0).real / omega, z.sum(axis=0).real


def _of_hopf(table: Table, base: Values) -> Iterator[Problem]:
    """Level 3, at the answered speed."""
    speed = _or_else(table.column("omega_crit").answer, np.sqrt(base["omega_crit_squared"]))
    at = base.at(**normal_form(base, speed))
    for name in _HOPF:
        definition = "hopf_period" if name == "period" else name
        yield _problem(name, at, table.column(name), definition)


def _of_law(table: Table, base: Values) -> Iterator[Problem]:
    """Level 4: the squares of amplitude and frequency, and the period; each from the answer before
    it.
    """
    amplitude, frequency = (table.column(name) for name in ("amplitude", "frequency"))
    square = amplitude.squared()
    yield _problem("amplitude", base, square, "amplitude_squared")
    given = {"answered_squared": square.answer}
    yield _problem("frequency", base, frequency.squared(), "frequency_squared", **given)
    given = {"answered_frequency": frequency.answer}
    yield _problem("period", base, table.column("period"), "law_period", **given)


def _of_manifold(table: Table, base: Values) -> Iterator[Problem]:
    """Level 5: the first order that is wrong, with right ones before it; the first wrong residual
    if the orders are right.
    """
    names = [f"{stem}_{n}" for stem in ("h", "residual") for n in _ORDERS]
    wrong = [name for name in names if table.left[table.names == name].any()]
    for name in wrong[:1]:
        cells, n = table.column(name), int(name[-1])
        if name == "h_0":
            yield _problem(name, base, cells)
        elif name.startswith("h_"):
            more = {key: _centre(x) for key, x in orders(base, n - 1)[1](n).items()}
            yield _problem(name, base, cells, "h_next", v=1.0, **more)
        else:
            more = _partial(base, orders(base, n)[0])
            yield _problem(name, base, cells, "residual", **more)


_PROBLEMS = {
    "rhs": _of_rates,
    "equilibrium": _of_matrix,
    "hopf": _of_hopf,
    "harmonic-balance": _of_law,
    "slow-manifold": _of_manifold,
}
