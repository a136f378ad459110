"""Limit cycles of all amplitudes of an interval at once: flights over curves of starts, and Krawczyk's test of them.

**The curve.** For s in [-1, 1] let p(s) be three polynomials: (gamma_bar, v, Omega), or at the Hopf point (q, v / a,
Omega), where q = a^2 >= 0 and the state is a (b, g, u). Deviations d of p lie in a box about zero. Angles are from
inverted spinning; with a = 1 the second kind's equations are those of the first, so that they are written down once.
A step's length is a share of T(s), a polynomial that is about half the period.

**A set of states** is middle(s) + lead(s) d + axes q, with jets `middle` and `lead` and q in the box ``rest``; the
derivatives by p are lead + axes x with x in ``spread``; ``own`` is the part of ``rest`` for d = 0. *For each s by
itself* a step is shown as in `steps`: its enclosure E is made from the polynomials, a little wider, and tested.

**Return.** On each step but the last v < 0 or beta_bar < 0 is shown, so that beta_bar < 0 from the start on; on the
last one v > 0, and beta_bar > 0 at its end. By the mean value theorem the return is at t - beta_bar(t) / v for any t.

**Cycles.** Let F = P - (what P is to return to), P the half map and then S. K - m = -Y F(m) + (1 - Y F_u) [-r, r] for
each s; if it lies inside (-r, r) there is exactly one zero u(s) of F within r of m(s), analytic in s, and it lies
within K - m of it. u' = -(F_u)^-1 F_p. docs/certified.md (Theorems 5a and 5b) says why the signs below mean what they
do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from flint import arb, arb_mat, arb_series

from tippedisk_verify.proofs.checker.jets import (
    Dual,
    Jet,
    at,
    polynomial,
    power_of,
    sines,
    small_sines,
    symmetric,
    values,
)
from tippedisk_verify.proofs.checker.steps import Flow, Unproved, coefficients, column, context, inside, need, positive

__all__ = ["Arc", "Curve"]

_ORDER, _ROUGH = 12, 10  # of the states' series, and of those of derivatives: more of either tighten nothing
_DEGREE = 2  # in s, of derivatives at most: more tighten nothing, and 1 is too few
_UPRIGHT = arb(0, 1.5706999)  # rad: |beta_bar| lies in it; rounded up, its radius is still below 1.5707 and pi/2
_FINEST = 9  # halvings of a step in which an orbit turns


class Motion:
    """The equations of (b, g, u) for jets w = Omega and q; q is None where the state is not scaled."""

    def __init__(self, flow: Flow, w: Jet, q: Jet | None) -> None:
        self.flow, self.w, self.q = flow, w, q

    def ranges(self) -> Motion:
        """The same for all s."""
        return Motion(self.flow, Jet([self.w.range()]), None if self.q is None else Jet([self.q.range()]))

    def rate(self, sines_: Sequence[Any], u: Any, w: Any, q: Any) -> Any:
        """u' from sin(a b) / a, cos(a b) and the same of g: the equation of `steps.Flow.acceleration`, divided by a."""
        x, cos_b, y, cos_g = sines_
        f = self.flow
        rho, w2, qx2, cos2 = cos_g * f.e + f.r, w * w, q * (x * x), cos_b * cos_b
        rho2, inertia = rho * rho, q * (y * y) * (f.a - f.b) + f.b
        swing = inertia * w2 + rho2 * (q * (u * u))
        pull = cos_b * (swing + w2 * (qx2 * (rho * cos_g)) * f.e) + rho * -f.g
        cross = cos_g * (2 * (f.a - f.b)) + rho * (cos2 * 3 + -2) * f.e
        slip = rho * u + w * (cos_b * y) * f.e
        force = x * pull + w * (q * u * (x * y) * cross) + rho * cos2 * slip * f.k
        return -force / (inertia + rho2 * qx2)

    def series(self, state: Sequence[Jet], order: int) -> list[Jet]:
        """(b, g, u, sin(a b) / a, cos(a b), sin(a g) / a, cos(a g)) and, scaled, the first and third sines' by q."""
        start, q = list(state), 1 if self.q is None else self.q
        slopes: list[Jet] = []
        for angle in state[:2]:
            values: tuple[Jet, ...] = sines(angle) if self.q is None else small_sines(angle, self.q)
            start += values[:2]
            slopes += values[2:]
        found = [part.map(lambda x: arb_series([x], prec=1)) for part in start]
        for _ in range(order):
            _, _, u, x, cos_b, y, cos_g = found
            turn = self.w * x
            rates = [u, turn, self.rate(found[3:], u, self.w, q),
                     cos_b * u, -(q * x * u), cos_g * turn, -(q * y * turn)]  # fmt: skip
            found = [part + rate.map(arb_series.integral) for part, rate in zip(start, rates, strict=True)]
        for slope, angle, sine, rate in zip(slopes, found[:2], found[3::2], rates[:2], strict=False):
            found.append(slope + (sine * angle * rate * (arb(-1) / 2)).map(arb_series.integral))
        return found

    def derivatives(self, found: Sequence[Jet], start: Sequence[Sequence[Any]], order: int) -> list[list[Jet]]:
        """Columns of the derivatives by b, g, u, w (and q) from those at the ``start``; then div f's integral alone."""
        cut = arb_series([0], prec=order + 1)
        b, g, u, x, cos_b, y, cos_g, *slopes = (part.map(lambda x: x + cut) for part in found)
        scaled, half = self.q is not None, arb(-1) / 2
        q = self.q if scaled else 1

        def dual(value: Any, *by: Any) -> Dual:
            return Dual(value, by if scaled else by[:4])

        sines_ = [
            dual(x, cos_b, None, None, None, slopes[0] if scaled else None),
            dual(cos_b, -(q * x), None, None, None, x * b * half if scaled else None),
            dual(y, None, cos_g, None, None, slopes[1] if scaled else None),
            dual(cos_g, None, -(q * y), None, None, y * g * half if scaled else None),
        ]
        one = 1 + 0 * self.w
        by_q = dual(self.q, None, None, None, None, one) if scaled else 1
        speed = dual(self.w, None, None, None, one, None)
        rate = self.rate(sines_, dual(u, None, None, one, None, None), speed, by_q)
        rows = rate.by
        turn = [self.w * cos_b, x, self.w * slopes[0] if scaled else None]
        columns = []
        for k, entries in enumerate(start):
            initial = [self.w * 0 + entry for entry in entries]
            moved = [part.map(lambda x: arb_series([x], prec=1)) for part in initial]
            for _ in range(order):
                rates = [moved[2], turn[0] * moved[0],
                         rows[0] * moved[0] + rows[1] * moved[1] + rows[2] * moved[2]]  # fmt: skip
                if k > 2:
                    rates[1:] = rates[1] + turn[k - 2], rates[2] + rows[k]
                moved = [part + rate_.map(arb_series.integral) for part, rate_ in zip(initial, rates, strict=True)]
            columns.append(moved)
        return [*columns, [rows[2].map(arb_series.integral)]]


