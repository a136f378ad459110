"""Faults that people make, planted into a program of our own: what it answers, and which words must name the fault.

The list was written from the paper, the traps of the model and what goes wrong with units, indices, formats and
integrators, before any code that names faults was changed for it, and imports none of that code. ``words`` are
alternatives parted by "|"; of one alternative all parts between "&" must occur in what the diagnosis says.
"""

from __future__ import annotations

import cmath
import math
import random
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["FAULTS", "Fault", "Program", "outputs", "rhs", "right"]

Sheet = dict[str, str]
PARAMETERS = {"r": 0.045, "e": 2.5e-3, "m": 0.435, "A": 0.249e-3, "B": 0.227e-3, "g": 9.81, "mu": 0.3, "eps": 0.1}
_SOURCE = """
Bbar = B - m*e**2
sb, cb, sg, cg = sin(beta), cos(beta), sin(gamma), cos(gamma)
rho = r + e*sg
M = A*cg**2 + Bbar*sg**2 + m*rho**2*cb**2
h1 = (A*cg**2 + Bbar*sg**2)*Omega**2*sb*cb
h2 = 2*(A - Bbar)*Omega*v*cb*sg*cg
h3 = m*rho**2*v**2*sb*cb
h4 = m*e*rho*Omega**2*sb*cb**3*sg
h5 = m*e*rho*(3*sb**2 - 2)*Omega*v*cb*cg
h = h1 - h2 + h3 + h4 - h5
f_G = -m*g*rho*cb
w_y = rho*sb
gamma_y = rho*v*sb - e*Omega*sb**2*cg
size = -gamma_y if gamma_y.real < 0 else gamma_y
lambda_linear = -mu*m*g/eps*gamma_y
lambda_smooth = -mu*m*g*gamma_y/(size + eps)
lambda_Ty = lambda_smooth if smooth else lambda_linear
gamma_rate = -Omega*cb
v_rate = (h + f_G + w_y*lambda_Ty)/M
"""
_NAMES = ("M", "h", "f_G", "w_y", "gamma_y", "gamma_rate", "lambda_Ty", "v_rate")
_STATES = range(1, 61)


@dataclass(frozen=True)
class Fault:
    """One planted fault."""

    name: str
    words: str
    answers: Callable[[Store], Sheet]

    def named_by(self, said: str) -> bool:
        return any(all(part in said for part in one.split("&")) for one in self.words.split("|"))


class Program:
    """The source above with some of its text replaced, run in doubles."""

    def __init__(self, *changes: tuple[str, str], **values: float) -> None:
        text = _SOURCE
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new)
        self.code, self.values = compile(text, "planted", "exec"), PARAMETERS | values

    def run(self, smooth: bool, state: Mapping[str, complex]) -> dict[str, complex]:
        space = {"sin": cmath.sin, "cos": cmath.cos, "tan": cmath.tan, "tanh": cmath.tanh, "atan": cmath.atan,
                 "sqrt": cmath.sqrt, "pi": math.pi, "smooth": smooth, **self.values, **state}  # fmt: skip
        exec(self.code, space)
        return {name: complex(space[name]) for name in _NAMES}

    def entry(self, smooth: bool, state: Mapping[str, float]) -> dict[str, float]:
        found = {
            name: value.real for name, value in self.run(smooth, {k: complex(x) for k, x in state.items()}).items()
        }
        for name in ("beta", "gamma", "v"):
            moved = {k: complex(x, 1e-40 * (k == name)) for k, x in state.items()}
            found[f"dv_rate_d{name}"] = self.run(smooth, moved)["v_rate"].imag / 1e-40
        return found


def _entries(store: Store) -> Iterator[tuple[str, list[Quantity], dict[str, float]]]:
    for n in _STATES:
        for law in ("both", "linear", "smooth"):
            asked = store.matching(f"printed/{law}/rhs/{n:03d}/")
            yield law, asked, {name: float(text) for name, text in asked[0].inputs.items()}


