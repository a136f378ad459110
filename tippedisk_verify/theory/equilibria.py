"""Stationary spinning: the two equilibria, their linearisation, eigenvalues and stability.

Inverted spinning is (pi/2, pi/2, 0), noninverted spinning (pi/2, -pi/2, 0) and its copy at gamma = 3 pi/2. Both
friction laws have the same linearisation there, because the sliding velocity vanishes at both and the smooth law's
slope at zero is the linear law's.

For rational parameters and a rational speed the linearisation is rational, so stability is decided exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal, NamedTuple, get_args

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import PI, Exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits, bits_for_digits, checked_digits

__all__ = [
    "Eigenvalue",
    "Equilibrium",
    "EquilibriumName",
    "Linearization",
    "characteristic_polynomial",
    "equilibrium",
    "is_stable",
    "left_eigenvector",
    "linearization",
    "location",
    "right_eigenvector",
    "stiff_eigenvalue_estimate",
]

EquilibriumName = Literal["inverted", "noninverted"]
_HALF = Fraction(1, 2)


class Linearization(NamedTuple):
    """Last row and kinematic entry of the Jacobian [[0, 0, 1], [Omega, 0, 0], [A31, A32, A33]] (Eq. A_coeff_O)."""

    omega: Any  #: d(gamma')/d(beta) [1/s]
    A31: Any  #: [1/s^2]
    A32: Any  #: [1/s^2]
    A33: Any  #: [1/s]


class Eigenvalue(NamedTuple):
    """One eigenvalue [1/s]; each part with the half-width that holds it."""

    re: Measured
    im: Measured

    def json(self) -> dict[str, dict[str, str]]:
        return {"re": self.re.json(), "im": self.im.json()}


@dataclass(frozen=True)
class Equilibrium:
    """One stationary state at one speed."""

    name: EquilibriumName
    state: tuple[Exact, Exact, Exact]  #: (beta, gamma, v) [rad, rad, rad/s]
    eigenvalues: tuple[Eigenvalue, Eigenvalue, Eigenvalue]  #: by descending real part, then descending imaginary part
    stable: bool  #: all eigenvalues in the open left half-plane, by the exact Routh-Hurwitz criterion

    def json(self) -> dict[str, object]:
        return {
            "state": {"beta": "pi/2", "gamma": "pi/2" if self.name == "inverted" else "-pi/2", "v": "0"},
            "eigenvalues": [value.json() for value in self.eigenvalues],
            "stable": self.stable,
        }


def location(name: EquilibriumName) -> tuple[Exact, Exact, Exact]:
    """(beta, gamma, v) of the equilibrium, exactly. Raises InputError for an unknown name."""
    if name not in get_args(EquilibriumName):
        raise InputError(f"equilibrium '{name[:40]}' is not known: use inverted or noninverted")
    side = _HALF if name == "inverted" else -_HALF
    return PI * _HALF, PI * side, Exact(Fraction(0))


def linearization(parameters: Parameters, omega: Fraction, name: EquilibriumName = "inverted") -> Linearization:
    """The Jacobian's entries at the equilibrium, as exact rationals (Eqs. 3DOF_lin, A_coeff_O).

    At noninverted spinning e changes its sign, because sin(gamma) = -1 there.
    """
    constants = parameters.rational()
    side = 1 if name == "inverted" else -1
    reach = constants.r + side * constants.e
    friction = constants.k / constants.b
    return Linearization(
        omega=omega,
        A31=constants.g * reach / constants.b - omega**2,
        A32=-side * friction * constants.e * reach * omega,
        A33=-friction * reach**2,
    )


def characteristic_polynomial(matrix: Linearization) -> tuple[Any, Any, Any, Any]:
    """Coefficients (1, a2, a1, a0) of lambda^3 + a2 lambda^2 + a1 lambda + a0 [1/s^3]."""
    return 1, -matrix.A33, -matrix.A31, -matrix.omega * matrix.A32


def is_stable(matrix: Linearization) -> bool:
    """Routh-Hurwitz for the cubic: a2 > 0, a0 > 0 and a2 a1 > a0. Exact for exact entries."""
    _, a2, a1, a0 = characteristic_polynomial(matrix)
    return bool(a2 > 0 and a0 > 0 and a2 * a1 > a0)


def right_eigenvector(matrix: Linearization, eigenvalue: Any) -> tuple[Any, Any, Any]:
    """(beta, gamma, v) direction with A x = lambda x, not normalised; from the first two rows."""
    return eigenvalue, matrix.omega, eigenvalue * eigenvalue


def left_eigenvector(matrix: Linearization, eigenvalue: Any) -> tuple[Any, Any, Any]:
    """Row vector y with y A = lambda y, not normalised; from the last two columns."""
    return (eigenvalue - matrix.A33) * eigenvalue, matrix.A32, eigenvalue


def stiff_eigenvalue_estimate(parameters: Parameters) -> Fraction:
    """A33 [1/s] at inverted spinning, which the paper gives as lambda_3 up to O(eps) (Eq. closed_la3)."""
    return Fraction(linearization(parameters, Fraction(1)).A33)


def equilibrium(parameters: Parameters, omega: object, name: EquilibriumName, digits: int = 15) -> Equilibrium:
    """State, eigenvalues to ``digits`` significant digits, and stability at the speed ``omega`` [rad/s].

    The half-width of each eigenvalue rests on the bound that a polynomial of degree n has a root within n |p/p'| of
    any point; the three discs are made disjoint, so each holds exactly one eigenvalue. Raises InputError for a speed or
    digits that are not offered, Shortfall where two eigenvalues cannot be told apart.
    """
    speed = checked_speed(omega)
    checked_digits(digits)
    state = location(name)
    matrix = linearization(parameters, speed, name)
    return Equilibrium(name, state, _eigenvalues(matrix, digits), is_stable(matrix))


def _eigenvalues(matrix: Linearization, digits: int) -> tuple[Eigenvalue, Eigenvalue, Eigenvalue]:
    guard = 15
    while True:
        working = bits_for_digits(digits + guard)
        ctx, finer = (bits(count).context for count in (working, 2 * working))
        exact = [Fraction(part) for part in characteristic_polynomial(matrix)]
        coefficients, fine = ([c.mpf(part.numerator) / part.denominator for part in exact] for c in (ctx, finer))
        try:
            roots = ctx.polyroots(coefficients, maxsteps=200, extraprec=2 * ctx.prec)
        except ctx.NoConvergence:
            raise Shortfall("the eigenvalues did not converge: are the parameters of a possible disk?") from None
        polished = []
        for root in roots:
            better = root
            for _ in range(3):
                value, slope = ctx.polyval(coefficients, better, derivative=True)
                if slope:
                    better -= value / slope
            # With twice the bits the residual is known to many digits. What is left: the coefficients are off by an
            # ulp each and Horner's rule adds a few more.
            value, slope = finer.polyval(fine, finer.mpc(better), derivative=True)
            size = sum(abs(c) * abs(better) ** (3 - n) for n, c in enumerate(fine))
            radius = 3 * (abs(value) + 16 * finer.eps * size) / abs(slope) if slope else ctx.inf
            polished.append((better, radius))
        if _disjoint(polished) and all(radius * ctx.mpf(10) ** digits < abs(root) for root, radius in polished):
            break
        guard *= 2
        if guard > 16 * digits + 1000:
            raise Shortfall("two eigenvalues coincide to all digits tried: move Omega away from the double eigenvalue")
    polished.sort(key=lambda pair: (-pair[0].real, -pair[0].imag))
    return tuple(_enclosed(root, radius) for root, radius in polished)  # type: ignore[return-value]


def _disjoint(discs: list[tuple[Any, Any]]) -> bool:
    return all(
        abs(first - second) > radius + other
        for index, (first, radius) in enumerate(discs)
        for second, other in discs[:index]
    )


def _enclosed(root: Any, radius: Any) -> Eigenvalue:
    # The coefficients are real: a disc that meets the real axis and no other disc holds a real eigenvalue.
    imaginary = Measured.of(0, 0) if abs(root.imag) <= radius else Measured.of(root.imag, radius)
    return Eigenvalue(Measured.of(root.real, radius), imaginary)