class Curve:
    """p(s) as polynomials of points, its deviations and T(s)."""

    def __init__(self, flow: Flow, scaled: bool, p: Sequence[Jet], away: Sequence[Any], total: Jet) -> None:
        self.scaled, self.p, self.away, self.total = scaled, p, away, total
        w = p[2] + away[2]
        if scaled:
            need(bool(p[0].range() < 1), "the amplitude is not shown to be less than 1")
        self.thin = Motion(flow, p[2], p[0] if scaled else None)
        self.wide = Motion(flow, w, p[0] if scaled else None)
        self.rough = Motion(flow, w.cut(_DEGREE), p[0].cut(_DEGREE) if scaled else None)
        self.all = self.wide.ranges()
        #: where the orbits start on the section, its derivatives by p, and which of p the equations depend on
        self.start = [1 + 0 * p[1] if scaled else p[0], p[1]]
        self.unit = [[0 if scaled else 1, 0, 0], [0, 1, 0]]
        self.own = (2, 0) if scaled else (2,)


class Tube:
    """A set of states; see the file's docstring."""

    def __init__(self, curve: Curve) -> None:
        zero = arb(0)
        self.curve, self.away = curve, column(curve.away)
        degree = len(curve.total.c) - 1
        self.middle = Jet([column([zero, *(part.c[k] for part in curve.start)]) for k in range(degree + 1)])
        self.lead = Jet([arb_mat([[0] * 3, *curve.unit]), *[arb_mat(3, 3)] * degree])
        self.axes, self.rest, self.own = arb_mat(3, 3), column([zero] * 3), column([zero] * 3)
        for k in range(3):
            self.axes[k, k] = 1
        self.spread = arb_mat(3, 3)

    def box(self) -> list[Jet]:
        """Balls that hold all states and the middle."""
        return _entries(self.middle + self.lead * self.away + self.axes * (self.rest * arb(0.5, 0.5)))

    def mapped(self, rows: Jet, own: Jet) -> tuple[Jet, Any]:
        """The lead's image and that of the axes, for derivatives by the state and by p."""
        return rows * self.lead + own, (rows * self.axes).range()

    def carried(self, centre: Jet, lead: Jet, turned: Any, axes: Any) -> Tube:
        """The image's set. Raises Unproved for axes without an inverse."""
        image = object.__new__(Tube)
        image.curve, image.away, image.axes = self.curve, self.away, axes
        image.middle, image.lead = centre.mid(), lead.mid()
        try:
            inverse = axes.inv()
        except ZeroDivisionError:
            raise Unproved("its axes have no inverse") from None
        left, turned = inverse * (lead - image.lead).range(), inverse * turned
        moved = inverse * (centre - image.middle).range()
        image.own = moved + turned * self.own
        image.rest = moved + left * self.away + turned * self.rest
        image.spread = left + turned * self.spread
        return image