def rhs(program: Program, change: Callable[[dict[str, float]], dict[str, float]] = dict) -> Callable[[Store], Sheet]:
    def answers(store: Store) -> Sheet:
        given = {}
        for law, asked, state in _entries(store):
            found = program.entry(law == "smooth", change(state))
            given |= {q.id: repr(found[q.name]) for q in asked}
        return given

    return answers


def right(quantity: Quantity) -> float:
    """What a correct program in doubles says: not quite the truth, but the same each time."""
    noise = random.Random(quantity.id).uniform(-1, 1) * (1e-14 if quantity.level < 6 else 1e-11)
    return quantity.for_doubles * (1 + noise)


Output = Callable[[Quantity, Store], float | str | None]


def outputs(change: Output, *prefixes: str, rhs: bool = True) -> Callable[[Store], Sheet]:
    """A program with the right equations whose answers to some questions are changed; None keeps them."""

    def answers(store: Store) -> Sheet:
        given = {q.id: repr(right(q)) for _, asked, _ in _entries(store) for q in asked} if rhs else {}
        for q in (q for prefix in prefixes for q in store.matching(prefix) if "doubles" in q.values):
            changed = change(q, store)
            given[q.id] = changed if isinstance(changed, str) else repr(right(q) if changed is None else changed)
        return given

    return answers


def on(*names: str, by: Callable[[float], float]) -> Output:
    """A function of the right answer, for the quantities of these names."""
    return lambda q, store: by(right(q)) if placed(q.name)[0] in names else None


def swapped(one: str, two: str) -> Output:
    """The answer to another question: the same with two words in each other's place."""
    return lambda q, store: right(store[q.id.replace(one, "\0").replace(two, one).replace("\0", two)])


def _model(name: str, words: str, *changes: tuple[str, str], **values: float) -> Fault:
    return Fault(name, words, rhs(Program(*changes, **values)))


def _input(name: str, words: str, change: Callable[[dict[str, float]], dict[str, float]]) -> Fault:
    return Fault(name, words, rhs(Program(), change))


def _only(names: str, by: Callable[[float], float]) -> Callable[[dict[str, float]], dict[str, float]]:
    return lambda state: {name: by(x) if name in names.split() else x for name, x in state.items()}


