"""Attacks on `kernel.ball_array`: operands meant to break it, and images that its balls must hold.

Each attack takes the module, so that it can be told whether it notices a fault in a copy, and
raises AssertionError. Images under the four operations are exact rationals; those under sine and
cosine come from Arb at 200 bits. The random numbers come from `random.Random`, whose draws are the
same everywhere.
"""

from __future__ import annotations

import math
import random
from fractions import Fraction

import numpy as np

from tippedisk_verify.proofs.kernel.balls import arb, ball, working_precision

SMALLEST = 2.0**-1074
NORMAL = 2.0**-1022
LARGEST = float(np.finfo(float).max)
EDGES = [
    0.0,
    -0.0,
    SMALLEST,
    -SMALLEST,
    NORMAL,
    -NORMAL,
    NORMAL - SMALLEST,
    LARGEST,
    -LARGEST,
    1.0,
    -1.0,
    1 + 2.0**-52,
    1 - 2.0**-53,
    2.0**-537,
    2.0**512,
    3.0,
    0.1,
]
NOT_NUMBERS = [math.inf, -math.inf, math.nan]


def draw(rng: random.Random) -> float:
    """A midpoint: often ordinary, often next to a power of two, sometimes at the edges of
    what doubles hold.
    """
    kind = rng.randrange(10)
    if kind == 0:
        return rng.choice(EDGES)
    sign = rng.choice((-1, 1))
    if kind == 1:
        return sign * math.ldexp(rng.uniform(1, 2), rng.randint(-1074, 1022))
    if kind < 5:  # here a rounding is largest relative to the result
        return sign * math.ldexp(1 + rng.randint(-3, 3) * 2.0**-52, rng.randint(-3, 3))
    return sign * math.ldexp(rng.uniform(1, 2), rng.randint(-12, 12))


def draw_radius(rng: random.Random, mid: float) -> float:
    kind = rng.randrange(8)
    size = abs(mid) if math.isfinite(mid) else 1.0
    if kind < 2:
        return 0.0
    if kind == 2:
        return rng.choice((SMALLEST, NORMAL, 2.0**-1000, 1.0, 2.0**-53, LARGEST))
    if kind == 3:
        return min(size * 2.0 ** rng.uniform(-60, -40), LARGEST)
    if kind < 6:
        return min(size * rng.uniform(0, 1.2), LARGEST)
    return min(size * 2.0 ** rng.uniform(-20, 3), LARGEST)


def boxes(rng: random.Random, count: int) -> list[tuple[float, float]]:
    found = []
    for _ in range(count):
        mid = draw(rng)
        radius = draw_radius(rng, mid)
        # Without a midpoint nothing but the radius is left, and its own rounding shows.
        found.append((0.0, abs(mid)) if rng.random() < 0.1 else (mid, radius))
    return found


def points(rng: random.Random, box: tuple[float, float]) -> list[Fraction]:
    """Both ends, the middle, and a point between."""
    mid, rad = map(Fraction, box)
    return [mid - rad, mid + rad, mid, mid + rad * Fraction(rng.randint(-1000, 1000), 1000)]


def balls_of(module, pairs):
    return module.BallArray([mid for mid, _ in pairs], [rad for _, rad in pairs])


def assert_sound(found) -> None:
    """Radii are numbers, none negative; what is subnormal belongs to a radius that holds zero
    as well.
    """
    radii, middles = found.radii, found.midpoints
    assert not np.isnan(radii).any()
    assert (radii >= 0).all()
    assert not ((radii > 0) & (radii < NORMAL)).any()
    finite = radii < np.inf
    assert np.isfinite(middles[finite]).all()
    thin = finite & (radii == 0)
    assert not ((middles[thin] != 0) & (np.abs(middles[thin]) < NORMAL)).any()


def assert_holds(found, place: int, image: Fraction, told: object) -> None:
    radius = float(found.radii[place])
    if radius < math.inf:
        assert abs(image - Fraction(float(found.midpoints[place]))) <= Fraction(radius), told