def _entries(jet: Jet) -> list[Jet]:
    return [Jet([part[row, 0] for part in jet.c]) for row in range(3)]


class Step:
    """What is shown over [0, length(s)]: the orbits and derivatives as polynomials, and E."""

    def __init__(self, tube: Tube, share: Any) -> None:
        curve = tube.curve
        self.tube, self.length = tube, (curve.total * share).mid()
        longest = self.length.range()
        need(positive(longest), "its length is not positive")
        count = 3 + len(curve.own)
        unit = [[arb(int(row == column)) for row in range(3)] for column in range(count)]
        wide = curve.rough.series([part.cut(_DEGREE) for part in tube.box()], _ROUGH)
        slopes = curve.rough.derivatives(wide, unit, _ROUGH)
        flat = [*wide[:3], *(part for column in slopes for part in column)]
        span = arb(0).union(longest)
        last = power_of(span, _ROUGH)
        ranges, enclosure = [], []
        for part in flat[:-1]:
            whole = polynomial(Jet([part.range()]), _ROUGH + 1)
            reach = at(whole, span).c[0]
            pad = arb(0, (reach.rad() / 256 + arb(2) ** -40).upper())
            ranges.append(reach)
            enclosure.append(reach + pad + symmetric(whole.c[0][-1] * last))
        held, matrix = enclosure[:3], [enclosure[k : k + 3] for k in range(3, len(enclosure), 3)]
        states = curve.all.series([Jet([part]) for part in held], _ORDER + 1)
        rough = curve.all.derivatives(states, matrix, _ROUGH + 1)
        beyond = [*states[:3], *(part for column in rough for part in column)]
        rest = [coefficients(part.c[0], _ROUGH + 2)[-1] for part in beyond]
        for reach, part, room in zip(ranges, rest, enclosure, strict=False):
            shown = inside(reach + part * last * span, room)
            need(shown, "the states and derivatives over it are not shown to stay in its enclosure")
        self.enclosure = held
        thin = curve.thin.series(_entries(tube.middle), _ORDER)
        self.orbit = [
            polynomial(part, _ORDER + 1, coefficients(end.c[0], _ORDER + 2)[-1])
            for part, end in zip(thin[:3], states[:3], strict=True)
        ]
        self.slopes = [polynomial(part, _ROUGH + 1, end) for part, end in zip(flat[3:], rest[3:], strict=True)]

    def mapped(self, time: Jet) -> tuple[list[Jet], Jet, Any]:
        """The middle's image, the lead's and that of the axes."""
        centre, slopes = values(self.orbit, time), values(self.slopes[:-1], time)
        rows = Jet([arb_mat([[slopes[3 * k + row].c[n] for k in range(3)] for row in range(3)])
                    for n in range(len(time.c))])  # fmt: skip
        places, zero = self.tube.curve.own, arb(0)
        own = Jet([arb_mat([[slopes[9 + 3 * places.index(k) + row].c[n] if k in places else zero for k in range(3)]
                            for row in range(3)]) for n in range(len(time.c))])  # fmt: skip
        return centre, *self.tube.mapped(rows, own)

    def image(self, time: Jet, own: bool = False) -> tuple[list[Jet], list[list[Jet]]]:
        """The states after ``time``, or only the curve's own ones; and their derivatives by p."""
        centre, lead, turned = self.mapped(time)
        away = turned * (self.tube.own if own else self.tube.rest)
        if not own:
            away = lead * self.tube.away + away
        by = lead + turned * self.tube.spread
        moved = _entries(away) if isinstance(away, Jet) else away.entries()
        derivatives = [[Jet([part[row, k] for part in by.c]) for k in range(3)] for row in range(3)]
        return [a + b for a, b in zip(centre, moved, strict=True)], derivatives

    def turning(self) -> Iterator[tuple[Any, list[Jet]]]:
        """beta_bar and its derivatives at a fixed time, in each part of the step in which v may vanish."""
        parts = [(0, 0)]
        while parts:
            number, halvings = parts.pop()
            low, high = arb(number) / 2**halvings, arb(number + 1) / 2**halvings
            states, by = self.image(self.length * low.union(high))
            v = states[2].range()
            if positive(v) or positive(-v):
                continue
            if halvings < _FINEST:
                parts += [(2 * number, halvings + 1), (2 * number + 1, halvings + 1)]
            else:
                yield states[0].range(), by[0]

    def after(self, axes: Any) -> Tube:
        centre, lead, turned = self.mapped(self.length)
        vectors = Jet([column([part.c[k] for part in centre]) for k in range(len(lead.c))])
        return self.tube.carried(vectors, lead, turned, axes)


