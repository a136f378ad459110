"""Answers levels 1 to 9 of a sheet of questions about the tippedisk, with NumPy and SciPy.

python third_program.py SHEET.csv ANSWERS.csv [FIRST-LAST]
"""

import csv
import math
import sys
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.signal import convolve2d

UPRIGHT = math.pi / 2
TOLERANCES = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}


class Jet:
    """A Taylor polynomial in two variables s and t: c[i, j] belongs to s^i t^j."""

    __array_ufunc__ = None

    def __init__(self, c):
        self.c = np.asarray(c)

    @classmethod
    def variable(cls, value, ds, dt, order):
        c = np.zeros((order + 1, order + 1), dtype=np.result_type(float, type(ds), type(dt)))
        c[0, 0], c[1, 0], c[0, 1] = value, ds, dt
        return cls(c)

    def _lifted(self, other):
        if isinstance(other, Jet):
            return other
        c = np.zeros_like(self.c)
        c[0, 0] = other
        return Jet(c)

    def __add__(self, other):
        return Jet(self.c + self._lifted(other).c)

    def __sub__(self, other):
        return Jet(self.c - self._lifted(other).c)

    def __rsub__(self, other):
        return self._lifted(other) - self

    def __neg__(self):
        return Jet(-self.c)

    def __mul__(self, other):
        if not isinstance(other, Jet):
            return Jet(self.c * other)
        n = len(self.c)
        return Jet(convolve2d(self.c, other.c)[:n, :n])

    __radd__, __rmul__ = __add__, __mul__

    def __pow__(self, n):
        return self if n == 1 else self * self ** (n - 1)

    def __truediv__(self, other):
        return self * self._lifted(other)._composed(lambda x, k: (-1.0) ** k / x ** (k + 1))

    def _composed(self, coefficient):
        """f of this jet, where coefficient(x, k) is f's k-th Taylor coefficient at x."""
        x = self.c[0, 0]
        small = self - x
        power, total = self._lifted(1.0), self._lifted(coefficient(x, 0))
        for k in range(1, 2 * len(self.c) - 1):
            power = power * small
            total = total + power * coefficient(x, k)
        return total

    def sin(self):
        return self._composed(lambda x, k: np.sin(x + k * np.pi / 2) / math.factorial(k))

    def cos(self):
        return self._composed(lambda x, k: np.cos(x + k * np.pi / 2) / math.factorial(k))

    def d_ds(self):
        c = np.zeros_like(self.c)
        c[:-1, :] = self.c[1:, :] * np.arange(1, len(c))[:, None]
        return Jet(c)

    def d_dt(self):
        c = np.zeros_like(self.c)
        c[:, :-1] = self.c[:, 1:] * np.arange(1, len(c))[None, :]
        return Jet(c)


def sin_cos(x):
    return (x.sin(), x.cos()) if isinstance(x, Jet) else (math.sin(x), math.cos(x))


@dataclass(frozen=True)
class Disk:
    r: float
    e: float
    m: float
    A: float
    B: float
    g: float
    mu: float
    epsilon: float

    @classmethod
    def of(cls, row):
        return cls(*(float(row[name]) for name in ("r", "e", "m", "A", "B", "g", "mu", "epsilon")))

    @property
    def Bbar(self):
        return self.B - self.m * self.e**2

    @property
    def slip_limit(self):
        return self.mu * self.m * self.g


class LinearFriction:
    def __init__(self, disk):
        self.disk = disk

    def force(self, gamma_y):
        return -self.disk.slip_limit / self.disk.epsilon * gamma_y

    def slope(self, gamma_y):
        return -self.disk.slip_limit / self.disk.epsilon


class SmoothFriction(LinearFriction):
    def force(self, gamma_y):
        return -self.disk.slip_limit * gamma_y / (abs(gamma_y) + self.disk.epsilon)

    def slope(self, gamma_y):
        return -self.disk.slip_limit * self.disk.epsilon / (abs(gamma_y) + self.disk.epsilon) ** 2


