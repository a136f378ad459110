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
from tippedisk_verify.model.exact import PI, Exact, quotient, shown
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import bits, bits_for_digits, checked_digits
from tippedisk_verify.model.results import Printable, as_json

__all__ = [
    "Eigenvalue",
    "Equilibrium",
    "EquilibriumName",
    "Linearization",
    "characteristic_polynomial",
    "eigenvalue_discs",
    "equilibrium",
    "is_stable",
    "linearization",
    "location",
    "right_eigenvector",
    "saddle_value_sign",
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


@dataclass(frozen=True, repr=False)
class Equilibrium(Printable):
    """One stationary state at one speed."""

    name: EquilibriumName
    state: tuple[Exact, Exact, Exact]  #: (beta, gamma, v) [rad, rad, rad/s]
    eigenvalues: tuple[Eigenvalue, Eigenvalue, Eigenvalue]  #: by descending real part, then descending imaginary part
    stable: bool  #: all eigenvalues in the open left half-plane, by the exact Routh-Hurwitz criterion

    def to_dict(self) -> dict[str, object]:
        return {
            "state": {"beta": "pi/2", "gamma": "pi/2" if self.name == "inverted" else "-pi/2", "v": "0"},
            "eigenvalues": as_json(self.eigenvalues),
            "stable": self.stable,
        }


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
    first, second, third = (_enclosed(*disc) for disc in eigenvalue_discs(matrix, digits))
    return Equilibrium(name, state, (first, second, third), is_stable(matrix))


def eigenvalue_discs(matrix: Linearization, digits: int) -> list[tuple[Any, Any]]:
    """(centre, radius) [1/s] of disjoint discs with one eigenvalue each, by descending real, then imaginary part.

    Each radius is below 10**-digits of the centre's size, and follows from the matrix itself: candidates that are no
    eigenvalues of it are refused, however they were found. Raises Shortfall where no such discs are found.
    """
    guard = 15
    while guard <= 16 * digits + 1000:
        working = bits_for_digits(digits + guard)
        candidates = _candidates(_rounded(matrix, bits(working).context), bits(working).context)
        # With twice the bits the defect is known to many digits. What is left: the entries are off by an ulp each, and
        # products and sums add a few more.
        finer = bits(2 * working).context
        entries = _rounded(matrix, finer)
        discs = []
        for centre in map(finer.mpc, candidates):
            defect, slope, size = _defect(entries, centre)
            discs.append((centre, 3 * (abs(defect) + 16 * finer.eps * size) / abs(slope) if slope else finer.inf))
        if _disjoint(discs) and all(radius * finer.mpf(10) ** digits < abs(centre) for centre, radius in discs):
            upper, radius = max(discs, key=lambda disc: disc[0].imag)
            if upper.imag > radius:  # not real: the mirror image of its disc holds another
                real = min(discs, key=lambda disc: abs(disc[0].imag))
                discs = [real, (upper, radius), (finer.conj(upper), radius)]
            return sorted(discs, key=lambda disc: (-disc[0].real, -disc[0].imag))
        guard *= 2
    raise Shortfall("no three different eigenvalues fit the matrix: if two coincide, move Omega away from there")


def _rounded(matrix: Linearization, ctx: Any) -> Linearization:
    exact = (Fraction(part) for part in matrix)
    return Linearization(*(quotient(ctx, part) for part in exact))


def _defect(matrix: Linearization, value: Any) -> tuple[Any, Any, Any]:
    """What (A - value) x leaves in the last row, where x solves the first two; its slope; its terms' sizes [1/s^3].

    It is zero at the eigenvalues only: a polynomial of degree 3 in ``value``.
    """
    x = right_eigenvector(matrix, value)
    terms = matrix.A31 * x[0], matrix.A32 * x[1], matrix.A33 * x[2], -value * x[2]
    return sum(terms), matrix.A31 + (2 * matrix.A33 - 3 * value) * value, sum(map(abs, terms))


def _candidates(matrix: Linearization, ctx: Any) -> list[Any]:
    """Approximate eigenvalues, by the Durand-Kerner iteration for all three at once."""
    constant = abs(matrix.A32 * matrix.omega)
    size = max(abs(matrix.A33), ctx.sqrt(abs(matrix.A31)), ctx.cbrt(constant))  # none is larger than twice this
    values = [size * ctx.mpc("0.4", "0.9") ** n for n in range(3)]  # neither real nor conjugate to one another
    for _ in range(1000):  # far from the eigenvalues each step gains a factor only
        settled = True
        for n, value in enumerate(values):
            first, second = (other for m, other in enumerate(values) if m != n)
            apart = (value - first) * (value - second)
            step = -_defect(matrix, value)[0] / apart if apart else ctx.eps * size
            values[n] = value - step
            settled &= bool(abs(step) <= 64 * ctx.eps * abs(value))
        if settled:
            break
    return values


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