class Flight:
    """From the section to the next crossing of it, for all s and all deviations. Raises Unproved."""

    def __init__(self, curve: Curve, steps: Sequence[dict[str, Any]], path: str) -> None:
        self.turning: list[tuple[Any, list[Jet]]] = []
        time = self.divergence = 0 * curve.total
        tube, number = Tube(curve), 0
        try:
            with context(length=_ORDER + 8):
                need(positive(-tube.box()[2].range()), "v is not shown to be negative at the start")
                need(bool(steps), "there are no steps")
                for number, entry in enumerate(steps, 1):
                    last = number == len(steps)
                    step = Step(tube, entry["share"])
                    beta, _, v = step.enclosure
                    need(inside(beta, _UPRIGHT), "beta is not shown to stay upright")
                    need(
                        positive(v) if last else positive(-v) or positive(-beta), "beta is not shown to move as it must"
                    )
                    need(("axes" in entry) is not last, "it ends where it must not")
                    if not (positive(v) or positive(-v)):
                        self.turning += step.turning()
                    if last:
                        self._land(step, time, curve.total - time)
                    else:
                        self.divergence = self.divergence + values(step.slopes[-1:], step.length)[0]
                        time, tube = time + step.length, step.after(arb_mat(entry["axes"]))
        except Unproved as fault:
            raise Unproved(f"{path}, step {number}: {fault}") from None

    def _land(self, step: Step, before: Jet, guess: Jet) -> None:
        """The return in the last step; ``guess`` is about when it is."""
        tau, curve = guess.mid(), step.tube.curve
        need(positive(step.image(step.length)[0][0].range()), "beta is not shown to have passed the section")
        states, _ = step.image(tau)
        early = tau + symmetric(states[0].range() / step.enclosure[2])
        need(positive(tau.range(), early.range(), (step.length - tau).range(), (step.length - early).range()),
             "the return is not shown to lie within the step")  # fmt: skip
        v = step.image(early)[0][2]
        moment = tau - states[0] / v
        own_moment = tau - step.image(tau, own=True)[0][0] / v
        own, _ = step.image(own_moment, own=True)
        (_, gamma, v), by = step.image(moment)
        self.own_time, self.time = before + own_moment, before + moment
        need(positive(v.range()), "v is not shown to be positive at the return")
        motion, sines_ = curve.wide, _section_sines(gamma, curve.wide.q)
        rate = motion.rate(sines_, v, motion.w, 1 if motion.q is None else motion.q)
        self.time_by = [-(entry / v) for entry in by[0]]
        self.image = [-own[1], -own[2]]
        rows = [-(entry + rate * time) for entry, time in zip(by[2], self.time_by, strict=True)]
        self.by = [[-entry for entry in by[1]], rows]
        self.divergence = self.divergence + values(step.slopes[-1:], moment)[0]