class Spin:
    """The equations of motion of one disk at one speed Omega, under one friction law."""

    def __init__(self, disk, friction, Omega):
        self.disk, self.Omega = disk, Omega
        self.friction = SmoothFriction(disk) if friction == "smooth" else LinearFriction(disk)

    def inertia(self, beta, gamma):
        d = self.disk
        (_, cb), (sg, cg) = sin_cos(beta), sin_cos(gamma)
        return d.A * cg**2 + d.Bbar * sg**2 + d.m * (d.r + d.e * sg) ** 2 * cb**2

    def gyroscopic(self, beta, gamma):
        """The force h as a polynomial in v: its coefficients of 1, v and v^2."""
        d, O = self.disk, self.Omega
        (sb, cb), (sg, cg) = sin_cos(beta), sin_cos(gamma)
        rho = d.r + d.e * sg
        c0 = (d.A * cg**2 + d.Bbar * sg**2) * O**2 * sb * cb + d.m * d.e * rho * O**2 * sb * cb**3 * sg
        c1 = -2 * (d.A - d.Bbar) * O * cb * sg * cg - d.m * d.e * rho * (3 * sb**2 - 2) * O * cb * cg
        c2 = d.m * rho**2 * sb * cb
        return c0, c1, c2

    def h(self, beta, gamma, v):
        c0, c1, c2 = self.gyroscopic(beta, gamma)
        return c0 + c1 * v + c2 * v**2

    def gravity(self, beta, gamma):
        d = self.disk
        return -d.m * d.g * (d.r + d.e * sin_cos(gamma)[0]) * sin_cos(beta)[1]

    def lever(self, beta, gamma):
        return (self.disk.r + self.disk.e * sin_cos(gamma)[0]) * sin_cos(beta)[0]

    def sliding(self, beta, gamma, v):
        sb, cg = sin_cos(beta)[0], sin_cos(gamma)[1]
        return self.lever(beta, gamma) * v - self.disk.e * self.Omega * sb**2 * cg

    def acceleration(self, beta, gamma, v):
        force = self.h(beta, gamma, v) + self.gravity(beta, gamma)
        force = force + self.lever(beta, gamma) * self.friction.force(self.sliding(beta, gamma, v))
        return force / self.inertia(beta, gamma)

    def rhs(self, t, x):
        beta, gamma, v = x
        return [v, -self.Omega * sin_cos(beta)[1], self.acceleration(beta, gamma, v)]

    def gradient(self, beta, gamma, v):
        """The derivatives of v' by beta, gamma, v and Omega."""
        d, O = self.disk, self.Omega
        sb, cb, sg, cg = math.sin(beta), math.cos(beta), math.sin(gamma), math.cos(gamma)
        m, e, D = d.m, d.e, d.A - d.Bbar
        rho, drho = d.r + e * sg, e * cg
        K, dK = d.A * cg**2 + d.Bbar * sg**2, -2 * D * sg * cg
        q = 3 * sb**2 - 2

        M = self.inertia(beta, gamma)
        dM = np.array([-2 * m * rho**2 * sb * cb, dK + 2 * m * rho * drho * cb**2, 0, 0])
        dh = np.array(
            [
                (K * O**2 + m * rho**2 * v**2) * (cb**2 - sb**2)
                + 2 * D * O * v * sb * sg * cg
                + m * e * rho * O**2 * sg * cb**2 * (cb**2 - 3 * sb**2)
                - m * e * rho * O * v * cg * sb * (6 * cb**2 - q),
                dK * O**2 * sb * cb
                - 2 * D * O * v * cb * (cg**2 - sg**2)
                + 2 * m * rho * drho * v**2 * sb * cb
                + m * e * O**2 * sb * cb**3 * (drho * sg + rho * cg)
                - m * e * q * O * v * cb * (drho * cg - rho * sg),
                -2 * D * O * cb * sg * cg + 2 * m * rho**2 * v * sb * cb - m * e * rho * q * O * cb * cg,
                2 * K * O * sb * cb
                - 2 * D * v * cb * sg * cg
                + 2 * m * e * rho * O * sb * cb**3 * sg
                - m * e * rho * q * v * cb * cg,
            ]
        )
        df = m * d.g * np.array([rho * sb, -drho * cb, 0, 0])
        w, dw = rho * sb, np.array([rho * cb, drho * sb, 0, 0])
        slide = rho * v * sb - e * O * sb**2 * cg
        dslide = np.array(
            [rho * v * cb - 2 * e * O * sb * cb * cg, drho * v * sb + e * O * sb**2 * sg, rho * sb, -e * sb**2 * cg]
        )
        dforce = dh + df + dw * self.friction.force(slide) + w * self.friction.slope(slide) * dslide
        return (dforce - self.acceleration(beta, gamma, v) * dM) / M

    def jacobian(self, x):
        """The matrix of the linearised equations, and with it the derivative by Omega as a fourth column."""
        beta, gamma, v = x
        return np.array(
            [[0, 0, 1, 0], [self.Omega * math.sin(beta), 0, 0, -math.cos(beta)], self.gradient(beta, gamma, v)]
        )

    def eigenvalues(self, equilibrium):
        gamma = UPRIGHT if equilibrium == "inverted" else -UPRIGHT
        values = np.linalg.eigvals(self.jacobian((UPRIGHT, gamma, 0.0))[:, :3])
        return sorted(values, key=lambda z: (-round(z.real, 9), -z.imag))


