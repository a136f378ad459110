"""The heteroclinic connection's speed by collocation on a truncated interval; see `collocated_cycles`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy

from tests.orbits.collocated_cycles import Disk, amplitude, family, linearised, rates
from tests.orbits.collocation import Array, Mesh, Number, Solution, estimated, solve


class Saddle(NamedTuple):
    """Eigenvalues and vectors at the noninverted states, which are (0, +-pi, 0) here."""

    unstable: float  #: eigenvalue [1/s]
    slow: float  #: the stable one nearer to 0 [1/s]
    outwards: Array  #: unstable eigenvector with gamma_bar = -1
    inwards: Array  #: eigenvector of the slow stable eigenvalue with gamma_bar = 1
    across: Array  #: left eigenvector of the unstable eigenvalue: 0 on the stable subspace


def saddle(disk: Disk, Omega: float) -> Saddle:
    """The saddle at one speed. gamma_bar' = -Omega beta_bar there, and beta_bar' = v."""
    jacobian = linearised(disk, Omega, math.pi)
    eigenvalues = numpy.sort(numpy.linalg.eigvals(jacobian).real)
    slow, unstable = eigenvalues[1:]
    left, vectors = numpy.linalg.eig(jacobian.T)
    across = vectors[:, left.real.argmax()].real
    slope = jacobian[1, 0]
    right = [numpy.array([rate / slope, 1.0, rate**2 / slope]) for rate in (unstable, slow)]
    return Saddle(unstable, slow, -right[0], right[1], across / abs(across).max())


_PLUS = numpy.array([0.0, math.pi, 0.0])


def solve_connection(disk: Disk, mesh: Mesh, guess: Solution, distance: float) -> Solution:
    """The orbit from (0, pi, 0) to (0, -pi, 0) cut off where gamma_bar is ``distance`` from them; unknowns time, Omega.

    It leaves along the unstable eigenvector and arrives in the stable subspace (Beyn's projection conditions). About
    the saddles the field is odd, so that the manifolds differ from these by the third power of the distance.
    """

    def field(state: Array, unknowns: Array) -> Array:
        return unknowns[0] * rates(disk, unknowns[1], state)

    def conditions(start: Array, end: Array, unknowns: Array) -> Array:
        here = saddle(disk, unknowns[1])
        left, right = start - _PLUS - distance * here.outwards, end + _PLUS
        return numpy.array([*left, here.across @ right, right[1] - distance])

    return solve(field, conditions, mesh, guess)


def nearer(disk: Disk, solution: Solution, distance: float, factor: float) -> Solution:
    """A guess for a connection cut off nearer to the saddles by a factor: the linear flow at both ends."""
    time, Omega = solution.unknowns
    here = saddle(disk, Omega)
    before, after = math.log(factor) / here.unstable, math.log(factor) / -here.slow
    early, late = numpy.linspace(-before, 0, 20, endpoint=False), numpy.linspace(after, 0, 20, endpoint=False)[::-1]
    values = [
        _PLUS[:, None] + distance * here.outwards[:, None] * numpy.exp(here.unstable * early),
        solution.values,
        -_PLUS[:, None] + distance * here.inwards[:, None] * numpy.exp(here.slow * late),
    ]
    times = numpy.concatenate([early, solution.times * time, time + late])
    whole = before + time + after
    return Solution((times + before) / whole, numpy.hstack(values), numpy.array([whole, Omega]))


def connection_guess(disk: Disk, distance: float) -> Solution:
    """A cycle that passes close by the saddles, cut off where gamma_bar is ``distance`` from them."""
    half, Omega, u = (cycle := family(disk, 4.0)[-1]).unknowns
    times = numpy.linspace(0, 1, 801)
    values = amplitude(u) * cycle.at(times)
    inside = abs(values[1]) <= math.pi - distance
    times, values = times[inside], values[:, inside]
    span = times[-1] - times[0]
    return Solution((times - times[0]) / span, values, numpy.array([half * span, Omega]))


def omega_h(disk: Disk, intervals: int = 64, guess: Solution | None = None) -> tuple[Number, Solution]:
    """The speed of the heteroclinic connection, and the orbit cut off at a distance of 0.1 for the next disk's guess.

    The saddles must have real eigenvalues. The error adds to that of the mesh what moving the ends from 1e-3 to a third
    of it does; what remains goes with the distance's third power at least, and is smaller by a factor of 26 or more.
    """
    far = solve_connection(disk, Mesh(intervals), guess or connection_guess(disk, 0.1), 0.1)
    distance, orbit, ends = 0.1, far, []
    for factor in (10, 10, 3):
        orbit = nearer(disk, orbit, distance, factor)
        distance /= factor
        orbit = solve_connection(disk, Mesh(intervals), orbit, distance)
        ends.append(orbit.unknowns[1])
    solution, errors = estimated(
        lambda inputs, *run: solve_connection(Disk.of(inputs), *run, distance), disk, intervals, orbit
    )
    return Number.of(solution.unknowns[1], errors[1] + abs(ends[-1] - ends[-2])), far
