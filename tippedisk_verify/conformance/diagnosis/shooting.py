"""Half orbits of cycles in double, many at once: where they end, what changes that, and the cycles that they close to.

Time is scaled so that all take one unit, and the variational equations run beside the states.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy

from tippedisk_verify.conformance.diagnosis.alternatives import CORRECT, Alternative, spelled
from tippedisk_verify.conformance.diagnosis.flights import Array
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.reference_values.store import Store

__all__ = ["Family", "HalfOrbits", "Slip", "closed_cycles", "half_orbits", "newton_step", "solved_each"]

_STEP = 1e-40  # imaginary
_TOLERANCE = 1e-11
_QUARTER = math.pi / 2
_ROUGH = 1e-7  # the tolerance of Newton's first steps
_LAST = 1e-4  # s, rad, rad/s; of a step after which it is the one asked for
_CLOSED = 1e-9  # s, rad, rad/s; of Newton's last step
_PASSES = 8
_LEAST = 6  # stored cycles between which others are guessed
_SCAN = 4000  # places at which a speed is looked up
_NEAREST = 1e-9  # rad/s; nearer to Omega_h doubles have no digits left
Slip = Callable[[Array], None]  # in the derivatives of the rates by the state and Omega, three rows


@dataclass(frozen=True)
class HalfOrbits:
    """Half orbits from (pi/2, pi/2 + gamma, v): their ends, and for each the three-row derivatives of these.

    ``change`` is d(end)/d(gamma, v, Omega) at fixed time, by slip, of shape (slips, 3, 3, orbits).
    """

    half: Array
    gamma: Array
    v: Array
    omega: Array
    end: Array
    speed: Array  #: the rates at the end
    change: Array
    divergence: Array  #: integral of dv'/dv, by slip
    deepest: Array  #: the largest pi/2 - beta
    shallower: Array  #: what gamma and v take off it, two rows

    def left(self) -> Array:
        """What the symmetry leaves of the section, of gamma and of v."""
        return numpy.stack([_QUARTER - self.end[0], _QUARTER - self.end[1] - self.gamma, -self.end[2] - self.v])


def half_orbits(
    set_name: str, friction: str, half: Array, gamma: Array, v: Array, omega: Array,
    slips: Sequence[tuple[str, Slip | None]] = (("", None),), tolerance: float = _TOLERANCE,
) -> HalfOrbits:  # fmt: skip
    """Half orbits of these lengths; slips are the variational equations' law ("" for the orbit's), and a change."""
    from scipy.integrate import solve_ivp

    count = len(omega)
    model = Model(Alternative("", ""), set_name, friction)
    steps = 1j * _STEP * numpy.eye(4)

    def jacobian(y: Array, law: str) -> tuple[Array, Array]:
        """Rates, and their derivatives by the state and Omega, three rows."""
        parts = spelled(CORRECT, numpy, model.p, omega, y, law)
        moved = y[:, None, :] + steps[:3, :, None]
        speeds = omega + steps[3][:, None]
        side = numpy.where(parts["gamma_y"] >= 0, 1.0, -1.0)
        found = spelled(CORRECT, numpy, model.p, speeds, moved, law, side)
        rows = numpy.zeros((3, 4, count))
        rows[0, 2] = 1.0
        rows[1], rows[2] = found["gamma_rate"].imag / _STEP, found["v_rate"].imag / _STEP
        return numpy.stack([y[2], parts["gamma_rate"], parts["v_rate"]]), rows

    def rates(t: float, flat: Array) -> Array:
        y, changes = flat[: 3 * count].reshape(3, count), flat[3 * count :].reshape(len(slips), 10, count)
        speed, right = jacobian(y, model.friction)
        found = []
        for (law, slip), change in zip(slips, changes, strict=True):
            rows = jacobian(y, law)[1] if law not in ("", model.friction) else right.copy()
            if slip is not None:
                slip(rows)
            matrix = change[:9].reshape(3, 3, count)
            moved = numpy.einsum("ijn,jkn->ikn", rows[:, :3], matrix)
            moved[:, 2] += rows[:, 3]
            found.append(numpy.concatenate([moved.reshape(9, count), rows[2, 2][None]]))
        return numpy.concatenate([(speed * half).ravel(), (numpy.stack(found) * half).ravel()])

    start = numpy.stack([numpy.full(count, _QUARTER), _QUARTER + gamma, v])
    begin = numpy.zeros((len(slips), 10, count))
    begin[:, [3, 7]] = 1.0  # d(gamma, v) / d(gamma, v)
    with numpy.errstate(all="ignore"):
        run = solve_ivp(rates, (0.0, 1.0), numpy.concatenate([start.ravel(), begin.ravel()]), method="DOP853",
                        rtol=tolerance, atol=tolerance, dense_output=True)  # fmt: skip
    lanes, at = numpy.arange(count), numpy.argmin(run.y[:count], axis=1)
    turn = run.t[at]
    for _ in range(_PASSES):  # where v = 0
        there = run.sol(turn)[: 13 * count].reshape(13, count, count)[:, lanes, lanes]
        y = there[:3]
        turn = numpy.clip(turn - y[2] / (half * jacobian(y, model.friction)[0][2]), 0.0, 1.0)
    end = run.y[: 3 * count, -1].reshape(3, count)
    changes = run.y[3 * count :, -1].reshape(len(slips), 10, count)
    speed = jacobian(end, model.friction)[0]
    change = changes[:, :9].reshape(len(slips), 3, 3, count)
    return HalfOrbits(half, gamma, v, omega, end, speed, change, changes[:, 9], _QUARTER - y[0], there[3:5])


def solved_each(matrices: Array, right: Array) -> Array:
    """The solution for each orbit, the last axis; NaN if one has none."""
    try:
        return numpy.linalg.solve(numpy.moveaxis(matrices, 2, 0), right.T[:, :, None])[:, :, 0].T
    except numpy.linalg.LinAlgError:
        return numpy.full_like(right, numpy.nan)


def newton_step(run: HalfOrbits) -> tuple[Array, Array]:
    """What Newton's method on the half map, with its time of return, adds to gamma and v."""
    change = run.change[0]
    by = change[:, :2] - numpy.einsum("in,jn->ijn", run.speed / run.speed[0], change[0, :2])
    matrix = numpy.eye(2)[:, :, None] + by[1:]
    left = run.left()[1:] - run.speed[1:] / run.speed[0] * run.left()[0]
    step = solved_each(matrix, left)
    return step[0], step[1]