class StateAnswers:
    """Level 1."""

    def __init__(self, row):
        self.spin = Spin(Disk.of(row), row["friction"], float(row["Omega"]))
        self.x = [float(row[name]) for name in ("beta", "gamma", "v")]

    def answer(self, row):
        spin, (beta, gamma, v), quantity = self.spin, self.x, row["quantity"]
        if quantity.startswith("dv_rate_d"):
            return spin.gradient(beta, gamma, v)[("beta", "gamma", "v").index(quantity[9:])]
        return {
            "M": lambda: spin.inertia(beta, gamma),
            "h": lambda: spin.h(beta, gamma, v),
            "f_G": lambda: spin.gravity(beta, gamma),
            "w_y": lambda: spin.lever(beta, gamma),
            "gamma_y": lambda: spin.sliding(beta, gamma, v),
            "gamma_rate": lambda: spin.rhs(0, self.x)[1],
            "lambda_Ty": lambda: spin.friction.force(spin.sliding(beta, gamma, v)),
            "v_rate": lambda: spin.acceleration(beta, gamma, v),
        }[quantity]()


class EquilibriumAnswers:
    """Level 2."""

    def __init__(self, row):
        spin = Spin(Disk.of(row), row["friction"], float(row["Omega"]))
        self.values = spin.eigenvalues(row["equilibrium"])

    def answer(self, row):
        _, n, part = row["quantity"].split("_")
        value = self.values[int(n) - 1]
        return value.real if part == "re" else value.imag


class HopfPoint:
    """Level 3: the Hopf point of inverted spinning and its normal form."""

    def __init__(self, row):
        self.disk = Disk.of(row)
        guess = math.sqrt(self.disk.g / self.disk.r)
        self.Omega = brentq(self.hurwitz, guess, 10 * guess, xtol=1e-13)
        J = self.matrix(self.Omega)
        values, vectors = np.linalg.eig(J)
        k = np.argmax(values.imag)
        self.omega = values[k].imag
        self.q = vectors[:, k] / np.linalg.norm(vectors[:, k])
        left_values, left = np.linalg.eig(J.T)
        p = left[:, np.argmin(left_values.imag)]
        p = p / np.vdot(self.q, p)
        self.dlambda = np.vdot(p, self.second(self.q))
        self.c1 = np.vdot(p, self.cubic()) / 2

    def matrix(self, Omega):
        return Spin(self.disk, "linear", Omega).jacobian((UPRIGHT, UPRIGHT, 0.0))[:, :3]

    def hurwitz(self, Omega):
        """Zero where lambda^3 + a2 lambda^2 + a1 lambda + a0 has a pair of roots on the imaginary axis."""
        _, a2, a1, a0 = np.poly(self.matrix(Omega))
        return a2 * a1 - a0

    def along(self, first, second, Omega, order):
        """The right-hand side at the equilibrium + s first + t second, as jets."""
        start = (UPRIGHT, UPRIGHT, 0.0)
        x = [Jet.variable(*entries, order) for entries in zip(start, first, second, strict=True)]
        return Spin(self.disk, "linear", Omega).rhs(0, x)[1:]

    def second(self, q):
        """(dJ/dOmega) q."""
        Omega = Jet.variable(self.Omega, 0.0j, 1.0 + 0.0j, 1)
        return np.array([0, *(f.c[1, 1] for f in self.along(q, 0 * q, Omega, 1))])

    def cubic(self):
        """C(q, q, conj q) - 2 B(q, J^-1 B(q, conj q)) + B(conj q, (2 i omega - J)^-1 B(q, q))."""
        q, J = self.q, self.matrix(self.Omega)

        def bilinear(a, b):
            return np.array([0, *(f.c[1, 1] for f in self.along(a, b, self.Omega, 2))])

        third = np.array([0, *(2 * f.c[2, 1] for f in self.along(q, q.conj(), self.Omega, 3))])
        mean = np.linalg.solve(J, bilinear(q, q.conj()))
        double = np.linalg.solve(2j * self.omega * np.eye(3) - J, bilinear(q, q))
        return third - 2 * bilinear(q, mean) + bilinear(q.conj(), double)

    def answer(self, row):
        square = self.dlambda.real / self.c1.real
        shift = self.c1.imag * square - self.dlambda.imag
        return {
            "omega_crit": self.Omega,
            "period": 2 * math.pi / self.omega,
            "first_lyapunov_coefficient": self.c1.real / self.omega,
            "transversality": self.dlambda.real,
            "amplitude_squared_slope": 4 * abs(self.q[0]) ** 2 * square,
            "period_slope": -2 * math.pi / self.omega**2 * shift,
        }[row["quantity"]]


