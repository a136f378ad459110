"""Models with one mistake each: what people get wrong when they write the tippedisk down.

A mistake in the equations is a `Spelling`: the paper's terms written out once more, each with a switch. A mistake in
what goes in or comes out changes the inputs or the answers. Each alternative predicts numbers; that is all a diagnosis
may rest on. A test holds the spelling without mistakes against `model.equations`.
"""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from typing import Any

from tippedisk_verify.model.parameters import SYMBOLS, Parameters

__all__ = ["ALTERNATIVES", "CORRECT", "Alternative", "Spelling", "spelled"]


@dataclass(frozen=True)
class Spelling:
    """The equations of motion with switches; the defaults are right."""

    mass: tuple[int, int, int] = (1, 1, 1)  #: signs of M's terms
    h: tuple[int, int, int, int, int] = (1, 1, 1, 1, 1)  #: signs of h's terms, as printed
    gravity: int = 1  #: sign of f_G
    traction: int = 1  #: sign of lambda_Ty
    slip: tuple[int, int] = (1, 1)  #: signs of gamma_y's terms
    kinematic: int = -1  #: gamma' = this * Omega cos(beta)
    eccentricity: float = 1  #: factor of e in r + e sin(gamma)
    rho_sine: bool = True  #: r + e sin(gamma), not r + e cos(gamma)
    h4_power: int = 3  #: of cos(beta) in h's fourth term
    h5_constant: int = 2  #: in 3 sin^2(beta) - 2
    slip_sine: str = "squared"  #: in gamma_y's second part: squared, plain, or of-square (sin(beta^2))
    lever_sine: bool = True  #: w_y = rho sin(beta), not rho
    mass_squared: bool = True  #: cos^2 and sin^2 in M, not cos and sin
    mass_exchanged: bool = False  #: sin^2 and cos^2 exchanged in M
    inertia_alike: bool = False  #: the last two in h's first term as well
    held: str = ""  #: what is taken for a constant where derivatives are formed
    twice: bool = True  #: the factor 2 of h's second term
    weighted: bool = True  #: the friction force has the factor m g
    per_epsilon: bool = True  #: the friction force is divided by epsilon (linear) or smoothed by it
    smoothed: str = "abs"  #: how the smooth law is smoothed: a key of `_SMOOTHED`
    #: (a term, its extra factor and powers), and so on; a term's name with " +" says what is added to it
    extra: tuple[tuple[str, float, tuple[tuple[str, int], ...]], ...] = ()


CORRECT = Spelling()
#: Friction force per weight, from (ops, slip, its size, epsilon).
_SMOOTHED: dict[str, Callable[[Any, Any, Any, Any], Any]] = {
    "abs": lambda ops, slip, size, epsilon: slip / (size + epsilon),
    "slip": lambda ops, slip, size, epsilon: slip / (slip + epsilon),
    "sqrt": lambda ops, slip, size, epsilon: slip / ops.sqrt(slip * slip + epsilon * epsilon),
    "tanh": lambda ops, slip, size, epsilon: ops.tanh(slip / epsilon),
    "arctan": lambda ops, slip, size, epsilon: 2 / math.pi * ops.atan(slip / epsilon),
    "sign": lambda ops, slip, size, epsilon: slip / size,
    "bracket": lambda ops, slip, size, epsilon: slip / size + epsilon,
    "frozen": lambda ops, slip, size, epsilon: slip / (size + epsilon),  # with the size's sign as at the start
}


