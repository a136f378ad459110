"""Stationary spinning: the two equilibria, their linearisation, eigenvalues and stability.

Inverted spinning is (pi/2, pi/2, 0). Noninverted spinning is (pi/2, -pi/2, 0), with a copy at
gamma = 3 pi/2. Both friction laws have the same linearisation there: the sliding velocity vanishes
at both, and the smooth law's slope at zero is the linear law's.

For rational parameters and a rational speed the linearisation is rational, so stability is decided
exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Literal, NamedTuple, get_args

from tippedisk_verify.display import Eigenvalue, Printable, as_json, quantity
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import PI, Exact, is_one_of, short_text
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.numbers.precision import checked_digits
from tippedisk_verify.theory.real_roots import real_roots, square_root

__all__ = [
    "Equilibrium",
    "EquilibriumName",
    "Linearization",
    "characteristic_polynomial",
    "eigenvalues",
    "equilibrium",
    "equilibrium_state",
    "is_stable",
    "kind_changes",
    "linearization",
    "right_eigenvector",
    "saddle_value_sign",
    "stiff_eigenvalue_estimate",
]

EquilibriumName = Literal["inverted", "noninverted"]
_HALF = Fraction(1, 2)
_MAX_SPEED = 10**6  # rad/s, as for all speeds
_GUARD_DIGITS = 20  # extra digits of a root, because numbers computed from it lose some


class Linearization(NamedTuple):
    """The entries of the Jacobian [[0, 0, 1], [Omega, 0, 0], [A31, A32, A33]] of the equations of
    motion at an equilibrium (Eq. A_coeff_O).
    """

    omega: Any  #: d(gamma')/d(beta) [1/s]
    A31: Any  #: [1/s^2]
    A32: Any  #: [1/s^2]
    A33: Any  #: [1/s]


@dataclass(frozen=True, repr=False)
class Equilibrium(Printable):
    """A stationary state of the disk at one speed, inverted or noninverted spinning, with its
    eigenvalues and stability.

    `Disk.equilibrium` adds the speeds at which its eigenvalues change kind.
    """

    name: EquilibriumName
    state: tuple[Exact, Exact, Exact]  #: (beta, gamma, v) [rad, rad, rad/s]
    eigenvalues: tuple[Eigenvalue, Eigenvalue, Eigenvalue] = field(
        metadata=quantity("by descending real part, then imaginary part", "1/s")
    )
    #: All eigenvalues in the open left half-plane, by the exact Routh-Hurwitz criterion
    stable: bool
    kind_changes: tuple[Measured, ...] | None = field(
        default=None,
        metadata=quantity("where eigenvalues turn from real to complex, or back", "rad/s"),
    )

    def to_dict(self) -> dict[str, object]:
        """Return the equilibrium as data for JSON."""
        entries = {
            "state": {
                "beta": "pi/2",
                "gamma": "pi/2" if self.name == "inverted" else "-pi/2",
                "v": "0",
            },
            "stable": self.stable,
            "eigenvalues": as_json(self.eigenvalues),
        }
        if self.kind_changes is not None:
            entries["kind_changes"] = as_json(self.kind_changes)
        return entries


def equilibrium_state(name: EquilibriumName) -> tuple[Exact, Exact, Exact]:
    """Return the state (beta, gamma, v) of an equilibrium, exactly.

    Args:
        name: ``inverted`` or ``noninverted``.

    Raises:
        InputError: If there is no equilibrium of that name.
    """
    if not is_one_of(name, get_args(EquilibriumName)):
        raise InputError(
            f"equilibrium '{short_text(name)}' is not known: use inverted or noninverted"
        )
    side = _HALF if name == "inverted" else -_HALF
    return PI * _HALF, PI * side, Exact(Fraction(0))


def linearization(
    parameters: Parameters, omega: Fraction, name: EquilibriumName = "inverted"
) -> Linearization:
    """Return the entries of the Jacobian of the equations of motion at an equilibrium, as exact
    rationals.

    They follow Eqs. 3DOF_lin and A_coeff_O. At noninverted spinning e changes its sign, because
    sin(gamma) = -1 there.

    Args:
        parameters: The disk.
        omega: The spinning speed [rad/s].
        name: ``inverted`` or ``noninverted``.
    """
    constants = parameters.rational_constants()
    side = 1 if name == "inverted" else -1
    height = constants.r + side * constants.e
    friction = constants.k / constants.b
    return Linearization(
        omega=omega,
        A31=constants.g * height / constants.b - omega**2,
        A32=-side * friction * constants.e * height * omega,
        A33=-friction * height**2,
    )


def characteristic_polynomial(matrix: Linearization) -> tuple[Any, Any, Any, Any]:
    """Return the coefficients (1, a2, a1, a0) of the characteristic polynomial of a linearisation.

    It is lambda^3 + a2 lambda^2 + a1 lambda + a0 [1/s^3].

    Args:
        matrix: The linearisation.
    """
    return 1, -matrix.A33, -matrix.A31, -matrix.omega * matrix.A32


def is_stable(matrix: Linearization) -> bool:
    """Return True if a linearised motion is asymptotically stable, by Routh-Hurwitz: a2 > 0, a0 > 0
    and a2 a1 > a0.

    The result is exact for exact entries.

    Args:
        matrix: The linearisation.
    """
    _, a2, a1, a0 = characteristic_polynomial(matrix)
    return bool(a2 > 0 and a0 > 0 and a2 * a1 > a0)


def saddle_value_sign(parameters: Parameters, omega: object) -> int:
    """Return the sign, 1, 0 or -1, of lambda_u + Re(lambda_s) at noninverted spinning, exactly.

    lambda_s is the slower stable eigenvalue. Where the sign is negative, limit cycles near a
    connection of the saddles are stable. Below the speed Omega_crit (r - e) / (r + e) it is
    positive for every friction.

    Args:
        parameters: The disk.
        omega: The spinning speed [rad/s].

    Raises:
        InputError: If ``omega`` is not a speed.
    """
    _, a2, a1, a0 = characteristic_polynomial(
        linearization(parameters, checked_speed(omega), "noninverted")
    )
    # a2 a1 - a0 is a positive number times the product of two sums: those of the unstable
    # eigenvalue with either stable one. If both sums have one sign, it is that of lambda_u - a2,
    # twice their mean. That sign is opposite to the polynomial's at a2 > 0.
    product, at_a2 = a2 * a1 - a0, 2 * a2**3 + a1 * a2 + a0
    if product < 0 or at_a2 < 0:
        return 1
    return -1 if product else 0


def right_eigenvector(matrix: Linearization, eigenvalue: Any) -> tuple[Any, Any, Any]:
    """Return the eigenvector x in (beta, gamma, v) of a linearisation A to a given eigenvalue, not
    normalised.

    A x = lambda x; x follows from the first two rows.

    Args:
        matrix: The linearisation.
        eigenvalue: lambda [1/s].
    """
    return eigenvalue, matrix.omega, eigenvalue * eigenvalue


def stiff_eigenvalue_estimate(parameters: Parameters) -> Fraction:
    """Return an estimate of the fast eigenvalue lambda_3 of inverted spinning: the Jacobian's entry
    A33 [1/s].

    It is the paper's lambda_3 up to O(eps) (Eq. closed_la3).

    Args:
        parameters: The disk.
    """
    return Fraction(linearization(parameters, Fraction(1)).A33)


@ignore_numpy_errors()
def equilibrium(
    parameters: Parameters, omega: object, name: EquilibriumName, digits: int = 15
) -> Equilibrium:
    """Return the state, the eigenvalues and the stability of an equilibrium.

    Args:
        parameters: The disk.
        omega: The spinning speed [rad/s].
        name: ``inverted`` or ``noninverted``.
        digits: Significant digits of each eigenvalue.

    Raises:
        InputError: If an argument cannot be used.
        AccuracyError: If two eigenvalues cannot be distinguished.
    """
    speed = checked_speed(omega)
    digits = checked_digits(digits)
    state = equilibrium_state(name)
    matrix = linearization(parameters, speed, name)
    return Equilibrium(name, state, eigenvalues(matrix, digits), is_stable(matrix))


def eigenvalues(matrix: Linearization, digits: int) -> tuple[Eigenvalue, Eigenvalue, Eigenvalue]:
    """Return the eigenvalues [1/s] of a linearisation, in `Equilibrium`'s order.

    Their half-widths are below 10**-digits of each one's size. The characteristic polynomial
    changes its sign at the real ones. If there is only one of these, the sum and the product of the
    other two follow from it.

    Args:
        matrix: The linearisation, with rational entries.
        digits: Significant digits of each eigenvalue.

    Raises:
        AccuracyError: If two eigenvalues coincide, or nearly so.
    """
    zero, (lead, a2, a1, a0) = Measured.of(0, 0), map(Fraction, characteristic_polynomial(matrix))
    guard = _GUARD_DIGITS
    while guard <= 16 * digits + 1000:
        values = [Eigenvalue(root, zero) for root in real_roots((a0, a1, a2, lead), digits + guard)]
        if len(values) == 1:
            half = (-a2 - values[0].re) / 2
            square = half * half + a0 / values[0].re  # (half the others' distance)^2
            if square.value + square.uncertainty < 0:
                imaginary = square_root(-square, digits + guard)
                values += [Eigenvalue(half, imaginary), Eigenvalue(half, -imaginary)]
        parts = [(value.re, value.im) for value in values]
        widths = [
            max(re.uncertainty, im.uncertainty) / max(abs(re.value), abs(im.value))
            for re, im in parts
        ]
        if len(values) == 3 and max(widths) < Fraction(1, 10**digits):
            first, second, third = sorted(
                values, key=lambda value: (-value.re.value, -value.im.value)
            )
            return first, second, third
        guard *= 2
    raise AccuracyError("three different eigenvalues were not found: if two coincide, change Omega")


def kind_changes(
    parameters: Parameters, name: EquilibriumName, digits: int = 12
) -> tuple[Measured, ...]:
    """Return the speeds [rad/s], ascending, at which eigenvalues of an equilibrium turn from real
    to complex or back.

    The discriminant of the characteristic polynomial is a cubic in Omega^2.

    Args:
        parameters: The disk.
        name: ``inverted`` or ``noninverted``.
        digits: Significant digits of each speed.

    Raises:
        InputError: If the name or the number of digits cannot be used.
    """
    equilibrium_state(name)
    digits = checked_digits(digits)
    unit = linearization(parameters, Fraction(1), name)
    a2, c, h = -unit.A33, unit.A31 + 1, -unit.A32  # a1 = Omega^2 - c and a0 = h Omega^2
    discriminant = (
        c**2 * (a2**2 + 4 * c),
        -2 * c * (9 * a2 * h + a2**2 + 6 * c) - 4 * a2**3 * h,
        18 * a2 * h + a2**2 + 12 * c - 27 * h**2,
        Fraction(-4),
    )
    squares = real_roots(discriminant, digits + _GUARD_DIGITS)
    return tuple(
        square_root(square, digits + _GUARD_DIGITS)
        for square in squares
        if 0 < square.value < _MAX_SPEED**2
    )