class OneHarmonic:
    """Level 4."""

    def __init__(self, row):
        d, O = Disk.of(row), float(row["Omega"])
        r, e, m, g = d.r, d.e, d.m, d.g
        extra = e**2 if row["form"] == "consistent" else 0.0
        chi = d.A * (r - 2 * e) - d.Bbar * (2 * r**2 + e * (r + e) - extra) / (2 * (r + e))
        lost = 0.0 if row["form"] == "consistent" else e
        delta = -(r - lost) / (8 * (r + e)) * O**2
        square = -4 * e / (r + e) * (d.Bbar * r * O**2 - m * g * (r + e) ** 2) / (chi * O**2 + m * g * e * (r + e))
        self.amplitude = math.sqrt(square)
        self.frequency = math.sqrt(e * O**2 / (r + e) + delta * square)

    def answer(self, row):
        if row["quantity"] == "period":
            return 2 * math.pi / self.frequency
        return getattr(self, row["quantity"])


class SlowManifold:
    """Level 5: v = h_0 + epsilon h_1 + ..., as jets in beta and gamma."""

    HIGHEST = 5

    def __init__(self, row):
        self.disk, self.Omega = Disk.of(row), float(row["Omega"])
        order = self.HIGHEST + 1
        self.beta = Jet.variable(float(row["beta"]), 1.0, 0.0, order)
        self.gamma = Jet.variable(float(row["gamma"]), 0.0, 1.0, order)
        self.orders = self.series()

    def series(self):
        d, beta, gamma = self.disk, self.beta, self.gamma
        spin = Spin(d, "linear", self.Omega)
        M, w, f = spin.inertia(beta, gamma), spin.lever(beta, gamma), spin.gravity(beta, gamma)
        c0, c1, c2 = spin.gyroscopic(beta, gamma)
        damping = w**2 * d.slip_limit / M
        orders = [-spin.sliding(beta, gamma, 0.0) / w]
        for n in range(self.HIGHEST):
            force = c1 * orders[n] + c2 * sum(orders[i] * orders[n - i] for i in range(n + 1))
            if n == 0:
                force = force + c0 + f
            inertial = sum(orders[i].d_ds() * orders[n - i] for i in range(n + 1))
            inertial = inertial - orders[n].d_dt() * self.Omega * beta.cos()
            orders.append((force / M - inertial) / damping)
        return orders

    def residual(self, n):
        d = self.disk
        v = sum(self.orders[k] * d.epsilon**k for k in range(n + 1))
        spin = Spin(d, "linear", self.Omega)
        rate = spin.acceleration(self.beta, self.gamma, v)
        return d.epsilon * (v.d_ds() * v - v.d_dt() * self.Omega * self.beta.cos() - rate)

    def answer(self, row):
        n = int(row["order"])
        jet = self.residual(n) if row["quantity"].startswith("residual") else self.orders[n]
        return jet.c[0, 0]


def upright(t, y):
    return y[0] - UPRIGHT


def turning(t, y):
    return y[2]


def flat(t, y):
    return math.sin(y[0])


flat.terminal = True