def _section_sines(gamma: Jet, q: Jet | None) -> list[Jet]:
    zero = 0 * gamma
    values: tuple[Jet, ...] = sines(gamma) if q is None else small_sines(gamma, q)
    return [zero, zero + 1, *values[:2]]


class Arc:
    """What is shown of the cycles of an interval of amplitudes: ``within`` K - m, and what moves along the arc."""

    def __init__(self, curve: Curve, steps: Sequence[dict[str, Any]], path: str) -> None:
        self.curve, self.path, self.flight = curve, path, Flight(curve, steps, path)
        flight, radii = self.flight, curve.away[1:]
        value = [after - before for after, before in zip(flight.image, curve.start, strict=True)]
        rows = [
            [entry - own for entry, own in zip(*pair, strict=True)] for pair in zip(flight.by, curve.unit, strict=True)
        ]
        (first, a, b), (second, c, d) = rows
        choice = [[part.mid() for part in row] for row in _inverse(a.mid(), b.mid(), c.mid(), d.mid())]
        self.within = []
        for k, (x, y) in enumerate(choice):
            image = -(x * value[0] + y * value[1]).range()
            for j, (upper, lower) in enumerate(((a, c), (b, d))):
                image = image + (int(j == k) - (x * upper + y * lower)).range() * radii[j]
            need(inside(image, radii[k]), f"{path}: Krawczyk's image is not shown to lie inside the box")
            self.within.append(image)
        self.determinant = a * d - b * c
        self.slopes = [-(x * first + y * second) for x, y in _inverse(a, b, c, d)]

    def signs(self) -> None:
        """Shown: stable; Omega falls, the period and beta_max grow with the amplitude (with q, where it is scaled)."""
        flight, curve, (v_slope, w_slope) = self.flight, self.curve, self.slopes
        (a, b, _), (_, d, _) = flight.by
        trace, q = a + d, curve.p[0]
        if curve.scaled:
            trace = 1 - (curve.p[1] + curve.away[1]) * b + 2 * (q * a) + d
        shrinking = flight.divergence.range().exp()
        need(positive((w_slope * self.determinant).range(), 1 + trace.range() - shrinking),
             f"{self.path}: the cycles are not shown to be stable")  # fmt: skip
        need(positive(-w_slope.range()), f"{self.path}: Omega is not shown to fall")
        by = flight.time_by
        growth = (by[0] + by[1] * v_slope + by[2] * w_slope).range()
        need(positive(growth), f"{self.path}: the period is not shown to grow")
        need(bool(flight.turning), f"{self.path}: the orbits are not shown to turn")
        for beta, row in flight.turning:
            slope = row[0] + row[1] * v_slope + row[2] * w_slope
            rise = 2 * (q * slope) + beta if curve.scaled else slope
            need(positive(-rise.range()), f"{self.path}: beta_max is not shown to grow")


def _inverse(a: Jet, b: Jet, c: Jet, d: Jet) -> list[list[Jet]]:
    determinant = a * d - b * c
    return [[d / determinant, -b / determinant], [-c / determinant, a / determinant]]
