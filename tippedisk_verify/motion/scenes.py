"""The six panels of the paper's Figures 3D and proj_3D: two orbits each, with their outcomes.

A scene declares its needs. Panels b to f need a plain integrator and samples. Orbits of panel a
leave the model, so it needs the event sin(beta) = 0 as well. Nothing else is built for them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import Any, Literal

import numpy

from tippedisk_verify.display import Printable
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.flow.contract import Build, Engine, Request, Result, Status
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import PI, Exact, exact, is_one_of, short_text
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.theory.equilibria import is_stable, linearization
from tippedisk_verify.theory.hopf import omega_crit

__all__ = [
    "INITIAL_STATES",
    "SCENES",
    "ComputedScene",
    "Orbit",
    "OrbitOutcome",
    "Scene",
    "angle_from_inverted",
    "scene_named",
]

_HALF_PI = PI * Fraction(1, 2)
#: The paper's initial states x_0^1 and x_0^2, as (beta, gamma, v) [rad, rad, rad/s].
INITIAL_STATES: tuple[tuple[Exact, Exact, Exact], ...] = (
    (_HALF_PI, -_HALF_PI, exact(2)),
    (_HALF_PI, _HALF_PI + exact("0.4"), exact(0)),
)

# Near Omega_crit the cycle attracts at a rate of about 0.1 per second: 120 s bring its distance
# below 1e-4 of itself.
_DURATION = 120
_SAMPLES_PER_SECOND = 100
_MIN_CROSSINGS = 12  # the number of crossings that decide the outcome
_MAX_BEND = 0.5  # at this bend the parabola's zero is a sixth farther than the line's
# A section amplitude below this is near the inverted state [rad].
_MIN_AMPLITUDE = 0.05
# The error of a section amplitude [rad]. The Taylor engine's dense output is as accurate as its
# steps. An orbit near an attracting cycle keeps only the latest rounding errors, of inputs too.
_CROSSING_ERROR = 1e-12

OutcomeKind = Literal[
    "inverted spinning", "limit cycle", "rotating limit cycle", "flat", "undecided"
]
# The name of an amplitude in JSON.
_AMPLITUDES = {"limit cycle": "gamma_bar_at_section", "rotating limit cycle": "beta_bar_at_top"}


@dataclass(frozen=True, repr=False)
class Scene(Printable):
    """One panel of the paper's figures of orbits: its speed, relative to Omega_h or Omega_crit, and
    its special needs.
    """

    name: str
    base: Literal["Omega_h", "Omega_crit"]
    offset: Fraction  #: [rad/s]
    flat_event: bool = False  #: orbits leave the model's domain, and the time is part of the result

    @property
    def title(self) -> str:
        """The panel's title in TeX."""
        sign = "−" if self.offset < 0 else "+"
        label = {"Omega_h": r"\Omega_\mathrm{h}", "Omega_crit": r"\Omega_\mathrm{crit}"}[self.base]
        return rf"({self.name}) $\Omega = {label} {sign} {float(abs(self.offset)):g}$ rad/s"

    def omega(self, parameters: Parameters, omega_h: Measured | None) -> Measured:
        """Return the panel's speed [rad/s].

        Args:
            parameters: The disk.
            omega_h: Omega_h [rad/s], which some panels need.

        Raises:
            InputError: If the panel needs an Omega_h, and none is given.
        """
        if self.base == "Omega_crit":
            base = omega_crit(parameters, 20)
        elif omega_h is None:
            raise InputError(f"scene {self.name} needs Omega_h")
        else:
            base = omega_h
        return base + self.offset


#: The panels, with the labels of the paper's Figure 3D.
SCENES: tuple[Scene, ...] = (
    Scene("a", "Omega_h", Fraction(-1, 10), flat_event=True),
    Scene("b", "Omega_h", Fraction(1, 100)),
    Scene("c", "Omega_h", Fraction(1, 10)),
    Scene("d", "Omega_crit", Fraction(-1, 2)),
    Scene("e", "Omega_crit", Fraction(-1, 5)),
    Scene("f", "Omega_crit", Fraction(1, 2)),
)


