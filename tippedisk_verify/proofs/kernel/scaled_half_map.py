"""The half map of the state divided by its amplitude: the family of limit cycles up to its Hopf
point.

Scaled states
-------------
In the angles beta_bar, gamma_bar from inverted spinning the field is odd. Write the state as a y
with y = (b, g, w), and let q = a^2. Then the rates of y are analytic functions of y, Omega and q.
At q = 0 they are those of the linearisation.

The equations are those of `vector_field`: a `_ScaledNumber` stands for a number a x (odd) or x
(even). The sine of an odd number is odd, with sin(a x) / a (`jets.scaled_sine`), and its cosine is
even. A product of two odd numbers is even, with a factor q. A sum of an odd and an even number is
refused, and so is a quotient by an odd one. So the rates are seen to be odd, and no division by a
takes place.

The equations of the family
---------------------------
Let P(g, w; Omega, q) be the scaled half map from the section b = 0, w < 0, and

    F(w, Omega; q) = P(1, w; Omega, q) - (1, w).

For q > 0 its zeros are the family's cycles with gamma_bar_0 = a and v_0 = a w. Krawczyk's test of
`half_map_of_curves`, with the parameter q, proves one zero for each q of [0, q_1], with regular
dF/d(w, Omega). They form an analytic curve. At q = 0 the flow is that of the linearisation, which
then has a periodic orbit, so that Omega is Omega_crit: the curve begins at the Hopf point.

Multipliers
-----------
P is homogeneous: l P(g, w; Omega, l^2 q) = P(l g, l w; Omega, q) for l > 0. Let c_g, c_w be the
columns of P' - 1, and c_Omega, c_q the derivatives of P. Differentiation with respect to l at the
fixed point (1, w) gives

    c_g + w c_w = 2 q c_q,   so that   det(P' - 1) = det(c_g, c_w) = 2 q det(c_q, c_w).

Along the curve c_w w' + c_Omega Omega' + c_q = 0, so det(c_q, c_w) = Omega'(q) det(c_w, c_Omega) by
Cramer's rule. With tau and delta as in `half_map_of_curves`,

    1 - tau - delta = det(P' - 1) = 2 q Omega'(q) det(c_w, c_Omega).

Its sign for all q of (0, q_1] follows from those of two jets that are not zero at q = 0. The trace
is tau = 1 - w (c_w)_1 + 2 q (c_q)_1 + 1 + (c_w)_2. P' of the scaled map is similar to that of the
map itself, so the multipliers are the cycle's.

No ball becomes a point or a float here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tippedisk_verify.proofs.kernel.balls import positive, require
from tippedisk_verify.proofs.kernel.half_map_of_curves import Curve
from tippedisk_verify.proofs.kernel.jets import Jet, scaled_sine
from tippedisk_verify.proofs.kernel.proved_flow import EnclosedField
from tippedisk_verify.proofs.kernel.small_matrices import Matrix
from tippedisk_verify.proofs.kernel.taylor_recurrences import Node
from tippedisk_verify.proofs.kernel.vector_field import FieldConstants, vector_field

__all__ = ["ScaledCurve", "ScaledField"]


class _ScaledNumber:
    """A number in the equations of motion scaled by the amplitude a: it stands for a x if ``odd``,
    else for x.

    ``amplitude_squared`` is a^2. Arithmetic keeps the factors a, so nothing is divided by a.
    """

    __slots__ = ("amplitude_squared", "odd", "x")

    def __init__(self, x: Any, amplitude_squared: Any, *, odd: bool = False) -> None:
        self.x, self.amplitude_squared, self.odd = x, amplitude_squared, odd

    def _as_scaled(self, other: Any) -> _ScaledNumber:
        return (
            other
            if isinstance(other, _ScaledNumber)
            else _ScaledNumber(other, self.amplitude_squared)
        )

    def __add__(self, other: Any) -> _ScaledNumber:
        other = self._as_scaled(other)
        if other.odd is not self.odd:
            raise ArithmeticError("an odd and an even quantity were added: the field is not odd")
        return _ScaledNumber(self.x + other.x, self.amplitude_squared, odd=self.odd)

    def __sub__(self, other: Any) -> _ScaledNumber:
        return self + -self._as_scaled(other)

    def __neg__(self) -> _ScaledNumber:
        return _ScaledNumber(-self.x, self.amplitude_squared, odd=self.odd)

    def __mul__(self, other: Any) -> _ScaledNumber:
        other = self._as_scaled(other)
        product = self.x * other.x
        both_odd = self.odd and other.odd
        return _ScaledNumber(
            product * self.amplitude_squared if both_odd else product,
            self.amplitude_squared,
            odd=self.odd is not other.odd,
        )

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> _ScaledNumber:
        other = self._as_scaled(other)
        if other.odd:
            raise ArithmeticError(
                "a quotient by an odd quantity is not analytic in the square of the amplitude"
            )
        return _ScaledNumber(self.x / other.x, self.amplitude_squared, odd=self.odd)


class _ScaledOps:
    """The sine and cosine of a `_ScaledNumber` that stands for an odd angle, in the form that
    `vector_field` needs.
    """

    @staticmethod
    def sin(angle: _ScaledNumber) -> _ScaledNumber:
        return _ScaledNumber(_sine_and_cosine(angle)[0], angle.amplitude_squared, odd=True)

    @staticmethod
    def cos(angle: _ScaledNumber) -> _ScaledNumber:
        return _ScaledNumber(_sine_and_cosine(angle)[1], angle.amplitude_squared)


def _sine_and_cosine(angle: _ScaledNumber) -> tuple[Any, Any]:
    if not angle.odd:
        raise ArithmeticError("an angle must be an odd quantity")
    if isinstance(angle.x, Node):
        sine = angle.x.graph.scaled_sine(angle.x, angle.amplitude_squared)
        return sine, sine.partner
    return scaled_sine(angle.x, angle.amplitude_squared)[:2]


class ScaledField(EnclosedField):
    """The vector field of a state (b, g, w) that is scaled by its amplitude a.

    The state is (beta_bar, gamma_bar, v) / a, and ``amplitude_squared`` is q = a^2. ``omega`` is in
    rad/s. Both are jets or balls. Derivatives are taken with respect to b, g, w, Omega and q, and
    the divergence is d(w')/d(w).
    """

    def __init__(self, constants: FieldConstants, omega: Any, amplitude_squared: Any) -> None:
        super().__init__(constants, omega, scaled_vector_field, (amplitude_squared,))


def scaled_vector_field(
    ops: Any, constants: FieldConstants, omega: Any, amplitude_squared: Any
) -> Callable[[Any, Any, Any], tuple[Any, Any, Any]]:
    """Return the vector field of the scaled motion: a function from (b, g, w) to (b', g', w').

    Args:
        ops: Not used: `_ScaledOps` finds the sine and cosine of each kind of number.
        constants: The disk's constants.
        omega: The speed [rad/s].
        amplitude_squared: q = a^2, in the arithmetic of the other numbers.

    Raises:
        ArithmeticError: If a rate is not odd.
    """
    even = FieldConstants(*(_ScaledNumber(value, amplitude_squared) for value in constants))

    def rates(*state: Any) -> tuple[Any, Any, Any]:
        odd = (_ScaledNumber(part, amplitude_squared, odd=True) for part in state)
        b, g, w = vector_field(_ScaledOps, even, _ScaledNumber(omega, amplitude_squared))(*odd)
        if not (b.odd and g.odd and w.odd):
            raise ArithmeticError("a rate is not odd")
        return b.x, g.x, w.x

    return rates


@dataclass(frozen=True)
class ScaledCurve(Curve):
    """A curve of starts (b, g, w) = (0, 1, w) of states that are scaled by their amplitude.

    Its three numbers are q, the squared amplitude (as ``gamma_bar``), w (as ``v``) and Omega. q has
    no deviation and is less than 1, so |a b| < 1.5707 wherever |b| < 1.5707. Raises Unproved
    otherwise.
    """

    start_derivative = ((0, 0, 0), (0, 1, 0))
    parameter_columns = (2, 0)
    field_class = ScaledField

    @property
    def start(self) -> tuple[Jet, Jet]:
        return 1 + 0 * self.v.mid(), self.v

    @property
    def equation_parameters(self) -> tuple[Jet, ...]:
        return (*super().equation_parameters, self.gamma_bar)

    def trace(self, matrix: Matrix) -> Jet:
        degree = matrix[0][0].degree
        fixed, amplitude_squared = (
            (self.v + self.deviation[1]).truncated(degree),
            self.gamma_bar.truncated(degree),
        )
        trace: Jet = (
            1 - fixed * matrix[0][1] + 2 * (amplitude_squared * matrix[0][0]) + matrix[1][1]
        )
        return trace

    def amplitude_slope(self, beta_bar: Any, slope: Jet) -> Jet:
        # beta_bar = a b, so d(beta_bar)/da = b + 2 q db/dq.
        rise: Jet = 2 * (self.gamma_bar.truncated(slope.degree) * slope) + beta_bar
        return rise

    def __post_init__(self) -> None:
        less = positive(1 - self.gamma_bar.range())
        require(
            bool(self.deviation[0] == 0) and less,
            "the square of the amplitude is not less than 1, or deviates",
        )