BINARY = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
}
UNARY = {
    "negate": (lambda a: -a, lambda a: -a),
    "square": (lambda a: a.square(), lambda a: a * a),
    "scale by -7": (lambda a: a * -7, lambda a: -7 * a),
    "scale by a large integer": (lambda a: a * (2**53 + 3), lambda a: a * (2**53 + 3)),
    "scale by a float": (lambda a: 0.1 * a, lambda a: Fraction(0.1) * a),
    "scale by a subnormal": (lambda a: SMALLEST * a, lambda a: Fraction(SMALLEST) * a),
    "scale by a fraction": (lambda a: Fraction(1, 3) * a, lambda a: a / 3),
    "scale by zero": (lambda a: 0 * a, lambda a: 0 * a),
    "divide by -3": (lambda a: a / -3, lambda a: a / -3),
    "subtract from 1": (lambda a: 1 - a, lambda a: 1 - a),
    "add a third": (lambda a: a + Fraction(1, 3), lambda a: a + Fraction(1, 3)),
    "add zero": (lambda a: 0 + a - 0, lambda a: a),
    "middle": (lambda a: a.mid(), None),
}


def binary(module, count: int, seed: int = 1, names=tuple(BINARY)) -> None:
    """The four operations against exact rationals, with corners; two in five of the balls
    must be finite.
    """
    for name in names:
        rng = random.Random(seed)
        operation = BINARY[name]
        first, second = boxes(rng, count), boxes(rng, count)
        # Summands of like size, or a summand below the other's last bit
        if name in ("add", "subtract"):
            for i in range(0, count, 3):
                scale = 2.0 ** rng.choice((-54, -53, -52, -1, 0))
                second[i] = (rng.uniform(-1, 1) * scale, first[i][1] * rng.choice((0, 0, 1)))
                first[i] = (rng.choice((-1.0, 1.0, 1 + 2.0**-52)), second[i][1])
        if name == "divide":
            for i in range(0, count, 4):  # next to a divisor that holds zero, or just one
                mid = math.ldexp(rng.uniform(1, 2), rng.randint(-1000, 1000)) * rng.choice((-1, 1))
                second[i] = (
                    mid,
                    abs(mid) * (1 - rng.choice((0, 2.0**-53, 2.0**-52, 2.0**-30, -(2.0**-52)))),
                )
        found = operation(balls_of(module, first), balls_of(module, second))
        assert_sound(found)
        assert found.is_finite().sum() >= 0.4 * count
        for i in range(count):
            a, b = points(rng, first[i]), points(rng, second[i])
            if name == "divide" and abs(Fraction(second[i][0])) <= Fraction(second[i][1]):
                assert not found.is_finite()[i], (first[i], second[i])
                continue
            corners = [(x, y) for x in a[:2] for y in b[:2]] + [
                (a[2], b[2]),
                (a[3], b[3]),
                (a[3], b[0]),
            ]
            for x, y in corners:
                assert_holds(found, i, operation(x, y), (name, first[i], second[i], x, y))


def unary(module, count: int, seed: int = 3, names=tuple(UNARY)) -> None:
    for name in names:
        rng = random.Random(seed)
        given = boxes(rng, count)
        operation, exact = UNARY[name]
        found = operation(balls_of(module, given))
        assert_sound(found)
        assert found.is_finite().sum() >= 0.6 * count
        for i in range(count):
            if exact is None:
                assert_holds(
                    found,
                    i,
                    Fraction(float(balls_of(module, given[i : i + 1]).midpoints[0])),
                    given[i],
                )
                continue
            for x in points(rng, given[i]):
                assert_holds(found, i, exact(x), (name, given[i], x))


def strange_operands(module, count: int = 0, seed: int = 4) -> None:
    """Infinities and NaN, as midpoints and radii: every result is an infinite ball, and no
    predicate is true.
    """
    strange = (
        [(x, 0.0) for x in NOT_NUMBERS]
        + [(1.0, x) for x in NOT_NUMBERS]
        + [(math.nan, math.inf), (1.0, -1e-9)]
    )
    strange.append((0.0, math.inf))
    plain = [
        (0.0, 0.0),
        (1.0, 0.0),
        (-1.0, 0.5),
        (1e300, 0.0),
        (SMALLEST, SMALLEST),
        (0.0, LARGEST),
    ]
    left = balls_of(module, [s for s in strange for _ in plain])
    right = balls_of(module, [p for _ in strange for p in plain])
    assert_sound(left)
    results = [
        left,
        -left,
        left.square(),
        0 * left,
        left / 3,
        left.mid(),
        left.rad(),
        left.sin(),
        left.cos(),
    ]
    for a, b in ((left, right), (right, left), (left, left)):
        results += [a + b, a - b, a * b, a / b, a.union(b)]
        one, other = a.series(), b.series()
        for ordinary in (1.0, 2.0):
            one.append(module.BallArray(np.full(len(a), ordinary)))
            other.append(module.BallArray(np.full(len(a), ordinary)))
        one.append(a)
        other.append(b)
        results.append(one.convolution(other))
        assert not a.inside(b).any()
    for result in results:
        assert_sound(result)
        assert not result.is_finite().any()
        assert not result.positive().any()
        assert not result.negative().any()
    over = balls_of(module, [(LARGEST, 0.0), (-LARGEST, LARGEST)])
    for result in (
        over + over,
        over * over,
        2 * over,
        over / 2.0**-300,
        over.square(),
        over / NORMAL,
    ):
        assert_sound(result)
        assert not result.is_finite().any()