def scene_named(name: str) -> Scene:
    """Return the scene, a panel of the paper's figures of orbits, with a given letter.

    Args:
        name: The letter.

    Raises:
        InputError: If there is no such panel.
    """
    for scene in SCENES:
        if is_one_of(name, [scene.name]):
            return scene
    raise InputError(f"scene '{short_text(name)}' is not known: use a, b, c, d, e, f or all")


@dataclass(frozen=True, repr=False)
class OrbitOutcome(Printable):
    """The outcome of an orbit by the criterion of `classify_orbit`: the attractor, if it has one."""

    kind: OutcomeKind
    reason: str
    time: Measured | None = None  #: when the disk lies flat [s]
    #: |gamma - pi/2| of the limit cycle at beta = pi/2, |beta - pi/2| of the rotating one at gamma
    #: = pi/2 [rad]
    amplitude: Measured | None = None
    #: The number of times gamma passed a noninverted state before the disk lay flat.
    wells_passed: int | None = None

    def to_dict(self) -> dict[str, object]:
        """Return the outcome of an orbit as data for JSON, without empty entries."""
        values = super().to_dict()
        values[_AMPLITUDES.get(self.kind, "amplitude")] = values.pop("amplitude")
        return {name: value for name, value in values.items() if value is not None}


@dataclass(frozen=True)
class Orbit:
    """One orbit of a scene, with its outcome."""

    start: tuple[Exact, Exact, Exact]
    times: Any  #: (n,) [s]
    states: Any  #: (n, 3) [rad, rad, rad/s]
    outcome: OrbitOutcome
    steps: int


@dataclass(frozen=True, repr=False)
class ComputedScene(Printable):
    """A computed scene of the paper's figures: its speed and its orbits."""

    scene: Scene
    parameters: Parameters  #: of the disk, with the friction law
    omega: Measured  #: [rad/s]
    inverted_stable: bool
    noninverted_stable: bool
    orbits: tuple[Orbit, ...]
    compiled: tuple[Build, ...]  #: the compiled integrators used

    def to_dict(self) -> dict[str, object]:
        """Return the scene's speed, its orbits' outcomes and the compiled integrators as data for
        JSON.
        """
        relative = self.scene.base == "Omega_h"
        return {
            "omega": self.omega.to_dict(),
            **({"omega_h": (self.omega - self.scene.offset).to_dict()} if relative else {}),
            "attractor": [orbit.outcome.to_dict() for orbit in self.orbits],
            "compiled": [build.to_dict() for build in self.compiled],
        }


def compute_scene(
    scene: Scene, parameters: Parameters, engine: Engine, *, omega_h: Measured | None = None
) -> ComputedScene:
    """Integrate the orbits of a scene of the paper and determine their outcomes.

    Args:
        scene: The panel.
        parameters: The disk.
        engine: The integrator.
        omega_h: Omega_h [rad/s], which some panels need.

    Returns:
        The panel with both orbits and their outcomes.

    Raises:
        InputError: If the panel needs an Omega_h and none is given, or the engine does not measure
            its errors.
        AccuracyError: If an integration fails.
    """
    if not engine.measures_error:
        raise InputError(
            f"a scene needs an engine that measures its errors, such as taylor, not {engine.name}"
        )
    omega = scene.omega(parameters, omega_h)
    if omega.value <= 0:
        raise InputError(f"scene {scene.name}: its speed {float(omega):g} rad/s is not positive")
    times = numpy.arange(_DURATION * _SAMPLES_PER_SECOND + 1) / _SAMPLES_PER_SECOND
    orbits = []
    compiled: dict[Build, None] = {}
    stable = is_stable(linearization(parameters, omega.value))
    for start in INITIAL_STATES:
        request = Request(
            parameters,
            omega.value,
            start,
            float(times[-1]),
            times=times,
            dense=True,
            domain="event" if scene.flat_event else "samples",
        )
        result = engine(request)
        if not result.status.usable:
            raise AccuracyError(
                f"scene {scene.name}: at t = {float(result.time):.4g} s {result.status.value}"
            )
        compiled |= dict.fromkeys(result.built)
        if result.status is Status.FLAT:
            outcome, timed = _flat_outcome(request, engine, omega)
            compiled |= dict.fromkeys(timed.built)
        else:
            outcome = classify_orbit(result, times, float(omega), stable)
        count = len(result.samples)
        orbits.append(Orbit(start, times[:count], result.samples, outcome, result.steps))
    return ComputedScene(
        scene=scene,
        parameters=parameters,
        omega=omega,
        inverted_stable=stable,
        noninverted_stable=is_stable(linearization(parameters, omega.value, "noninverted")),
        orbits=tuple(orbits),
        compiled=tuple(compiled),
    )


