"""The local invariant manifolds of noninverted spinning, as power series (parameterization method).

**Curves.** In y = (beta_bar, gamma + pi/2, v), about the saddle, the field is odd by the point
symmetry. Its one-dimensional manifolds are curves

    K(s) = sum of K_n s^n over odd n,    F(K(s)) = lambda s K'(s).

Along them s grows like exp(lambda t).

**Stable manifold.** The two-dimensional stable manifold is needed only near the slow stable curve,
because the fast component is tiny after the passage between the saddles. It is taken as K(s) + f
L(s) with L the fast direction carried along the curve:

    DF(K) L = lambda_s s L' + lambda_f L.

The remainder is of order f^2.

**Laws with two sides.** Such a law is analytic on either side of gamma_y = 0, and each curve leaves
the saddle on one side. The branch of that side gives the curve there, with even powers too. The
unstable curve is used for s > 0, where gamma grows. The stable curve is used for s < 0, where an
orbit with growing gamma arrives.

Source: X. Cabré, E. Fontich, R. de la Llave, The parameterization method for invariant manifolds
III, J. Differential Equations 218 (2005).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, partial
from typing import Any

from tippedisk_verify.errors import AccuracyError, NoConnectionError
from tippedisk_verify.model.equations import jacobian, vector_field
from tippedisk_verify.model.friction import FrictionLaw
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.numbers.exact import fraction, rational_in_context
from tippedisk_verify.numbers.precision import precision_of_bits
from tippedisk_verify.theory.equilibria import eigenvalues, linearization, right_eigenvector
from tippedisk_verify.theory.power_series import ANGLE_OPS, PowerSeries, sine_and_cosine

__all__ = ["Saddle", "refuse_focus"]

_MIN_DIVISOR = 1e-4  # relative to the eigenvalue; coefficients grow like the inverse of a divisor


@dataclass(frozen=True)
class Saddle:
    """The saddle, noninverted spinning at one speed, with its local manifolds as power series, in
    mpmath numbers.

    Args:
        parameters: The disk.
        omega: The spinning speed [rad/s].
        working_bits: The precision of the numbers.
        order: The highest power of the series.

    Raises:
        NoConnectionError: If the equilibrium is not a saddle with one unstable and two real stable
            directions. Properties raise it on first use.
    """

    parameters: Parameters
    omega: Fraction
    working_bits: int
    order: int

    @cached_property
    def context(self) -> Any:
        """The mpmath context of the numbers that belong to this saddle."""
        return precision_of_bits(self.working_bits).context

    @cached_property
    def constants(self) -> Constants:
        """The constants of the disk, as numbers of `context`."""
        return self.parameters.constants_in_context(self.context)

    @cached_property
    def speed(self) -> Any:
        """The spinning speed [rad/s], as a number of `context`."""
        return rational_in_context(self.context, self.omega)

    @cached_property
    def eigenvalues(self) -> tuple[Any, Any, Any]:
        """The saddle's eigenvalues (unstable, slow stable, fast stable) [1/s]."""
        ctx = self.context
        matrix = linearization(self.parameters, self.omega, "noninverted")
        values = eigenvalues(matrix, math.ceil(self.working_bits * math.log10(2)))
        if any(value.im.value for value in values):
            raise NoConnectionError(
                "noninverted spinning is a saddle-focus here: a connection of saddles is not "
                "looked for"
            )
        unstable, slow, fast = (rational_in_context(ctx, value.re.value) for value in values)
        if not slow < 0 < unstable:
            raise NoConnectionError(
                "noninverted spinning is not a saddle with one unstable direction here"
            )
        return unstable, slow, fast

    @cached_property
    def eigenvectors(self) -> Any:
        """The saddle's right eigenvectors in (beta, gamma, v), as columns in the eigenvalues'
        order.

        The largest component of each is 1.
        """
        matrix = linearization(self.parameters, self.omega, "noninverted")
        vectors = []
        for value in self.eigenvalues:
            vector = right_eigenvector(matrix._replace(omega=self.speed), value)
            largest = max(vector, key=abs)
            vectors.append([entry / largest for entry in vector])
        return self.context.matrix(vectors).T

    @cached_property
    def inverse_eigenvectors(self) -> Any:
        """The inverse of the matrix of eigenvectors: its rows give coordinates along the
        eigenvectors.
        """
        return self.context.inverse(self.eigenvectors)

    @cached_property
    def unstable_curve(self) -> list[PowerSeries]:
        """The unstable manifold of the saddle as a curve K(s), a power series for each of beta,
        gamma and v.
        """
        return self._curve(0)

    @cached_property
    def stable_curve(self) -> list[PowerSeries]:
        """The slow stable manifold of the saddle as a curve K(s), a power series for each of beta,
        gamma and v.

        The fast stable manifold is not needed.
        """
        return self._curve(1)

    def start_on_unstable_manifold(self, distance: Fraction, sign: int = 1) -> list[Fraction]:
        """Return a state on the unstable manifold near the saddle at gamma_bar = -pi, from its
        power series.

        Args:
            distance: The curve's parameter s.
            sign: -1 takes the image of the point under the point symmetry, from the saddle at pi.

        Returns:
            (beta_bar [rad], gamma_bar [rad], v [rad/s]).
        """
        beta, gamma, v = (
            component.value_at(rational_in_context(self.context, distance))
            for component in self.unstable_curve
        )
        return [sign * fraction(component) for component in (beta, gamma - self.context.pi, v)]

    def _curve(self, direction_index: int) -> list[PowerSeries]:
        ctx, eigenvalue = self.context, self.eigenvalues[direction_index]
        curve = [[ctx.zero, self.eigenvectors[row, direction_index]] for row in range(3)]
        step = self._power_step
        rates_of = vector_field(ANGLE_OPS, self.constants, self.speed, *self._law(direction_index))
        for power in range(1 + step, self.order + 1, step):
            for component in curve:
                component.extend([ctx.zero] * step)
            rates = rates_of(*self._state(curve))
            column = self._solve_homological_equation(
                [rate.coefficients[power] for rate in rates], power * eigenvalue
            )
            for component, value in zip(curve, column, strict=True):
                component[power] = value
        return [PowerSeries(component) for component in curve]

    def _solve_homological_equation(
        self, rest: Sequence[Any], growth: Any, resonant: float = 0
    ) -> Any:
        """Solve (growth - A) x = rest for x, where A is the linearisation at the saddle.

        Components of x along eigenvectors with a divisor below ``resonant`` are set to zero.
        """
        along = self.inverse_eigenvectors * self.context.matrix(rest)
        for k, eigenvalue in enumerate(self.eigenvalues):
            divisor = growth - eigenvalue
            along[k] = 0 if abs(divisor) < resonant else along[k] / divisor
        return self.eigenvectors * along

    @property
    def _power_step(self) -> int:
        """The step between the powers of s with nonzero coefficients: 1 for a law with two sides,
        otherwise 2.

        An analytic law's field is odd about the saddle, so every other power vanishes.
        """
        return 1 if self.parameters.law.two_sided else 2

    def _law(self, direction_index: int) -> tuple[FrictionLaw, int | None]:
        """Return the friction law along a manifold of the saddle, in a form that accepts power
        series, and the sign of gamma_y there.

        ``direction_index`` is 0 for the unstable manifold and 1 for the slow stable one.
        """
        parameters, side = self.parameters, self.law_side(direction_index)
        number = partial(rational_in_context, self.context)
        law = parameters.law.taylor_polynomial(
            parameters, self.working_bits, self.order, side, number
        )
        return law, side

    def law_side(self, direction_index: int) -> int | None:
        """Return the sign of gamma_y along a manifold of the saddle (0: unstable, 1: slow stable),
        on the half that is used.

        Returns None for a law without sides.
        """
        if not self.parameters.law.two_sided:
            return None
        c, (_, gamma, v) = (
            self.constants,
            (self.eigenvectors[row, direction_index] for row in range(3)),
        )
        # Linearised at the saddle: rho v - e Omega cos(gamma), with cos(gamma) the deviation of
        # gamma itself.
        velocity = (c.r - c.e) * v - c.e * self.speed * gamma
        return (1 if velocity > 0 else -1) * (1 if direction_index == 0 else -1)

    def _state(
        self, curve: Sequence[Sequence[Any]]
    ) -> tuple[tuple[PowerSeries, PowerSeries], tuple[PowerSeries, PowerSeries], PowerSeries]:
        """Return the angles beta and gamma and v of a curve of states about (pi/2, -pi/2, 0), as
        power series.

        Each angle is a pair of its sine and cosine.
        """
        zero, one = self.context.zero, self.context.one
        beta, gamma, v = map(PowerSeries, curve)
        return sine_and_cosine(beta, one, zero), sine_and_cosine(gamma, -one, zero), v

    @cached_property
    def fast_direction(self) -> list[PowerSeries]:
        """The direction L(s) of the fast stable motion at each point of the slow stable curve, as
        power series that are even in s.
        """
        return self._transported_eigenvector(2)

    @cached_property
    def unstable_direction(self) -> list[PowerSeries]:
        """A direction M(s) of the unstable motion at each point of the slow stable curve, as power
        series that are even in s.

        Any M detects u = 0, so terms near a resonance are left out. An example is lambda_u + 2
        lambda_s = lambda_s, where the saddle value vanishes. There u grows like exp(lambda_u t)
        only up to a factor 1 + O(s^2).
        """
        return self._transported_eigenvector(0)

    def _transported_eigenvector(self, direction_index: int) -> list[PowerSeries]:
        """Return an eigenvector's direction at each point of the slow stable curve, carried along
        it by the flow, as power series.

        It solves DF(K) L = lambda_s s L' + lambda L, where L(0) is the eigenvector with the index
        ``direction_index``.
        """
        ctx, slow, own = self.context, self.eigenvalues[1], self.eigenvalues[direction_index]
        entries = self._jacobian_on_stable_curve
        length = self.order + 1
        carried = [
            [self.eigenvectors[row, direction_index]] + [ctx.zero] * (length - 1)
            for row in range(3)
        ]
        step = self._power_step
        resonant = _MIN_DIVISOR * own if direction_index == 0 else 0
        for power in range(step, length, step):
            rest = [ctx.zero, ctx.zero, ctx.zero]
            for row in (1, 2):  # beta' = v is linear
                for entry, component in zip(entries[row], carried, strict=True):
                    if isinstance(entry, PowerSeries):
                        terms = (
                            entry.coefficients[k] * component[power - k]
                            for k in range(step, power + 1, step)
                        )
                        rest[row] += sum(terms, ctx.zero)
            vector = self._solve_homological_equation(rest, own + power * slow, resonant)
            for component, value in zip(carried, vector, strict=True):
                component[power] = value
        return [PowerSeries(component) for component in carried]

    @cached_property
    def _jacobian_on_stable_curve(self) -> Any:
        curve = [component.coefficients for component in self.stable_curve]
        slopes = jacobian(ANGLE_OPS, self.constants, self.speed, *self._law(1))
        return slopes(*self._state(curve))

    def convergence_radius(self, *curves: Sequence[PowerSeries]) -> Any:
        """Return the radius of s within which the power series of all given curves converge.

        It is estimated from their last coefficients, and is at most 10.
        """
        ctx = self.context
        rates = [ctx.one * 10]
        for curve in curves:
            sizes = [
                max(abs(component.coefficients[n]) for component in curve)
                for n in range(len(curve[0].coefficients))
            ]
            rates += [
                ctx.power(size, -ctx.one / n)
                for n, size in list(enumerate(sizes))[-4:]
                if size and n > 2
            ]
        return min(rates)

    def stable_coordinates(self, point: Sequence[Any]) -> tuple[Any, Any, Any]:
        """Return the coordinates (u, s, f) of a point near the saddle, so that the point is K(s) +
        f L(s) + u M(s).

        K is the slow stable curve; L and M are the fast stable and the unstable direction along it.
        The point lies on the stable manifold if u = 0, up to terms of order f^2. Small u and f grow
        and fall like exp(lambda_u t) and exp(lambda_f t) along the flow.

        Args:
            point: (beta_bar [rad], gamma + pi/2 [rad], v [rad/s]).

        Raises:
            AccuracyError: If the point is too far from the saddle.
        """
        ctx = self.context
        u = s = f = ctx.zero
        target = [ctx.mpf(entry) for entry in point]
        size = max(map(abs, target))
        for _ in range(400):
            residual = ctx.matrix(
                [
                    value - curve.value_at(s) - f * fast.value_at(s) - u * unstable.value_at(s)
                    for value, curve, fast, unstable in zip(
                        target,
                        self.stable_curve,
                        self.fast_direction,
                        self.unstable_direction,
                        strict=True,
                    )
                ]
            )
            step = self.inverse_eigenvectors * residual
            u, s, f = u + step[0], s + step[1], f + step[2]
            if max(map(abs, step)) <= 16 * ctx.eps * size:
                return u, s, f
        raise AccuracyError(
            "the end of the unstable manifold is too far from the saddle for its local series"
        )


def refuse_focus(parameters: Parameters, omega: Fraction) -> None:
    """Raise NoConnectionError unless noninverted spinning is a saddle with three real eigenvalues.

    Args:
        parameters: The disk.
        omega: The spinning speed [rad/s].
    """
    _ = Saddle(parameters, omega, 80, 1).eigenvalues
