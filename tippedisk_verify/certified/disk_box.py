"""Boxes of disks: what is proved of every disk that is near enough to a given one, and of what is similar to these.

**Similarity.** Under the linear law the equations of motion know r, e, a = A / m, b = (B - m e^2) / m, g and
k = mu g / epsilon. With L = r / r_0 and tau = sqrt((r / g) / (r_0 / g_0)) the orbits of a disk at the speed Omega are
those of the disk (r_0, e / L, a / L^2, b / L^2, g_0, tau k) at the speed tau Omega, run through tau times as slowly: in
the equation for v' the mass has the factor L^2, and each term of the force the factor L^2 / tau^2. So a disk's orbits
are known from those of a disk with r_0 and g_0, and from its four numbers

    e / r,   A / (m r^2),   (B - m e^2) / (m r^2),   mu sqrt(g r) / epsilon.

A box of width R is the set of all disks each of whose four numbers is (1 + d) times that of the middle disk, with
|d| <= R. It is enough to prove a statement of those that have r = r_0 and g = g_0 of the middle disk: they have
(1 + d) times the middle disk's e, a, b and k.

**What is proved of a box** is proved of each of its disks by itself. Balls for (e, a, b, k) straight in the recurrences
would grow like balls of states do (`flow`). So the d are deviations like those of the start and of the speed (`frame`,
`curve_flow`): the middle's orbit is that of the middle disk, and the derivatives by d have columns of their own. The
start and the speed may move with d (`Disks.along`), so that what is followed is, to first order in d, the same cycle of
each disk. Disks also differ in how long a flight takes, and a difference in time would show in all states on the way.
So a disk's time may run at a pace of its own, 1 + sum of `Disks.pace` times d: the rates are multiplied by this number,
which changes neither the orbits nor what is true of them on a section.

Where a ball becomes a point or a float: nowhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from tippedisk_verify.certified.balls import arb, ball
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import rounded_down
from tippedisk_verify.model.parameters import Constants, Parameters

__all__ = ["ALONE", "ONE_DISK", "SHAPE", "Disks", "MovingBox", "disks_off", "each_within"]

SHAPE = ("e", "a", "b", "k")  #: what a box widens, in the order of every list
_SHARES = 1000  # in how many parts a width is cut to find what it leaves each of the eight numbers


class Disks(NamedTuple):
    """Disks near the one whose constants are at hand, and how the speed moves with them."""

    off: Sequence[Any] = ()  #: d, balls about zero or nodes, in the order of `SHAPE`; none: one disk
    along: Sequence[Any] = ()  #: dOmega/dd [rad/s], points
    pace: Sequence[Any] = ()  #: how much longer than the middle disk's a disk's second is, by d; points

    def constants(self, constants: Constants) -> Constants:
        """(1 + d) times the constants of `SHAPE`; those that the linear law does not need are left out."""
        if not self.off:
            return constants
        nothing: dict[str, Any] = dict.fromkeys(("m", "A", "B", "Bbar", "mu", "epsilon", "traction"))
        moved = {name: getattr(constants, name) * (1 + d) for name, d in zip(SHAPE, self.off, strict=True)}
        return constants._replace(**nothing, **moved)

    def speed(self, omega: Any) -> Any:
        """The speeds of these disks where that of the middle one is ``omega``."""
        for slope, d in zip(self.along, self.off, strict=True):
            omega = omega + slope * d
        return omega

    def recorded(self, graph: Any) -> Disks:
        """The same as numbers of a graph of `series`, with derivatives by d."""
        slopes = (list(map(graph.number, part)) for part in (self.along, self.pace))
        return Disks([graph.number(d, active=True) for d in self.off], *slopes)

    def paced(self, rates: Sequence[Any]) -> tuple[Any, ...]:
        """Rates by the time that runs at each disk's own pace."""
        factor: Any = 1
        for slope, d in zip(self.pace, self.off, strict=False):
            factor = factor + slope * d
        return tuple(factor * rate for rate in rates) if self.pace else tuple(rates)


ONE_DISK = Disks()


def disks_off(width: Fraction) -> list[Any]:
    """d of all disks of a box, at the working precision; none for one disk, of no width."""
    return [arb(0, ball(width).upper()) for _ in SHAPE] if width else []


class MovingBox(NamedTuple):
    """A box of disks about a given one, with a range of speeds that moves with the disk."""

    width: Fraction  #: at most |d|; 0: one disk
    along: tuple[
        Fraction, ...
    ]  #: the speeds of a disk are those of the middle one and the sum of these times d [rad/s]

    def disks(self) -> Disks:
        """At the working precision."""
        return Disks(disks_off(self.width), [ball(slope) for slope in self.along])

    def moved(self) -> Fraction:
        """By how much a disk's speeds differ from the middle one's, at most [rad/s]."""
        return self.width * sum(map(abs, self.along), Fraction(0))


ALONE = MovingBox(Fraction(0), ())


def each_within(disk: Parameters, width: Fraction) -> str:
    """How far each of the disk's eight numbers may be off, relatively, so that its four stay in the box: a decimal.

    Each of the four is largest, or smallest, where every one of the eight that it grows with is largest, or smallest,
    and the others the opposite.
    """

    def inside(x: Fraction) -> bool:
        up, down = 1 + x, 1 - x
        for most, least in ((up, down), (down, up)):
            e_r, a = most / least, most / least**3
            b = (disk.B * a - disk.m * disk.e**2 * (least / most) ** 2) / disk.Bbar
            k = most**2 / least
            if not all(abs(part - 1) <= width for part in (e_r, a, b, k)):
                return False
        return True

    return next(
        text for n in range(_SHARES, 0, -1) if inside(exact(text := rounded_down(width * n / _SHARES)).rational)
    )