def classify_orbit(result: Result, times: Any, omega: float, inverted_stable: bool) -> OrbitOutcome:
    """Return the outcome of an orbit that keeps standing.

    The amplitudes A_n = |gamma - pi/2| modulo 2 pi at the crossings of beta = pi/2 decide. By the
    point symmetry each is the same function of the previous one.

    - *Inverted spinning*: it is asymptotically stable (exact Routh-Hurwitz), the last ten A_n fall,
      and the last is below 0.05 rad.
    - *Limit cycle*: the changes A_(n+1) - A_n shrink geometrically. Their limit lies above 0.05
      rad, and the remaining distance is below a hundredth of it.
    - *Rotating limit cycle*: beta has not crossed pi/2 for twelve turns of gamma. And |beta - pi/2|
      at gamma = pi/2 modulo 2 pi has such a limit.
    - *Undecided*: anything else.

    Args:
        result: The orbit, with samples and dense output.
        times: (n,) the times of the samples [s].
        omega: The spinning speed [rad/s].
        inverted_stable: True if inverted spinning is stable.
    """
    # beta = pi/2
    upright, states = _crossings(times, result, lambda y: y[:, 0] - math.pi / 2, lambda y: y[:, 2])
    amplitudes = abs(angle_from_inverted(states[:, 1]))
    # gamma = pi/2 modulo 2 pi
    tops, states = _crossings(
        times, result, lambda y: angle_from_inverted(y[:, 1]), lambda y: -omega * numpy.cos(y[:, 0])
    )
    leans = abs(states[:, 0] - math.pi / 2)
    # While beta stays on one side of pi/2, gamma is monotonic: gamma' = -Omega cos(beta).
    turns = leans[tops > upright[-1]] if len(upright) else leans
    if len(turns) >= _MIN_CROSSINGS:
        return _cycle_outcome("rotating limit cycle", turns.tolist())
    if len(amplitudes) < _MIN_CROSSINGS:
        return OrbitOutcome(
            "undecided", f"only {len(amplitudes)} section crossings in {float(result.time):g} s"
        )
    recent = amplitudes[-11:]
    if inverted_stable and numpy.diff(recent).max() < 0 and recent[-1] < _MIN_AMPLITUDE:
        return OrbitOutcome(
            "inverted spinning", f"section amplitude falls steadily, to {recent[-1]:.2g} rad"
        )
    return _cycle_outcome("limit cycle", amplitudes.tolist())


