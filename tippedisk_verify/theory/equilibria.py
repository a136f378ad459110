"""Stationary spinning: the two equilibria, their linearisation, eigenvalues and stability.

Inverted spinning is (pi/2, pi/2, 0), noninverted spinning (pi/2, -pi/2, 0) and its copy at gamma = 3 pi/2. Both
friction laws have the same linearisation there, because the sliding velocity vanishes at both and the smooth law's
slope at zero is the linear law's.

For rational parameters and a rational speed the linearisation is rational, so stability is decided exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Literal, NamedTuple, get_args

from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.exact import PI, Exact, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import checked_digits
from tippedisk_verify.model.results import Eigenvalue, Printable, as_json, quantity
from tippedisk_verify.model.surroundings import undisturbed
from tippedisk_verify.theory.real_roots import real_roots, square_root

__all__ = [
    "Equilibrium",
    "EquilibriumName",
    "Linearization",
    "characteristic_polynomial",
    "eigenvalues",
    "equilibrium",
    "is_stable",
    "kind_changes",
    "linearization",
    "location",
    "right_eigenvector",
    "saddle_value_sign",
    "stiff_eigenvalue_estimate",
]

EquilibriumName = Literal["inverted", "noninverted"]
_HALF = Fraction(1, 2)
_FASTEST = 10**6  # rad/s, as for all speeds
_GUARD = 20  # digits of a root beyond those asked for: what is computed from it has some fewer


class Linearization(NamedTuple):
    """Last row and kinematic entry of the Jacobian [[0, 0, 1], [Omega, 0, 0], [A31, A32, A33]] (Eq. A_coeff_O)."""

    omega: Any  #: d(gamma')/d(beta) [1/s]
    A31: Any  #: [1/s^2]
    A32: Any  #: [1/s^2]
    A33: Any  #: [1/s]


@dataclass(frozen=True, repr=False)
class Equilibrium(Printable):
    """One stationary state at one speed; `Disk.equilibrium` adds the speeds at which its eigenvalues change kind."""

    name: EquilibriumName
    state: tuple[Exact, Exact, Exact]  #: (beta, gamma, v) [rad, rad, rad/s]
    eigenvalues: tuple[Eigenvalue, Eigenvalue, Eigenvalue] = field(
        metadata=quantity("by descending real part, then imaginary part", "1/s")
    )
    stable: bool  #: all eigenvalues in the open left half-plane, by the exact Routh-Hurwitz criterion
    kind_changes: tuple[Measured, ...] | None = field(
        default=None, metadata=quantity("where eigenvalues turn from real to complex, or back", "rad/s")
    )

    def to_dict(self) -> dict[str, object]:
        told = {
            "state": {"beta": "pi/2", "gamma": "pi/2" if self.name == "inverted" else "-pi/2", "v": "0"},
            "stable": self.stable,
            "eigenvalues": as_json(self.eigenvalues),
        }
        return told if self.kind_changes is None else told | {"kind_changes": as_json(self.kind_changes)}


def location(name: EquilibriumName) -> tuple[Exact, Exact, Exact]:
    """(beta, gamma, v) of the equilibrium, exactly. Raises InputError for an unknown name."""
    if name not in get_args(EquilibriumName):
        raise InputError(f"equilibrium '{shown(name)}' is not known: use inverted or noninverted")
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


def saddle_value_sign(parameters: Parameters, omega: object) -> int:
    """The sign, 1, 0 or -1, of lambda_u + Re(lambda_s) at noninverted spinning, lambda_s the slower stable eigenvalue.

    Decided exactly. It is negative where limit cycles next to a connection of the saddles are stable. Below the speed
    Omega_crit (r - e) / (r + e) it is positive whatever the friction. Raises InputError as `checked_speed` does.
    """
    _, a2, a1, a0 = characteristic_polynomial(linearization(parameters, checked_speed(omega), "noninverted"))
    # a2 a1 - a0 is the product of the sums of the unstable eigenvalue with either stable one, times a positive number.
    # If the sums have one sign, it is that of lambda_u - a2, twice their mean: opposite to the polynomial's at a2 > 0.
    product, at_a2 = a2 * a1 - a0, 2 * a2**3 + a1 * a2 + a0
    if product < 0 or at_a2 < 0:
        return 1
    return -1 if product else 0


def right_eigenvector(matrix: Linearization, eigenvalue: Any) -> tuple[Any, Any, Any]:
    """(beta, gamma, v) direction with A x = lambda x, not normalised; from the first two rows."""
    return eigenvalue, matrix.omega, eigenvalue * eigenvalue


def stiff_eigenvalue_estimate(parameters: Parameters) -> Fraction:
    """A33 [1/s] at inverted spinning, which the paper gives as lambda_3 up to O(eps) (Eq. closed_la3)."""
    return Fraction(linearization(parameters, Fraction(1)).A33)


@undisturbed
def equilibrium(parameters: Parameters, omega: object, name: EquilibriumName, digits: int = 15) -> Equilibrium:
    """State, eigenvalues to ``digits`` significant digits, and stability at the speed ``omega`` [rad/s].

    Raises InputError for a speed or digits that are not offered, AccuracyError where two eigenvalues cannot be told
    apart.
    """
    speed = checked_speed(omega)
    digits = checked_digits(digits)
    state = location(name)
    matrix = linearization(parameters, speed, name)
    return Equilibrium(name, state, eigenvalues(matrix, digits), is_stable(matrix))


def eigenvalues(matrix: Linearization, digits: int) -> tuple[Eigenvalue, Eigenvalue, Eigenvalue]:
    """The eigenvalues [1/s] in `Equilibrium`'s order, with half-widths below 10**-digits of each one's size.

    The characteristic polynomial changes its sign at the real ones. If that is one, the sum and the product of the
    other two follow from it. Raises AccuracyError where two coincide, or nearly so.
    """
    zero, (lead, a2, a1, a0) = Measured.of(0, 0), map(Fraction, characteristic_polynomial(matrix))
    guard = _GUARD
    while guard <= 16 * digits + 1000:
        values = [Eigenvalue(root, zero) for root in real_roots((a0, a1, a2, lead), digits + guard)]
        if len(values) == 1:
            half = (-a2 - values[0].re) / 2
            square = half * half + a0 / values[0].re  # of half the distance of the other two
            if square.value + square.uncertainty < 0:
                imaginary = square_root(-square, digits + guard)
                values += [Eigenvalue(half, imaginary), Eigenvalue(half, -imaginary)]
        parts = [(value.re, value.im) for value in values]
        widths = [max(re.uncertainty, im.uncertainty) / max(abs(re.value), abs(im.value)) for re, im in parts]
        if len(values) == 3 and max(widths) < Fraction(1, 10**digits):
            first, second, third = sorted(values, key=lambda value: (-value.re.value, -value.im.value))
            return first, second, third
        guard *= 2
    raise AccuracyError("no three different eigenvalues fit the matrix: if two coincide, move Omega away from there")


def kind_changes(parameters: Parameters, name: EquilibriumName, digits: int = 12) -> tuple[Measured, ...]:
    """The speeds [rad/s], ascending, at which eigenvalues of an equilibrium turn from real to complex, or back.

    The discriminant of the characteristic polynomial is a cubic in Omega^2. Raises InputError for an unknown name, and
    for digits as `checked_digits` does.
    """
    location(name)
    digits = checked_digits(digits)
    unit = linearization(parameters, Fraction(1), name)
    a2, c, h = -unit.A33, unit.A31 + 1, -unit.A32  # a1 = Omega^2 - c and a0 = h Omega^2
    discriminant = (
        c**2 * (a2**2 + 4 * c),
        -2 * c * (9 * a2 * h + a2**2 + 6 * c) - 4 * a2**3 * h,
        18 * a2 * h + a2**2 + 12 * c - 27 * h**2,
        Fraction(-4),
    )
    squares = real_roots(discriminant, digits + _GUARD)
    return tuple(square_root(square, digits + _GUARD) for square in squares if 0 < square.value < _FASTEST**2)