def spelled(
    spelling: Spelling, ops: Any, p: Any, omega: Any, state: Any, friction: str, side: Any = None
) -> dict[str, Any]:
    """M, h, f_G, w_y, gamma_y, gamma_rate, lambda_Ty and v_rate in this spelling, and the terms that make them up.

    ``p`` has r, e, m, A, Bbar, g, mu and epsilon; ``side`` is the sign of gamma_y where complex numbers hide it.
    """

    beta, gamma, v = state
    sb, cb, sg, cg = ops.sin(beta), ops.cos(beta), ops.sin(gamma), ops.cos(gamma)
    rho = p.r + spelling.eccentricity * p.e * (sg if spelling.rho_sine else cg)
    factors = {
        "rho": rho, "sin beta": sb, "cos beta": cb, "sin gamma": sg, "cos gamma": cg, "Omega": omega, "v": v, "M": 1.0,
    }  # fmt: skip
    parts: dict[str, Any] = {}

    def term(name: str, value: Any) -> Any:
        for which, number, powers in spelling.extra:
            if which.removesuffix(" +") == name:
                number = math.prod((factors[factor] ** power for factor, power in powers), start=number)
                value = value + number if which.endswith("+") else value * number
        parts[name] = value.real if spelling.held == name else value
        return parts[name]

    rho = term("rho", rho)
    cos_part, sin_part = (cg * cg, sg * sg) if spelling.mass_squared else (cg, sg)
    if spelling.mass_exchanged:
        cos_part, sin_part = sin_part, cos_part
    m1, m2, m3 = spelling.mass
    turning = term("M 1", m1 * p.A * cos_part) + term("M 2", m2 * p.Bbar * sin_part)
    factors["M"] = mass = term("M", turning + term("M 3", m3 * p.m * rho * rho * cb * cb))
    if not spelling.inertia_alike:
        cos_part, sin_part = cg * cg, sg * sg
    coupling = p.m * p.e * rho
    h1, h2, h3, h4, h5 = spelling.h
    first = h1 * omega * omega * sb * cb
    gyroscopic = (
        term("h 1", term("h 1, A", p.A * cos_part * first) + term("h 1, Bbar", p.Bbar * sin_part * first))
        + term("h 2", -h2 * (2 if spelling.twice else 1) * (p.A - p.Bbar) * omega * v * cb * sg * cg)
        + term("h 3", h3 * p.m * rho * rho * v * v * sb * cb)
        + term("h 4", h4 * coupling * omega * omega * sb * cb**spelling.h4_power * sg)
    )
    last = h5 * coupling * omega * v * cb * cg
    gyroscopic += term("h 5", term("h 5, 3", -3 * sb * sb * last) + term("h 5, 2", spelling.h5_constant * last))
    gyroscopic = term("h", gyroscopic)
    gravity = term("f_G", -spelling.gravity * p.m * p.g * rho * cb)
    direction = term("w_y", rho * sb if spelling.lever_sine else rho)
    sine = {"squared": sb * sb, "plain": sb, "of-square": ops.sin(beta * beta)}[spelling.slip_sine]
    slip = term("gamma_y 1", spelling.slip[0] * rho * v * sb)
    slip = term("gamma_y", slip + term("gamma_y 2", -spelling.slip[1] * p.e * omega * sine * cg))
    weight = p.mu * (p.m * p.g if spelling.weighted else 1)
    epsilon = p.epsilon if spelling.per_epsilon else 1
    if friction == "linear":
        force = slip / epsilon
    else:
        size = term("abs(gamma_y)", side * slip if side is not None else abs(slip))
        force = _SMOOTHED[spelling.smoothed](ops, slip, size, epsilon)
    force = term("lambda_Ty", -spelling.traction * weight * force)
    rate = term("v_rate h", gyroscopic / mass) + term("v_rate f_G", gravity / mass)
    rate += term("v_rate friction", direction * force / mass)
    return parts | {
        "M": mass,
        "h": gyroscopic,
        "f_G": gravity,
        "w_y": direction,
        "gamma_y": slip,
        "gamma_rate": term("gamma_rate", spelling.kinematic * omega * cb),
        "lambda_Ty": force,
        "v_rate": term("v_rate", rate),
    }


Inputs = dict[str, Any]


