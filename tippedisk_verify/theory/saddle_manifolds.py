"""The local invariant manifolds of noninverted spinning, as power series (parameterization method).

In y = (beta_bar, gamma + pi/2, v), about the saddle, the field is odd by the point symmetry. Its one-dimensional
manifolds are curves K(s) = sum of K_n s^n over odd n with f(K(s)) = lambda s K'(s): along them s grows like
exp(lambda t). Its two-dimensional stable manifold is needed only near the slow stable curve, because what is left of
the fast direction after the passage between the saddles is tiny: K(s) + t L(s) with L the fast direction carried along
the curve, Df(K) L = lambda_s s L' + lambda_f L. What that leaves out is of order t^2.

The smooth law is analytic on either side of gamma_y = 0, and each curve leaves the saddle on one side: its branch
gives the curve on that side, with even powers too. The unstable curve is meant for s > 0, where gamma grows, and the
stable one for s < 0, where an orbit with growing gamma arrives.

Source: X. Cabré, E. Fontich, R. de la Llave, The parameterization method for invariant manifolds III, J. Differential
Equations 218 (2005).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from tippedisk_verify.errors import AccuracyError, NoConnectionError
from tippedisk_verify.model.equations import field, jacobian
from tippedisk_verify.model.exact import fraction, quotient
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.model.precision import bits
from tippedisk_verify.theory.equilibria import eigenvalues, linearization, right_eigenvector
from tippedisk_verify.theory.series import Angle, PowerSeries, SeriesOps

__all__ = ["Saddle", "refuse_focus"]

_RESONANT = 1e-4  # of the eigenvalue; coefficients grow like the inverse of such a divisor


@dataclass(frozen=True)
class Saddle:
    """Noninverted spinning at one speed with its local manifolds, in mpmath numbers of ``working_bits``.

    ``order`` is the highest power of the series. Raises NoConnectionError where the equilibrium is not a saddle with
    one unstable and two real stable directions.
    """

    parameters: Parameters
    omega: Fraction
    working_bits: int
    order: int

    @cached_property
    def context(self) -> Any:
        return bits(self.working_bits).context

    @cached_property
    def constants(self) -> Constants:
        ctx = self.context
        return self.parameters.within(ctx)

    @cached_property
    def speed(self) -> Any:
        return quotient(self.context, self.omega)

    @cached_property
    def eigenvalues(self) -> tuple[Any, Any, Any]:
        """(unstable, slow stable, fast stable) [1/s]."""
        ctx = self.context
        matrix = linearization(self.parameters, self.omega, "noninverted")
        values = eigenvalues(matrix, math.ceil(self.working_bits * math.log10(2)))
        if any(value.im.value for value in values):
            raise NoConnectionError(
                "noninverted spinning is a saddle-focus here: a connection of saddles is not looked for"
            )
        unstable, slow, fast = (quotient(ctx, value.re.value) for value in values)
        if not slow < 0 < unstable:
            raise NoConnectionError("noninverted spinning is no saddle with one unstable direction here")
        return unstable, slow, fast

    @cached_property
    def directions(self) -> Any:
        """Right eigenvectors in (beta, gamma, v), largest component 1, as columns in the eigenvalues' order."""
        ctx = self.context
        vectors = []
        for value in self.eigenvalues:
            vector = right_eigenvector(linearization(self.parameters, self.omega, "noninverted"), value)
            entries = [quotient(ctx, entry) if isinstance(entry, Fraction) else entry for entry in vector]
            largest = max(entries, key=abs)
            vectors.append([entry / largest for entry in entries])
        return ctx.matrix(vectors).T

    @cached_property
    def inverse_directions(self) -> Any:
        """Its rows give the coordinates of a vector along the eigenvectors."""
        return self.context.inverse(self.directions)

    @cached_property
    def unstable_curve(self) -> list[PowerSeries]:
        return self._curve(0)

    @cached_property
    def stable_curve(self) -> list[PowerSeries]:
        """The slow stable manifold; the fast one is not needed."""
        return self._curve(1)

    def start_on_branch(self, distance: Fraction, side: int = 1) -> list[Fraction]:
        """(beta_bar, gamma_bar, v) so far along the unstable curve from the saddle at gamma_bar = -pi.

        With ``side`` -1 that of its image under the point symmetry, from the saddle at pi.
        """
        beta, gamma, v = (component.at(quotient(self.context, distance)) for component in self.unstable_curve)
        return [side * fraction(component) for component in (beta, gamma - self.context.pi, v)]

    def _curve(self, which: int) -> list[PowerSeries]:
        ctx, eigenvalue = self.context, self.eigenvalues[which]
        curve = [[ctx.zero, self.directions[row, which]] for row in range(3)]
        step = self._power_step
        rates_of = field(SeriesOps, self.constants, self.speed, self.parameters.friction, self.side(which))
        for power in range(1 + step, self.order + 1, step):
            for component in curve:
                component.extend([ctx.zero] * step)
            rates = rates_of(*self._state(curve))
            column = self._solved([rate.c[power] for rate in rates], power * eigenvalue)
            for component, value in zip(curve, column, strict=True):
                component[power] = value
        return [PowerSeries(component) for component in curve]

    def _solved(self, rest: Sequence[Any], growth: Any, resonant: float = 0) -> Any:
        """x of (growth - A) x = rest, A the linearisation; without what has a divisor below ``resonant``."""
        along = self.inverse_directions * self.context.matrix(rest)
        for k, eigenvalue in enumerate(self.eigenvalues):
            divisor = growth - eigenvalue
            along[k] = 0 if abs(divisor) < resonant else along[k] / divisor
        return self.directions * along

    @property
    def _power_step(self) -> int:
        """The linear law's field is odd about the saddle: every other power vanishes."""
        return 2 if self.parameters.friction == "linear" else 1

    def side(self, which: int) -> int | None:
        """The sign of gamma_y along a curve, on the half of it that is used."""
        if self.parameters.friction == "linear":
            return None
        c, (_, gamma, v) = self.constants, (self.directions[row, which] for row in range(3))
        # Linearised at the saddle: rho v - e Omega cos(gamma), with cos(gamma) the deviation of gamma itself.
        velocity = (c.r - c.e) * v - c.e * self.speed * gamma
        return (1 if velocity > 0 else -1) * (1 if which == 0 else -1)

    def _state(self, curve: Sequence[Sequence[Any]]) -> tuple[Angle, Angle, PowerSeries]:
        """About (pi/2, -pi/2, 0), whose sines and cosines are exact."""
        zero, one = self.context.zero, self.context.one
        beta, gamma, v = map(PowerSeries, curve)
        return Angle(beta, one, zero), Angle(gamma, -one, zero), v

    @cached_property
    def fast_direction(self) -> list[PowerSeries]:
        """L(s): the fast stable direction along the slow stable curve; even in s."""
        return self._carried(2)

    @cached_property
    def unstable_direction(self) -> list[PowerSeries]:
        """M(s): the unstable direction along the slow stable curve; even in s.

        Any M tells u = 0, so terms next to a resonance are left out: lambda_u + 2 lambda_s = lambda_s where the saddle
        value vanishes, for one. There u grows like exp(lambda_u t) up to a factor 1 + O(s^2) only.
        """
        return self._carried(0)

    def _carried(self, which: int) -> list[PowerSeries]:
        """A direction along the slow stable curve: Df(K) L = lambda_s s L' + lambda L, L(0) an eigenvector."""
        ctx, slow, own = self.context, self.eigenvalues[1], self.eigenvalues[which]
        entries = self._jacobian_on_stable_curve
        length = self.order + 1
        carried = [[self.directions[row, which]] + [ctx.zero] * (length - 1) for row in range(3)]
        step = self._power_step
        resonant = _RESONANT * own if which == 0 else 0
        for power in range(step, length, step):
            rest = [ctx.zero, ctx.zero, ctx.zero]
            for row in (1, 2):  # beta' = v is linear
                for entry, component in zip(entries[row], carried, strict=True):
                    if isinstance(entry, PowerSeries):
                        terms = (entry.c[k] * component[power - k] for k in range(step, power + 1, step))
                        rest[row] += sum(terms, ctx.zero)
            vector = self._solved(rest, own + power * slow, resonant)
            for component, value in zip(carried, vector, strict=True):
                component[power] = value
        return [PowerSeries(component) for component in carried]

    @cached_property
    def _jacobian_on_stable_curve(self) -> Any:
        curve = [component.c for component in self.stable_curve]
        law = (self.parameters.friction, self.side(1))
        return jacobian(SeriesOps, self.constants, self.speed, *law)(*self._state(curve))

    def reach(self, *curves: Sequence[PowerSeries]) -> Any:
        """The radius within which all of these converge, estimated from their last coefficients."""
        ctx = self.context
        rates = [ctx.one * 10]
        for curve in curves:
            sizes = [max(abs(component.c[n]) for component in curve) for n in range(len(curve[0].c))]
            rates += [ctx.power(size, -ctx.one / n) for n, size in list(enumerate(sizes))[-4:] if size and n > 2]
        return min(rates)

    def stable_coordinates(self, point: Sequence[Any]) -> tuple[Any, Any, Any]:
        """(u, s, t) of a point near the saddle: K(s) + t L(s) + u M(s).

        The point lies on the stable manifold if u = 0, up to terms of order t^2; small u and t grow and fall like
        exp(lambda_u t) and exp(lambda_f t) along the flow. Raises AccuracyError if it is too far.
        """
        ctx = self.context
        u = s = t = ctx.zero
        target = [ctx.mpf(entry) for entry in point]
        size = max(map(abs, target))
        for _ in range(400):
            residual = ctx.matrix(
                [
                    value - curve.at(s) - t * fast.at(s) - u * unstable.at(s)
                    for value, curve, fast, unstable in zip(
                        target, self.stable_curve, self.fast_direction, self.unstable_direction, strict=True
                    )
                ]
            )
            step = self.inverse_directions * residual
            u, s, t = u + step[0], s + step[1], t + step[2]
            if max(map(abs, step)) <= 16 * ctx.eps * size:
                return u, s, t
        raise AccuracyError("the end of the unstable branch is too far from the saddle for its local series")


def refuse_focus(parameters: Parameters, omega: Fraction) -> None:
    """Raises NoConnectionError unless noninverted spinning is a saddle with three real eigenvalues at the speed."""
    _ = Saddle(parameters, omega, 80, 1).eigenvalues