_PARAMETERS = (
    _model("mu-0.31", "mu&0.31", mu=0.31),
    _model("mu-0.2", "mu&0.2", mu=0.2),
    _model("mu-3", "mu&3", mu=3.0),
    _model("eps-0.01", "epsilon&0.01", eps=0.01),
    _model("eps-0.11", "epsilon&0.11", eps=0.11),
    _model("g-9.8", "g = 9.8", g=9.8),
    _model("g-9.80665", "9.80665", g=9.80665),
    _model("g-9.83", "g = 9.83", g=9.83),
    _model("g-negative", "sign of f_g|g = -9.81", g=-9.81),
    _model("r-diameter", "r = 0.09", r=0.09),
    _model("r-0.046", "r = 0.046", r=0.046),
    _model("r-plus-e", "r = 0.0475", r=0.0475),
    _model("r-cm", "r = 4.5", r=4.5),
    _model("e-0.0026", "e = 0.0026", e=0.0026),
    _model("e-zero", "e = 0", e=0.0),
    _model("e-mm", "e = 2.5", e=2.5),
    _model("m-grams", "m = 435", m=435.0),
    _model("m-0.453", "m = 0.453", m=0.453),
    _model("m-0.4", "m = 0.4", m=0.4),
    _model("A-0.294", "a = 0.000294", A=0.294e-3),
    _model("A-0.0249", "a = 0.0000249|a = 2.49e-05", A=0.0249e-3),
    _model("B-0.272", "b = 0.000272", B=0.272e-3),
    _model("B-is-A", "b = 0.000249|b for a|a for b", B=0.249e-3),
    _model("A-is-B", "a = 0.000227", A=0.227e-3),
    _model("A-B", "a and b exchanged", A=0.227e-3, B=0.249e-3),
    _model("B-for-Bbar", "b in place of bbar", ("B - m*e**2", "B")),
    _model("Bbar-plus", "b + m e^2", ("B - m*e**2", "B + m*e**2")),
    _model("Bbar-e", "bbar", ("B - m*e**2", "B - m*e*0.045")),
    _model("Bbar-half", "bbar", ("B - m*e**2", "B - m*e**2/2")),
    _model("half-e-rho", "rho", ("rho = r + e*sg", "rho = r + e*sg/2")),
    _model("rho-cos", "rho", ("rho = r + e*sg", "rho = r + e*cg")),
    _model("rho-minus", "r - e sin gamma|e = -0.0025", ("rho = r + e*sg", "rho = r - e*sg")),
)  # fmt: skip
_TERMS = (
    _model("M-rho", "m's&rho", ("m*rho**2*cb**2", "m*r**2*cb**2")),
    _model("M-mass", "m's", ("+ m*rho**2*cb", "+ rho**2*cb")),
    _model("M-sine", "m's&sin", ("m*rho**2*cb**2", "m*rho**2*sb**2")),
    _model("M-plain", "m's&cos", ("m*rho**2*cb**2", "m*rho**2*cb")),
    _model("M-no-3", "m's&missing", (" + m*rho**2*cb**2", "")),
    _model("M-swapped", "exchanged&m", ("M = A*cg**2 + Bbar*sg**2", "M = A*sg**2 + Bbar*cg**2")),
    _model("M-double-2", "m's&2", ("M = A*cg**2 + Bbar*sg**2", "M = A*cg**2 + 2*Bbar*sg**2")),
    _model("h1-missing", "h's&1&missing", ("h = h1 - h2", "h = -h2")),
    _model("h1-twice", "h's&1&2", ("h = h1", "h = 2*h1")),
    _model("h1-sine", "h's&1", ("Omega**2*sb*cb\n", "Omega**2*cb\n")),
    _model("h1-A", "h's&1", ("h1 = (A*cg**2 + Bbar*sg**2)", "h1 = (A*cg**2 + A*sg**2)")),
    _model("h1-omega", "h's&1&omega", ("sg**2)*Omega**2", "sg**2)*Omega")),
    _model("h2-factor", "h's&second|h's&2", ("2*(A - Bbar)", "(A - Bbar)")),
    _model("h2-sign", "h's&2", ("h1 - h2", "h1 + h2")),
    _model("h2-missing", "h's&2&missing", ("h1 - h2", "h1")),
    _model("h2-sum", "h's&2", ("(A - Bbar)", "(A + Bbar)")),
    _model("h2-cos", "h's&2", ("v*cb*sg*cg", "v*cb*sg*sg")),
    _model("h3-missing", "h's&3&missing", ("+ h3", "")),
    _model("h3-r", "h's&3&rho", ("m*rho**2*v**2", "m*r**2*v**2")),
    _model("h3-v", "h's&3&v", ("rho**2*v**2*sb", "rho**2*v*sb")),
    _model("h3-half", "h's&3&1/2", ("h3 = m", "h3 = 0.5*m")),
    _model("h4-missing", "h's&4&missing", ("+ h4", "")),
    _model("h4-power", "cos^2|cos beta&fourth|h's&4", ("cb**3", "cb**2")),
    _model("h4-cos", "h's&4", ("cb**3*sg", "cb**3*cg")),
    _model("h4-e", "h's&4", ("h4 = m*e*rho", "h4 = m*rho")),
    _model("h4-sign", "h's&4", ("+ h4", "- h4")),
    _model("h4-rho", "h's&4&rho", ("h4 = m*e*rho", "h4 = m*e*r")),
    _model("h5-one", "3 sin^2 beta - 1", ("sb**2 - 2)", "sb**2 - 1)")),
    _model("h5-missing", "h's&5&missing", ("- h5", "")),
    _model("h5-sin", "h's&5", ("v*cb*cg", "v*cb*sg")),
    _model("h5-bracket", "h's&5|h's last", ("(3*sb**2 - 2)", "(2*sb**2 - 3)")),
    _model("h5-sign", "h's&5", ("- h5", "+ h5")),
    _model("h5-v", "h's&5", ("Omega*v*cb*cg", "Omega*cb*cg")),
    _model("gravity-sine", "f_g", ("g*rho*cb", "g*rho*sb")),
    _model("gravity-r", "f_g&rho", ("g*rho*cb", "g*r*cb")),
    _model("gravity-mass", "f_g", ("-m*g*rho*cb", "-g*rho*cb")),
    _model("gravity-missing", "f_g", ("-m*g*rho*cb", "0*cb")),
    _model("lever-r", "w_y&rho", ("w_y = rho*sb", "w_y = r*sb")),
    _model("lever-cos", "w_y", ("w_y = rho*sb", "w_y = rho*cb")),
    _model("lever-sine", "w_y", ("w_y = rho*sb", "w_y = rho")),
    _model("slip-plain", "gamma_y", ("Omega*sb**2*cg", "Omega*sb*cg")),
    _model("slip-sin-square", "sin(beta^2)", ("Omega*sb**2*cg", "Omega*sin(beta**2)*cg")),
    _model("slip-sign", "gamma_y", ("- e*Omega*sb**2*cg", "+ e*Omega*sb**2*cg")),
    _model("slip-sin", "gamma_y", ("sb**2*cg", "sb**2*sg")),
    _model("slip-r", "gamma_y&rho", ("rho*v*sb -", "r*v*sb -")),
    _model("slip-one", "gamma_y&missing", (" - e*Omega*sb**2*cg", "")),
    _model("slip-cos", "gamma_y", ("rho*v*sb -", "rho*v*cb -")),
    _model("force-sign", "friction force|lambda_ty", ("= -mu*m*g/eps", "= mu*m*g/eps"), ("= -mu*m*g*gamma",
        "= mu*m*g*gamma")),
    _model("force-weight", "m g|lambda_ty", ("mu*m*g/", "mu/"), ("mu*m*g*gamma", "mu*gamma")),
    _model("force-mu", "mu = 1", ("mu*m*g/", "m*g/"), ("mu*m*g*gamma", "m*g*gamma")),
    _model("force-no-m", "lambda_ty|friction force", ("mu*m*g/", "mu*g/"), ("mu*m*g*gamma", "mu*g*gamma")),
    _model("force-abs", "smooth&abs", ("size = -gamma_y if gamma_y.real < 0 else gamma_y", "size = gamma_y")),
    _model("force-root", "smooth&sqrt", ("(size + eps)", "sqrt(size**2 + eps**2)")),
    _model("force-tanh", "smooth&tanh", ("gamma_y/(size + eps)", "tanh(gamma_y/eps)")),
    _model("force-atan", "smooth&arctan", ("gamma_y/(size + eps)", "2/pi*atan(gamma_y/eps)")),
    _model("force-signum", "smooth&sign", ("gamma_y/(size + eps)", "gamma_y/size")),
    _model("law-linear", "linear", ("lambda_smooth if smooth else lambda_linear", "lambda_linear")),
    _model("law-smooth", "smooth", ("lambda_smooth if smooth else lambda_linear", "lambda_smooth")),
    _model("rate-sign", "gamma' = + omega|gamma_rate", ("= -Omega*cb", "= Omega*cb")),
    _model("rate-sin", "gamma_rate|gamma'", ("= -Omega*cb", "= -Omega*sb")),
    _model("rate-one", "gamma_rate|gamma'", ("= -Omega*cb", "= -cb")),
    _model("v-no-mass", "v_rate", ("w_y*lambda_Ty)/M", "w_y*lambda_Ty)")),
    _model("v-no-friction", "v_rate|v'", (" + w_y*lambda_Ty)/M", ")/M")),
    _model("v-no-lever", "v_rate|v'", ("w_y*lambda_Ty)/M", "lambda_Ty)/M")),
    _model("v-no-h", "v_rate|v'", ("(h + f_G", "(f_G")),
    _model("v-friction-minus", "v_rate|v'", ("+ w_y*lambda_Ty", "- w_y*lambda_Ty")),
)  # fmt: skip
_INPUTS = (
    _input("degrees", "as degrees", _only("beta gamma", math.radians)),
    _input("to-degrees", "to degrees", _only("beta gamma", math.degrees)),
    _input("shifted", "shifted", _only("beta gamma", lambda x: x + math.pi / 2)),
    _input("beta-shifted", "beta&pi/2", _only("beta", lambda x: x - math.pi / 2)),
    _input("gamma-shifted", "gamma&pi|sign of e", _only("gamma", lambda x: x + math.pi)),
    _input("beta-complement", "beta&pi/2", _only("beta", lambda x: math.pi / 2 - x)),
    _input("rpm", "omega&0.1047|omega&2 pi/60|omega&pi/30", _only("Omega", lambda x: x * 2 * math.pi / 60)),
    _input("omega-sign", "sign of omega", _only("Omega", lambda x: -x)),
    _input("v-sign", "v&-1|sign of v", _only("v", lambda x: -x)),
    _input("omega-30", "omega = 30", _only("Omega", lambda x: 30.0)),
    _input("transposed", "exchanged", lambda s: {**s, "beta": s["gamma"], "gamma": s["beta"]}),
    _input("v-and-omega", "v and omega exchanged|omega and v exchanged", lambda s: {**s, "v": s["Omega"],
        "Omega": s["v"]}),
)  # fmt: skip