@dataclass(frozen=True)
class Alternative:
    """One mistake: its name, what to look for, and how it changes the model, the inputs or the outputs."""

    name: str
    cause: str
    spelling: Spelling = CORRECT
    parameters: Callable[[Parameters], dict[str, Any]] | None = None  #: values to use instead, Bbar among them
    inputs: Callable[[Inputs], Inputs] | None = None
    output: Callable[[str, float], float] | None = None  #: (quantity, right value) -> the answer given
    pi: float = math.pi  #: of sections and equilibria
    friction: str | None = None  #: the law of the orbit
    drift: tuple[str, Callable[[float], float]] | None = None  #: of an orbit: the speed or a parameter, its factor at t
    counterpart: dict[str, str] = field(default_factory=dict)  #: answers that belong to another set, law or form

    @property
    def of_the_model(self) -> bool:
        """Whether it changes the equations or their inputs, and so everything that follows from them."""
        changed = self.spelling != CORRECT or self.pi != math.pi
        return changed or self.parameters is not None or self.inputs is not None

    @property
    def of_orbits(self) -> bool:
        """Whether it may be in orbits alone, where the right-hand side is right."""
        other = self.friction is not None or self.pi != math.pi
        return other or self.inputs is not None or self.spelling.smoothed == "frozen"


def _angles(change: Callable[[float], float]) -> Callable[[Inputs], Inputs]:
    return lambda inputs: {
        name: change(value) if name in ("beta", "gamma") else value for name, value in inputs.items()
    }


def _decimals(places: int, names: tuple[str, ...]) -> Callable[[Inputs], Inputs]:
    return lambda inputs: {
        name: round(value, places) if name in names and isinstance(value, float) else value
        for name, value in inputs.items()
    }


def _one_changed(name: str, factor: float, by: float, inputs: Inputs) -> Inputs:
    return {key: factor * value + by if key == name else value for key, value in inputs.items()}


def _single(value: Any) -> float:
    return float(struct.unpack("f", struct.pack("f", float(value)))[0])


def _singly(names: Sequence[str], inputs: Inputs) -> Inputs:
    return {name: _single(x) if name in names and isinstance(x, float) else x for name, x in inputs.items()}


def _all_single(p: Parameters) -> dict[str, Any]:
    return {name: _single(getattr(p, name)) for name in SYMBOLS}


def _rounded(digits: int) -> Callable[[Parameters], dict[str, Any]]:
    def values(p: Parameters) -> dict[str, Any]:
        return {name: Fraction(f"{float(getattr(p, name)):.{digits - 1}e}") for name in SYMBOLS}

    return values


def _given(name: str, value: Any) -> Callable[[Parameters], dict[str, Any]]:
    return lambda p: {name: value}


def _exchanged(one: str, two: str) -> Callable[[Parameters], dict[str, Any]]:
    return lambda p: {one: getattr(p, two), two: getattr(p, one)}


def _sign_of_h(term: int, sign: int = -1) -> Spelling:
    signs: Any = tuple(sign if n == term else 1 for n in range(1, 6))
    return replace(CORRECT, h=signs)


_H_TERMS = (
    "(A cos^2 gamma + Bbar sin^2 gamma) Omega^2 sin beta cos beta",
    "2 (A - Bbar) Omega v cos beta sin gamma cos gamma",
    "m rho^2 v^2 sin beta cos beta",
    "m e rho Omega^2 sin beta cos^3 beta sin gamma",
    "m e rho (3 sin^2 beta - 2) Omega v cos beta cos gamma",
)
_SHIFTED_ANSWERS = ("gamma_bar_0", "beta_bar_0", "beta_bar_top")
_ANGLE_ANSWERS = ("beta", "gamma", "crossing_gamma", *_SHIFTED_ANSWERS, "beta_max", "amplitude")
_SPEED_ANSWERS = ("v", "crossing_v", "v_0", "v_top", "gamma_rate", "omega_h", "omega_crit", "omega", "frequency")


def _scaled(names: tuple[str, ...], factor: float) -> Callable[[str, float], float]:
    return lambda quantity, value: value * factor if quantity in names else value


def _named_first(name: str) -> Callable[[str, float], float]:
    return lambda quantity, value: -value if quantity == name else value