def term(rng: random.Random, kind: int, side: int, place: int) -> tuple[float, float]:
    """A term of one of a convolution's two factors, of six kinds."""
    mid = rng.uniform(0.5, 1) * rng.choice((1, 1 + 2.0**-20))
    rad = rng.uniform(0, 1) * 1e-3
    if kind == 0:
        mid = draw(rng)
        return mid, draw_radius(rng, mid)
    if kind == 1:
        return mid, 0.0
    if kind == 3 and side:
        return 0.0, rad
    if kind == 4:
        # The sum is small and its terms are not: what is lost is seen against a small result.
        return (-1) ** (place * side) * rng.uniform(0.9, 1), 0.0
    if kind == 5:
        # What a term's rounding loses in an underflow is multiplied by the other factor
        return rng.choice((-1, 1)) * mid * 2.0 ** (-975 if side else 30 - 0.7 * place), 0.0
    return mid, rad


def convolutions(module, count: int, seed: int = 5, lengths=(1, 2, 3, 5, 9, 17, 26)) -> None:
    """Against exact rationals: at their upper ends, where nothing cancels; at random ends;
    thin, cancelling; small.
    """
    for length in lengths:
        rng = random.Random(seed + length)
        width = max(2, count // len(lengths))
        columns = [
            [[term(rng, kind, side, place) for place in range(length)] for side in range(2)]
            for kind in (rng.randrange(6) for _ in range(width))
        ]
        series = []
        for side in range(2):
            made = module.BallArraySeries(width)
            for i in range(length):
                made.append(balls_of(module, [column[side][i] for column in columns]))
            series.append(made)
        found = series[0].convolution(series[1])
        square = series[0].convolution(series[0])
        assert_sound(found)
        assert found.is_finite().sum() >= 0.5 * width
        for place, (first, second) in enumerate(columns):
            for ends in ((1,), (0,), (-1, 1)):
                a, b = (
                    [Fraction(m) + rng.choice(ends) * Fraction(r) for m, r in terms]
                    for terms in (first, second)
                )
                for result, other in ((found, b), (square, a)):
                    image = sum(x * y for x, y in zip(a, reversed(other), strict=True))
                    assert_holds(result, place, image, (length, first, second))


def angle_boxes(rng: random.Random, count: int) -> list[tuple[float, float]]:
    found = []
    for _ in range(count):
        kind = rng.randrange(11)
        quarter = rng.randint(-8, 8) if kind % 2 else rng.randint(-160_000, 160_000)
        if kind < 3:
            mid = rng.uniform(-0.79, 0.79)
        elif kind < 5:
            mid = quarter * math.pi / 2 + rng.uniform(-1e-6, 1e-6)
        elif kind < 7:
            mid = quarter * math.pi / 2 + rng.uniform(-0.8, 0.8)
        elif kind == 7:
            mid = draw(rng)
        elif kind == 8:
            mid = math.ldexp(rng.uniform(1, 2), rng.randint(16, 45)) * rng.choice((-1, 1))
        else:  # here the roundings are largest against the result
            mid = rng.choice((0, quarter)) * math.pi / 2 + rng.uniform(0.5, 0.52) * rng.choice(
                (-1, 1)
            )
        choice = rng.randrange(4) if kind < 9 else 0
        rad = (0.0, rng.uniform(0, 4), 2.0 ** rng.uniform(-60, 0), draw_radius(rng, mid))[choice]
        found.append((mid, rad))
    return found


def exact_ball(box: tuple[float, float], share: float):
    return arb(box[0]) + arb(box[1]) * arb(share)


def sines(module, count: int, seed: int = 6) -> None:
    """Sine and cosine of both ends, the middle and a point between, from Arb at 200 bits."""
    rng = random.Random(seed)
    given = angle_boxes(rng, count)
    balls = balls_of(module, given)
    found = balls.sin(), balls.cos()
    for result in found:
        assert_sound(result)
    with working_precision(200):
        for i, box in enumerate(given):
            beyond = abs(box[0]) > 2.0**18
            for result in found:
                assert not (beyond and result.is_finite()[i]), box
                assert beyond or result.is_finite()[i] or box[1] > 1e300, box
            if beyond:
                continue
            for share in (-1.0, 1.0, 0.0, rng.uniform(-1, 1)):
                point = exact_ball(box, share)
                for result, image in zip(found, (point.sin(), point.cos()), strict=True):
                    _assert_near(result, i, image, box)


def _assert_near(found, place: int, image, told: object) -> None:
    radius = float(found.radii[place])
    if radius < math.inf:
        distance = abs(image - arb(float(found.midpoints[place])))
        # The attack itself knows the image
        assert distance.rad() < 1e-40 + abs(image.mid()) * 1e-40, told
        assert not distance > arb(radius), told


def predicates(module, count: int, seed: int = 7) -> None:
    """Each true answer is right, and clear cases are answered."""
    rng = random.Random(seed)
    first, second = boxes(rng, count), boxes(rng, count)
    for i in range(0, count, 4):  # nested, touching, and next to touching
        mid, rad = second[i]
        if math.isfinite(rad) and abs(mid) < 1e100 and rad < 1e100:
            inner = rad * rng.choice((0.0, 0.5, 1.0, 1 - 2.0**-50))
            first[i] = (mid + (rad - inner) * rng.choice((-1, 0, 1)), inner)
    a, b = balls_of(module, first), balls_of(module, second)
    inside, positive, negative, union = a.inside(b), a.positive(), a.negative(), a.union(b)
    assert_sound(union)
    seen = 0
    for i in range(count):
        (m, r), (n, s) = (tuple(map(Fraction, box)) for box in (first[i], second[i]))
        truth = abs(m - n) + r < s
        assert not inside[i] or truth, (first[i], second[i])
        clear = abs(m - n) + r < s * Fraction(999, 1000) and Fraction(1, 10**200) < s < 10**300
        assert inside[i] or not clear, (first[i], second[i])
        seen += clear
        normal = abs(first[i][0]) >= NORMAL and (first[i][1] == 0 or first[i][1] >= NORMAL)
        assert not positive[i] or m - r > 0, first[i]
        assert not negative[i] or m + r < 0, first[i]
        if normal:
            assert positive[i] == (m - r > 0), first[i]
            assert negative[i] == (m + r < 0), first[i]
        for point in (*points(rng, first[i]), *points(rng, second[i])):
            assert_holds(union, i, point, (first[i], second[i]))
    assert seen > count // 20


def conversions(module, count: int, seed: int = 8) -> None:
    """Rationals, integers, floats and Arb's balls in; Arb's balls out."""
    rng = random.Random(seed)
    numbers = [
        Fraction(rng.randint(-(10**30), 10**30), rng.randint(1, 10**25)) for _ in range(count)
    ]
    numbers += [
        Fraction(1, 3 * 2**1060),
        Fraction(1, 2**1200),
        Fraction(2**1023),
        2**53 + 1,
        10**40,
    ]
    numbers += [Fraction(mid) for mid, _ in boxes(rng, count)]
    found = module.BallArray.of(numbers)
    assert_sound(found)
    for i, number in enumerate(numbers):
        assert_holds(found, i, Fraction(number), number)
        assert found.radii[i] <= abs(number) * Fraction(2) ** -52 + Fraction(NORMAL) * 9, number
    beyond = module.BallArray.of(
        [2**1024, Fraction(-(10**400)), math.nan, math.inf, arb("nan"), arb(2) ** 5000]
    )
    assert_sound(beyond)
    assert not beyond.is_finite().any()
    with working_precision(100):
        balls = [ball(number) + arb(0, 2.0 ** rng.randint(-120, 3)) for number in numbers[:count]]
        balls += [
            arb(2) ** -10_000_000,
            arb(1, arb(2) ** -9_000_000),
            arb(0, arb(2) ** -1030),
            arb(2) ** -1022 / 3,
        ]
        found = module.BallArray.of(balls)
        assert_sound(found)
        assert found.is_finite().all()
    with working_precision(400):  # enough for the ends to be exact, or as good as
        for i, given in enumerate(balls):
            radius = arb(float(found.radii[i]))
            for end in (given.mid() - given.rad(), given.mid() + given.rad()):
                assert not abs(end - arb(float(found.midpoints[i]))) > radius, given


ATTACKS = {
    attack.__name__: attack
    for attack in (binary, unary, strange_operands, convolutions, sines, predicates, conversions)
}