def _single(x: float) -> float:
    return float(struct.unpack("f", struct.pack("f", x))[0])


def _differences(step: float, central: bool) -> Callable[[Store], Sheet]:
    def answers(store: Store) -> Sheet:
        program, given = Program(), {}
        for law, asked, state in _entries(store):
            found = program.entry(law == "smooth", state)
            for name in ("beta", "gamma", "v"):
                up = program.entry(law == "smooth", {**state, name: state[name] + step})["v_rate"]
                down = program.entry(law == "smooth", {**state, name: state[name] - step})["v_rate"]
                slope = (up - down) / (2 * step) if central else (up - found["v_rate"]) / step
                found[f"dv_rate_d{name}"] = slope
            given |= {q.id: repr(found[q.name]) for q in asked}
        return given

    return answers


def _plain(change: Callable[[float], float | str]) -> Callable[[Store], Sheet]:
    """All answers at level 1 put through a function."""
    return outputs(lambda q, store: change(right(q)), *(f"printed/{law}/rhs/0" for law in ("both", "linear", "smooth")))


_RHS = tuple(f"printed/{law}/rhs/0" for law in ("both", "linear", "smooth"))
_FORMS = (
    Fault("float32-answers", "single precision", _plain(_single)),
    Fault("float32-inputs", "single precision", rhs(Program(**{k: _single(x) for k, x in PARAMETERS.items()}),
        lambda s: {k: _single(x) for k, x in s.items()})),
    Fault("six-digits", "6 significant digits", _plain(lambda x: f"{x:.6g}")),
    Fault("five-decimals", "5 decimals", _plain(lambda x: f"{x:.5f}")),
    Fault("forward-6", "finite differences", _differences(1e-6, False)),
    Fault("forward-8", "finite differences", _differences(1e-8, False)),
    Fault("central-5", "finite differences", _differences(1e-4, True)),
    Fault("central-3", "finite differences", _differences(1e-3, True)),
    Fault("derivatives-exchanged", "dv_rate_dbeta&dv_rate_dgamma", outputs(swapped("dv_rate_dbeta",
        "dv_rate_dgamma"), *_RHS)),
    Fault("one-row-off", "next|previous|another", outputs(lambda q,
        store: right(store.get(f"{q.id.rsplit('/', 2)[0]}/{int(q.id.split('/')[3]) - 1:03d}/{q.name}", q)), *_RHS)),
    Fault("M-and-h", "m&h&exchanged", outputs(swapped("/M", "/h"), *_RHS)),
    Fault("force-in-mN", "f_g&1000", outputs(on("f_G", by=lambda x: 1000 * x), *_RHS)),
)  # fmt: skip

FAULTS = (*_PARAMETERS, *_TERMS, *_INPUTS, *_FORMS)