#: Everything that a diagnosis can name.
ALTERNATIVES: tuple[Alternative, ...] = (
    *(
        Alternative(f"h-{n}-sign", f"the sign of h's term {n}, {text}", _sign_of_h(n))
        for n, text in enumerate(_H_TERMS, start=1)
    ),
    *(
        Alternative(f"h-{n}-missing", f"h's term {n}, {text}, is missing", _sign_of_h(n, 0))
        for n, text in enumerate(_H_TERMS, start=1)
    ),
    Alternative("h-2-factor", "the factor 2 of h's second term is missing", replace(CORRECT, twice=False)),
    Alternative("h-4-power", "cos beta instead of cos^3 beta in h's fourth term", replace(CORRECT, h4_power=1)),
    Alternative("h-4-square", "cos^2 beta instead of cos^3 beta in h's fourth term", replace(CORRECT, h4_power=2)),
    Alternative("h-5-constant", "3 sin^2 beta - 1 instead of - 2 in h's last term", replace(CORRECT, h5_constant=1)),
    Alternative("gamma-y-square", "gamma_y with sin beta instead of its square in the second part",
                replace(CORRECT, slip_sine="plain")),
    Alternative("gamma-y-argument", "gamma_y with sin(beta^2), as a reader may take the paper's sin beta^2",
                replace(CORRECT, slip_sine="of-square")),
    Alternative("gamma-y-sign", "the sign of e Omega sin^2 beta cos gamma in gamma_y", replace(CORRECT, slip=(1, -1))),
    Alternative("w-y-sine", "w_y without its sin beta", replace(CORRECT, lever_sine=False)),
    Alternative("rho-sign", "r - e sin gamma instead of r + e sin gamma", replace(CORRECT, eccentricity=-1)),
    Alternative("rho-cosine", "rho = r + e cos gamma instead of r + e sin gamma", replace(CORRECT, rho_sine=False)),
    Alternative("mass-3-sign", "the sign of m rho^2 cos^2 beta in M", replace(CORRECT, mass=(1, 1, -1))),
    *(
        Alternative(f"mass-{name}", f"{text} in M{where}",
                    replace(CORRECT, mass_squared=name != "squares", mass_exchanged=name == "exchanged",
                            inertia_alike=alike))
        for name, text in (("squares", "cos gamma and sin gamma instead of their squares"),
                           ("exchanged", "sin^2 gamma and cos^2 gamma exchanged"))
        for alike, where in ((False, ""), (True, " and h's first term"))
    ),
    *(
        Alternative(f"derivative-of-{name}", f"the derivatives lack the derivative of {name}",
                    replace(CORRECT, held=name))
        for name in ("M", "rho", "w_y", "lambda_Ty", "abs(gamma_y)", "gamma_y", "f_G", "h")
    ),
    Alternative("gravity-sign", "the sign of f_G", replace(CORRECT, gravity=-1)),
    Alternative("friction-sign", "the sign of the friction force", replace(CORRECT, traction=-1)),
    Alternative("friction-weight", "the friction force without m g", replace(CORRECT, weighted=False)),
    *(
        Alternative(f"smooth-{name}", f"the smooth law with {text} instead of gamma_y/(abs(gamma_y) + epsilon)",
                    replace(CORRECT, smoothed=name))
        for name, text in (("sqrt", "gamma_y/sqrt(gamma_y^2 + epsilon^2)"), ("tanh", "tanh(gamma_y/epsilon)"),
                           ("arctan", "(2/pi) arctan(gamma_y/epsilon)"),
                           ("bracket", "gamma_y/abs(gamma_y) + epsilon"))
    ),
    Alternative("smooth-no-abs", "the smooth law without the abs of gamma_y", replace(CORRECT, smoothed="slip")),
    Alternative("smooth-sign", "the smooth law without its epsilon: the sign of gamma_y",
                replace(CORRECT, smoothed="sign")),
    Alternative("friction-epsilon", "the friction force without epsilon", replace(CORRECT, per_epsilon=False)),
    Alternative("gamma-rate-sign", "gamma' = + Omega cos beta", replace(CORRECT, kinematic=1)),
    Alternative("B-for-Bbar", "B in place of Bbar = B - m e^2", parameters=lambda p: {"Bbar": p.B}),
    Alternative("Bbar-sign", "Bbar = B + m e^2", parameters=lambda p: {"Bbar": p.B + p.m * p.e**2}),
    *(
        Alternative(f"{one}-{two}-exchanged", f"{one} and {two} exchanged", parameters=_exchanged(one, two))
        for one, two in itertools.combinations(SYMBOLS, 2)
    ),
    *(
        Alternative(f"pi-{text}", f"pi = {text}", pi=value)
        for text, value in (*((f"{math.pi:.{n}g}", round(math.pi, n - 1)) for n in range(3, 9)), ("22/7", 22 / 7))
    ),
    Alternative("A-at-centre-of-gravity", "m e^2 taken from A instead of from B",
                parameters=lambda p: {"A": p.A - p.m * p.e**2, "Bbar": p.B}),
    Alternative("parameters-single", "parameters rounded to single precision", parameters=_all_single),
    *(
        Alternative(f"parameters-{n}-digits", f"parameters rounded to {n} significant digits", parameters=_rounded(n))
        for n in (2, 3, 4, 5, 6, 7, 8, 9, 10)
    ),
    *(
        Alternative(f"g-{value}", f"g = {value} instead of 9.81", parameters=_given("g", Fraction(value)))
        for value in ("9.8", "9.80665", "9.807", "9.82", "10")
    ),
    Alternative("e-sign", "the sign of e", parameters=lambda p: {"e": -p.e}),
    Alternative("degrees", "angles taken as degrees", inputs=_angles(math.radians)),
    Alternative("degrees-for-radians", "angles converted to degrees before use", inputs=_angles(math.degrees)),
    Alternative("shifted-angles", "angles taken as the shifted ones, beta_bar and gamma_bar",
                inputs=_angles(lambda angle: angle + math.pi / 2)),
    Alternative("unshifted-angles", "pi/2 subtracted from the angles",
                inputs=_angles(lambda angle: angle - math.pi / 2)),
    Alternative("beta-gamma-exchanged", "beta and gamma exchanged",
                inputs=lambda inputs: {**inputs, **({"beta": inputs["gamma"], "gamma": inputs["beta"]}
                                                    if "beta" in inputs else {})}),
    *(
        Alternative(f"{label}-single", f"{text} rounded to single precision", inputs=partial(_singly, names))
        for label, text, names in (
            ("state", "the state", ("beta", "gamma", "v")),
            ("given", "state and Omega", ("Omega", "beta", "gamma", "v")),
        )
    ),
    Alternative("inputs-single", "parameters and inputs rounded to single precision", parameters=_all_single,
                inputs=lambda inputs: {name: _single(value) if isinstance(value, float) else value
                                       for name, value in inputs.items()}),
    *(
        Alternative(f"{label}-{n}-decimals", f"{text} rounded to {n} decimals at the start", inputs=_decimals(n, names))
        for label, text, names in (
            ("omega", "Omega", ("Omega",)), ("v", "v", ("v",)), ("angles", "beta and gamma", ("beta", "gamma")),
            ("state", "state", ("beta", "gamma", "v")), ("inputs", "state and Omega", ("Omega", "beta", "gamma", "v")),
        )
        for n in range(1 + (label == "angles"), 9)
    ),
    *(
        Alternative(f"{name}-moved-{text}", f"{text} {name} taken for {name}",
                    inputs=partial(_one_changed, name, factor, by))
        for name in ("beta", "gamma")
        for text, factor, by in (("pi/2 +", 1, math.pi / 2), ("-pi/2 +", 1, -math.pi / 2), ("pi +", 1, math.pi),
                                 ("pi -", -1, math.pi), ("pi/2 -", -1, math.pi / 2), ("-", -1, 0.0))
    ),
    *(
        Alternative(f"v-times-{factor}", text, inputs=partial(_one_changed, "v", factor, 0.0))
        for text, factor in (("v = 0 taken for v", 0), ("the sign of v", -1))
    ),
    Alternative("v-omega-exchanged", "v and Omega exchanged", inputs=lambda inputs: {
        **inputs, **({"v": inputs["Omega"], "Omega": inputs["v"]} if "v" in inputs else {})}),
    Alternative("omega-sign", "the sign of Omega", inputs=lambda inputs: {
        name: -value if name == "Omega" else value for name, value in inputs.items()}),
    Alternative("omega-turns", "Omega taken as turns per second", inputs=lambda inputs: {
        name: value * 2 * math.pi if name == "Omega" else value for name, value in inputs.items()}),
    Alternative("answers-in-degrees", "angles answered in degrees", output=_scaled(_ANGLE_ANSWERS, 180 / math.pi)),
    Alternative("answers-shifted", "beta_bar and gamma_bar answered where beta and gamma are asked",
                output=lambda q, value: value - math.pi / 2 if q in ("beta", "gamma", "crossing_gamma") else value),
    Alternative("answers-unshifted", "gamma or beta answered where gamma_bar or beta_bar is asked",
                output=lambda q, value: value + math.pi / 2 if q in _SHIFTED_ANSWERS else value),
    Alternative("answers-in-hertz", "speeds answered in turns per second",
                output=_scaled(_SPEED_ANSWERS, 1 / (2 * math.pi))),
    Alternative("answers-in-milliseconds", "times answered in milliseconds",
                output=_scaled(("period", "crossing_time", "flat_time"), 1000.0)),
    Alternative("half-period", "half the period", output=_scaled(("period", "dperiod_domega"), 0.5)),
    Alternative("half-map", "the half map's multiplier instead of its square", output=lambda q, value: (
        math.copysign(math.sqrt(abs(value)), value) if q == "multiplier_slow"
        else value / 2 if q.startswith("log_multiplier") else value)),
    Alternative("common-logarithms", "common logarithms instead of natural ones", output=lambda q, value: (
        value / math.log(10) if q.startswith("log_") else value)),
    Alternative("other-side", "the state on the other side of the section, v > 0", output=lambda q, value: (
        -value if q in ("gamma_bar_0", "v_0", "dgamma_bar_0_domega", "dv_0_domega") else value)),
    Alternative("mirror-image", "the mirror image of the orbit, (pi - beta, pi - gamma, -v)", output=lambda q, value: (
        math.pi - value if q in ("beta", "gamma", "crossing_gamma")
        else -value if q.startswith(("v", "crossing_v", "beta_bar", "gamma_bar", "dbeta_bar", "dv_top")) else value)),
    Alternative("v-sign", "the sign of v_0", output=_named_first("v_0")),
    Alternative("printed-form", "the paper's printed one-harmonic law where the consistent one is asked",
                counterpart={"form": "printed"}),
    Alternative("consistent-form", "the consistent one-harmonic law where the paper's printed one is asked",
                counterpart={"form": "consistent"}),
    Alternative("stable-cycle", "the stable rotating cycle where the unstable one is asked",
                counterpart={"form": "stable"}),
    Alternative("unstable-cycle", "the unstable rotating cycle where the stable one is asked",
                counterpart={"form": "unstable"}),
    Alternative("calibrated-set", "the calibrated parameters where others are asked",
                counterpart={"set": "calibrated"}),
    Alternative("printed-set", "Table 1's parameters where others are asked", counterpart={"set": "printed"}),
    *(
        Alternative(f"{law}-orbits", f"orbits of the {law} friction law where the {other} one is asked", friction=law)
        for law, other in (("linear", "smooth"), ("smooth", "linear"))
    ),
    Alternative("friction-frozen", "the sign of gamma_y in the smooth law is kept from the start of an orbit",
                replace(CORRECT, smoothed="frozen")),
    Alternative("linear-law", "the linear friction law where the smooth one is asked",
                counterpart={"friction": "linear"}),
    Alternative("smooth-law", "the smooth friction law where the linear one is asked",
                counterpart={"friction": "smooth"}),
)  # fmt: skip