class Trajectory:
    """Level 6: one orbit, run as far as the questions go."""

    SETTLING = 0.01

    def __init__(self, row):
        self.spin = Spin(Disk.of(row), row["friction"], float(row["Omega"]))
        self.start = [float(row[name]) for name in ("beta", "gamma", "v")]
        self.run(10.0)

    def run(self, end):
        self.end = end
        self.solution = solve_ivp(
            self.spin.rhs, (0, end), self.start, events=(upright, flat), dense_output=True, **TOLERANCES
        )
        times, states = self.solution.t_events[0], self.solution.y_events[0]
        self.crossings = [(t, y) for t, y in zip(times, states, strict=True) if t > self.SETTLING]

    def answer(self, row):
        if row["quantity"] == "flat_time":
            return self.solution.t_events[1][0]
        if row["quantity"] in ("beta", "gamma", "v"):
            if float(row["t"]) > self.end:
                self.run(float(row["t"]))
            return self.solution.sol(float(row["t"]))[("beta", "gamma", "v").index(row["quantity"])]
        n = int(row["n"])
        while len(self.crossings) < n and self.end < 100:
            self.run(2 * self.end)
        time, state = self.crossings[n - 1]
        return {"crossing_time": time, "crossing_gamma": state[1], "crossing_v": state[2]}[row["quantity"]]


class Cycle:
    """The half map of beta = pi/2, from v < 0 to v > 0, with its derivatives, and the cycle if it closes."""

    def __init__(self, spin, point):
        self.spin, self.point = spin, np.asarray(point)

        def half(t, y):
            return y[0] - UPRIGHT

        half.terminal, half.direction = True, 1
        start = np.concatenate([[UPRIGHT, UPRIGHT + point[0], point[1]], np.eye(3, 4).ravel(), [0.0]])
        solution = solve_ivp(self.variational, (0, 5), start, events=(half, turning), **TOLERANCES)
        if not len(solution.t_events[0]):
            raise ArithmeticError("no return to beta = pi/2")
        y, turns = solution.y_events[0][0], solution.y_events[1]
        self.half_time, self.divergence = solution.t_events[0][0], y[15]
        self.beta_max = np.abs(turns[:, 0] - UPRIGHT).max()
        self.end = np.array([y[1] - UPRIGHT, y[2]])
        rate, P = np.array(spin.rhs(0, y[:3])), y[3:15].reshape(3, 4)
        self.time_gradient = -P[0] / rate[0]
        self.map = (P + np.outer(rate, self.time_gradient))[1:, 1:]

    def variational(self, t, y):
        J = self.spin.jacobian(y[:3])
        dP = J[:, :3] @ y[3:15].reshape(3, 4)
        dP[:, 3] += J[:, 3]
        return np.concatenate([self.spin.rhs(t, y[:3]), dP.ravel(), [J[2, 2]]])

    def newton_step(self):
        """By symmetry the cycle is closed if the half map takes a point to its negative."""
        return -np.linalg.solve(self.map[:, :2] + np.eye(2), self.end + self.point)

    def tangent(self):
        return -np.linalg.solve(self.map[:, :2] + np.eye(2), self.map[:, 2])

    def answer(self, row):
        tangent = self.tangent()
        slow = np.abs(np.linalg.eigvals(self.map[:, :2])).max() ** 2
        return {
            "period": 2 * self.half_time,
            "gamma_bar_0": self.point[0],
            "v_0": self.point[1],
            "beta_max": self.beta_max,
            "multiplier_slow": slow,
            "log_multiplier_slow": math.log(slow),
            "log_multiplier_fast": 2 * self.divergence - math.log(slow),
            "dperiod_domega": 2 * (self.time_gradient[1:3] @ tangent + self.time_gradient[3]),
            "dgamma_bar_0_domega": tangent[0],
            "dv_0_domega": tangent[1],
        }[row["quantity"]]


