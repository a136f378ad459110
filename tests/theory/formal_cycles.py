"""The family of cycles at its birth, and the normal form, as formal series of the full equations.

The state is a series in w and its conjugate, w' = (i omega + kappa) w, up to the fifth order. Omega
and kappa are series in |w|^2. The gauge is that gamma_bar's first harmonic is w alone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mpmath

from tippedisk_verify.model import equations
from tippedisk_verify.model.friction import LAWS
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import rational_in_context
from tippedisk_verify.theory.hopf import critical_frequency_squared, omega_crit_squared

_ORDER = 5


class Series(dict):
    """The coefficients of w^j conj(w)^k by (j, k), up to `_ORDER`."""

    def __add__(self, other: Any) -> Series:
        total = Series(self)
        for key, value in _series(other).items():
            total[key] = total.get(key, 0) + value
        return total

    def __mul__(self, other: Any) -> Series:
        total = Series()
        for (a, b), x in self.items():
            for (c, d), y in _series(other).items():
                if a + b + c + d <= _ORDER:
                    total[a + c, b + d] = total.get((a + c, b + d), 0) + x * y
        return total

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Series:
        return self * -1

    def __sub__(self, other: Any) -> Series:
        return self + -_series(other)

    def __rsub__(self, other: Any) -> Series:
        return -self + other

    def reciprocal(self) -> Series:
        first = self[0, 0]
        rest, power, total = 1 - self * (1 / first), _series(mpmath.mpf(1)), Series()
        for _ in range(_ORDER + 1):
            total, power = total + power, power * rest
        return total * (1 / first)

    def conjugate(self) -> Series:
        return Series({(k, j): mpmath.conj(value) for (j, k), value in self.items()})


def _series(value: Any) -> Series:
    return value if isinstance(value, Series) else Series({(0, 0): value})


class _Ops:
    """Sine and cosine of series without a constant term."""

    @staticmethod
    def sin(x: Series) -> Series:
        return x - x * x * x * (mpmath.mpf(1) / 6) + x * x * x * x * x * (mpmath.mpf(1) / 120)

    @staticmethod
    def cos(x: Series) -> Series:
        return 1 - x * x * (mpmath.mpf(1) / 2) + x * x * x * x * (mpmath.mpf(1) / 24)


class FormalCycles(NamedTuple):
    """The results of the series; gamma_bar = w + conj(w) + third[...] and higher harmonics."""

    #: Coefficients of |w|^2 and |w|^4 in Omega [rad/s]; zero for the normal form
    omega: tuple[Any, Any]
    kappa: tuple[Any, Any]  #: likewise [1/s]; c_1 and c_2 of the normal form
    third: Any  #: coefficient of w^3 in gamma_bar

    def amplitude_law(self) -> tuple[Any, Any]:
        """Return c_1 and c_2 of Omega_crit + c_1 a^2 + c_2 a^4.

        Here a^2 = 4 |w|^2 + 8 Re(third) |w|^4 + ...
        """
        first, second = self.omega
        quadratic = first / 4
        return quadratic, (second - 8 * mpmath.re(self.third) * quadratic) / 16


def formal_cycles(parameters: Parameters, *, normal_form: bool = False) -> FormalCycles:
    """Return the family of cycles, or the normal form on the centre manifold at Omega_crit.

    The numbers have mpmath's current precision.
    """
    constants = parameters.constants_in_context(mpmath.mp)
    square, frequency_square = (
        f(parameters) for f in (omega_crit_squared, critical_frequency_squared)
    )
    omega, frequency = (
        mpmath.sqrt(rational_in_context(mpmath.mp, part)) for part in (square, frequency_square)
    )

    def rates(speed: Series, state: list[Series]) -> list[Series]:
        ops = equations.shifted_ops(_Ops)
        terms = equations.equation_terms(ops, constants, speed, *state)
        friction = LAWS["linear"](None, terms.sliding_velocity, constants)
        force = terms.gyroscopic + terms.gravity + terms.force_direction * friction
        return [state[2], -(speed * ops.cos(state[0])), force * terms.mass.reciprocal()]

    # A state of w alone leaves the cubic terms at w^3, so w |w|^2 shows how the linear ones change
    # with Omega.
    w = Series({(1, 0): mpmath.mpc(1)})
    steered = Series({(0, 0): omega, (1, 1): mpmath.mpf(1)})
    jacobian, by_omega = mpmath.matrix(3, 3), mpmath.matrix(3, 3)
    for column in range(3):
        unit = [w if row == column else Series({(1, 0): mpmath.mpc(0)}) for row in range(3)]
        for row, rate in enumerate(rates(steered, unit)):
            jacobian[row, column], by_omega[row, column] = rate.get((1, 0), 0), rate.get((2, 1), 0)
    by_omega[2, 0] = rates(steered, [w, Series(), Series()])[2][2, 1]
    root = mpmath.mpc(0, frequency)
    direction = mpmath.matrix([root / omega, 1, root**2 / omega])
    state = [Series({(1, 0): part, (0, 1): mpmath.conj(part)}) for part in direction]
    speed, kappa = Series({(0, 0): omega}), Series({(0, 0): root})
    found: list[tuple[Any, Any]] = []
    for order in (3, 5):
        turning = kappa * w
        residual = []
        for part, rate in zip(state, rates(speed, state), strict=True):
            by_w = Series({(j - 1, k): j * value for (j, k), value in part.items() if j})
            by_conjugate = Series({(j, k - 1): k * value for (j, k), value in part.items() if k})
            residual.append(by_w * turning + by_conjugate * turning.conjugate() - rate)
        for j in range(order // 2 + 1, order + 1):
            k = order - j
            right = mpmath.matrix([-part.get((j, k), 0) for part in residual])
            matrix = (j - k) * root * mpmath.eye(3) - jacobian
            if j - k > 1:
                added = mpmath.lu_solve(matrix, right)
            else:
                columns = [
                    matrix[:, 0],
                    1j * matrix[:, 0],
                    matrix[:, 2],
                    1j * matrix[:, 2],
                    1j * direction,
                ]
                columns.append(direction if normal_form else -(by_omega * direction))
                real = mpmath.matrix(
                    [[f(c[n]) for c in columns] for f in (mpmath.re, mpmath.im) for n in range(3)]
                )
                x = mpmath.lu_solve(
                    real, [f(right[n]) for f in (mpmath.re, mpmath.im) for n in range(3)]
                )
                added = [mpmath.mpc(x[0], x[1]), mpmath.mpc(0), mpmath.mpc(x[2], x[3])]
                turned, steered_by = (
                    (mpmath.mpc(x[5], x[4]), 0) if normal_form else (mpmath.mpc(0, x[4]), x[5])
                )
                kappa[k, k], speed[k, k] = turned, steered_by
                found.append((steered_by, turned))
            for part, value in zip(state, added, strict=True):
                part[j, k], part[k, j] = value, mpmath.conj(value)
    (first, first_turn), (second, second_turn) = found
    return FormalCycles((first, second), (first_turn, second_turn), state[1][3, 0])