def closed_cycles(
    set_name: str,
    friction: str,
    half: Array,
    gamma: Array,
    v: Array,
    omega: Array,
    of_amplitude: bool = False,
    tolerance: float = _TOLERANCE,
) -> HalfOrbits:
    """The cycles near such half orbits, at these speeds or with these gamma: not closed where Newton finds none."""
    rough = max(_ROUGH, tolerance)
    for _ in range(_PASSES):
        run = half_orbits(set_name, friction, half, gamma, v, omega, tolerance=rough)
        matrix = numpy.stack([run.speed, run.change[0, :, 2 if of_amplitude else 0], run.change[0, :, 1]], axis=1)
        matrix[1, 1] += 0.0 if of_amplitude else 1.0
        matrix[2, 2] += 1.0
        step = solved_each(matrix, run.left())
        if rough == tolerance and not abs(step).max() > _CLOSED:
            break
        rough = tolerance if abs(step).max() < _LAST else rough
        half, v = half + step[0], v + step[2]
        gamma, omega = (gamma, omega + step[1]) if of_amplitude else (gamma + step[1], omega)
    return run


class Family:
    """Cycles between the stored ones: half the period, gamma_bar_0 and v_0 by speed, to some three digits."""

    def __init__(self, set_name: str, friction: str, store: Store) -> None:
        from scipy.interpolate import CubicSpline

        origin = store.get(f"{set_name}/{friction}/heteroclinic/point/omega_h")
        found = {}
        base = Decimal(origin.values["decimals"][0]) if origin is not None else Decimal(0)
        for kind in ("limit-cycle", "near-heteroclinic") if origin is not None else ():
            for quantity in store.matching(f"{set_name}/{friction}/{kind}/"):
                if quantity.name == "period":
                    away = float(Decimal(quantity.inputs["Omega"]) - base)
                    names = (quantity.id.replace("/period", f"/{name}") for name in ("period", "gamma_bar_0", "v_0"))
                    if away > _NEAREST:
                        found[math.log(away)] = [store[name].for_doubles for name in names]
        self.known = len(found) >= _LEAST
        if origin is None or not self.known:
            return
        self.omega_h, self._at = origin.for_doubles, sorted(found)
        period, gamma, v = numpy.array([found[x] for x in self._at]).T
        # Smooth at both ends of the family: at the Hopf point gamma^2 goes to 0, at the connection gamma to pi.
        smooth = [period / 2, numpy.log(math.pi**2 - gamma**2), numpy.log(-v / gamma)]
        self._spline = CubicSpline(self._at, numpy.stack(smooth, axis=1))

    def __call__(self, omega: Array) -> tuple[Array, Array, Array]:
        """Half the period, gamma_bar_0 and v_0; NaN below Omega_h."""
        with numpy.errstate(all="ignore"):
            half, left, ratio = self._spline(numpy.log(omega - self.omega_h)).T
            gamma = numpy.sqrt(math.pi**2 - numpy.exp(left))
        return half, gamma, -numpy.exp(ratio) * gamma

    def speeds(self, gamma: Array) -> Array:
        """Those of the cycles with these gamma_bar_0; NaN beyond the stored ones."""
        away = numpy.linspace(self._at[0], self._at[-1], _SCAN)
        squares = math.pi**2 - numpy.exp(self._spline(away)[:, 1])
        near = numpy.interp(gamma**2, squares[::-1], numpy.exp(away[::-1]), numpy.nan, numpy.nan)
        return numpy.asarray(self.omega_h + near)