class CycleFamily:
    """Levels 7 and 9: the cycles of one disk and law, followed in Omega."""

    def __init__(self, row):
        self.disk, self.friction = Disk.of(row), row["friction"]
        Omega = 0.985 * HopfPoint(row).Omega
        point = np.array([1.5, -2.0])
        for _ in range(10):
            point = -Cycle(self.spin(Omega), point).end
        self.cycles = {Omega: self.closed(Omega, point)}
        self.lowest = 0.0

    def spin(self, Omega):
        return Spin(self.disk, self.friction, Omega)

    def closed(self, Omega, point):
        for _ in range(8):
            cycle = Cycle(self.spin(Omega), point)
            step = cycle.newton_step()
            point = point + step
            if point[1] >= 0:
                break
            if np.abs(step).max() < 1e-9 * abs(point[1]):
                return Cycle(self.spin(Omega), point)
        raise ArithmeticError("Newton's method does not converge")

    def at(self, target):
        Omega = min(self.cycles, key=lambda known: abs(known - target))
        step = target - Omega
        while Omega != target:
            if target <= self.lowest or abs(step) < 4e-7:
                self.lowest = max(target, self.lowest)
                raise ArithmeticError("too close to the connection")
            near = self.cycles[Omega]
            goal = target if abs(step) >= abs(target - Omega) else Omega + step
            guess = near.point + (goal - Omega) * near.tangent()
            try:
                if not 0.4 < guess[1] / near.point[1] < 2.5:
                    raise ArithmeticError("too long a step")
                self.cycles[goal] = self.closed(goal, guess)
                Omega, step = goal, 2 * (goal - Omega)
            except ArithmeticError:
                step = (goal - Omega) / 2
        return self.cycles[target]


class Heteroclinic:
    """Level 8: the unstable manifold of one saddle is aimed at the next one."""

    OFFSET = 1e-6

    def __init__(self, row):
        self.disk, self.friction = Disk.of(row), row["friction"]
        critical = HopfPoint(row).Omega
        self.Omega = brentq(self.miss, 0.96 * critical, 0.985 * critical, xtol=1e-12)
        self.eigenvalues = self.spin(self.Omega).eigenvalues("noninverted")

    def spin(self, Omega):
        return Spin(self.disk, self.friction, Omega)

    def miss(self, Omega):
        """Beyond the next saddle by how much in beta, or short of it by how much in gamma."""
        spin = self.spin(Omega)
        values, vectors = np.linalg.eig(spin.jacobian((UPRIGHT, -UPRIGHT, 0.0))[:, :3])
        direction = vectors[:, np.argmax(values.real)].real
        start = np.array([UPRIGHT, -UPRIGHT, 0.0]) + self.OFFSET * direction / direction[0]

        def back(t, y):
            return y[0] - UPRIGHT

        def beyond(t, y):
            return y[1] - 3 * UPRIGHT

        back.terminal = beyond.terminal = True
        solution = solve_ivp(spin.rhs, (0, 30), start, events=(back, beyond), **TOLERANCES)
        beta, gamma, _ = solution.y[:, -1]
        return beta - UPRIGHT if len(solution.t_events[1]) else gamma - 3 * UPRIGHT

    def answer(self, row):
        names = ("lambda_u", "lambda_s", "lambda_ss")
        if row["quantity"] == "omega_h":
            return self.Omega
        return self.eigenvalues[names.index(row["quantity"])].real


KINDS = {
    "rhs": StateAnswers,
    "equilibrium": EquilibriumAnswers,
    "hopf": HopfPoint,
    "harmonic-balance": OneHarmonic,
    "slow-manifold": SlowManifold,
    "trajectory": Trajectory,
    "limit-cycle": CycleFamily,
    "heteroclinic": Heteroclinic,
    "near-heteroclinic": CycleFamily,
}
PARAMETERS = ("friction", "r", "e", "m", "A", "B", "g", "mu", "epsilon")
INPUTS = ("kind", *PARAMETERS, "Omega", "beta", "gamma", "v", "equilibrium", "form")


def answered(rows, levels):
    """The answers to all rows of these levels, as text by id."""
    answers, cases = {}, {}
    for row in rows:
        kind = KINDS.get(row["kind"])
        if int(row["level"]) not in levels or kind is None or row["from"] == "decimals":
            continue
        key = tuple(row[name] for name in (PARAMETERS if kind is CycleFamily else INPUTS))
        try:
            if key not in cases:
                cases[key] = kind(row)
            case = cases[key].at(float(row["Omega"])) if kind is CycleFamily else cases[key]
            answers[row["id"]] = f"{case.answer(row):.17g}"
        except (ArithmeticError, ValueError, LookupError):
            continue
    return answers


def main(sheet, out, span="1-9"):
    first, _, last = span.partition("-")
    with open(sheet, newline="") as file:
        rows = list(csv.DictReader(file))
    answers = answered(rows, range(int(first), int(last or first) + 1))
    with open(out, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["id", "answer"])
        writer.writerows(answers.items())


if __name__ == "__main__":
    main(*sys.argv[1:])