def _cycle_outcome(kind: OutcomeKind, amplitudes: list[float]) -> OrbitOutcome:
    """Return the outcome "on a cycle of this kind" if the orbit's amplitudes converge to a cycle,
    otherwise "undecided".
    """
    error = _CROSSING_ERROR
    changes = [after - before for before, after in pairwise(amplitudes)]
    # The rate is measured where changes exceed the amplitudes' own error; the last of these are
    # closest to the limit. The motion after the last crossing follows from the last change, or from
    # that error if the change is smaller.
    significant = [abs(change) for change in changes if abs(change) > 10 * error][-10:]
    ratio = _mean_ratio(significant)
    if ratio >= 1:
        return OrbitOutcome("undecided", "section amplitudes have not settled; integrate longer")
    # Close to the cycle the change is a linear function of the amplitude. A parabola through the
    # two halves has a zero, too, if the bend is below 1. The bend is 1 at a fold of cycles, below
    # which orbits slow down and then go on.
    early, late = _mean_ratio(significant[:6]), _mean_ratio(significant[4:])
    bend = 0.0
    if max(early, late) < 1:
        bend = 4 * significant[-1] * (late - early) / (sum(significant) * (1 - late) ** 2)
    if bend > _MAX_BEND:
        return OrbitOutcome(
            "undecided", "section amplitudes settle ever more slowly; integrate longer"
        )
    remaining = max(abs(changes[-1]), error) * ratio / (1 - ratio)
    limit = amplitudes[-1] + math.copysign(remaining, changes[-1])
    if limit > _MIN_AMPLITUDE and remaining < limit / 100:
        # Twice the remaining distance, because the ratio is an estimate.
        amplitude = Measured.of(limit, 2 * remaining + error)
        return OrbitOutcome(kind, "section amplitudes converge geometrically", amplitude=amplitude)
    return OrbitOutcome(
        "undecided", f"section amplitudes tend to {limit:.3g} rad, {remaining:.1g} away"
    )


def _mean_ratio(changes: list[float]) -> float:
    """Return the average factor from each change to the next.

    It is infinite for fewer than three changes.
    """
    return (changes[-1] / changes[0]) ** (1 / (len(changes) - 1)) if len(changes) > 2 else math.inf


def angle_from_inverted(gamma: Any) -> Any:
    """Return gamma - pi/2 modulo 2 pi, from -pi to pi.

    Args:
        gamma: [rad]; arrays are accepted.
    """
    return (gamma + math.pi / 2) % (2 * math.pi) - math.pi


def _crossings(
    times: Any, result: Result, offset: Callable[[Any], Any], slope: Callable[[Any], Any]
) -> tuple[Any, Any]:
    """Return the times and states (n, 3) of the crossings of a section after the start.

    ``offset`` is zero on the section, and ``slope`` is its derivative in time. Neighbouring samples
    enclose a crossing. Newton's method on the dense output locates it.
    """
    if result.dense is None:
        raise InputError("crossings of a section need dense output")
    offsets = offset(result.samples[1:])
    left, right = offsets[:-1], offsets[1:]
    # An angle's jump is not a crossing
    index = numpy.flatnonzero((left * right < 0) & (abs(left - right) < math.pi))
    if not len(index):
        return numpy.empty(0), numpy.empty((0, 3))
    left, right = left[index], right[index]
    when = times[index + 1] + (times[index + 2] - times[index + 1]) * left / (left - right)
    for _ in range(4):  # from a secant over 0.01 s, four squarings bring the error below rounding
        states = result.dense(when)
        when = when - offset(states) / slope(states)
    return when, result.dense(when)


def _flat_outcome(request: Request, engine: Engine, omega: Measured) -> tuple[OrbitOutcome, Result]:
    """Return the outcome of an orbit whose disk lies flat, and the result of the run that timed it.

    The time's half-width holds the error of the integration and the effect of the speed's own
    uncertainty. Raises AccuracyError if rounding decides whether the disk lies flat.
    """
    bare = replace(request, times=None, dense=False)
    timed = engine(replace(bare, error_estimate=True))
    moved = engine(replace(bare, omega=omega.value + omega.uncertainty))
    if timed.error is None or not math.isfinite(timed.error.time):
        raise AccuracyError(
            "rounding decides whether the disk lies flat in this scene: no time in double precision"
        )
    time = Measured.of(
        timed.time, timed.error.time + 2 * abs(float(moved.time) - float(timed.time)) + 1e-15
    )
    wells = math.floor(abs(float(timed.state[1]) - math.pi / 2) / (2 * math.pi) + 0.5)
    states = "noninverted state" if wells == 1 else "noninverted states"
    reason = f"passed {wells} {states}, then sin(beta) = 0"
    return OrbitOutcome("flat", reason, time=time, wells_passed=wells), timed
