"""What `blind_program.py` answers without integrating: the Hopf point, harmonic balance, the
slow manifold.
"""

import functools
import math

import mpmath
import numpy as np

HALF_PI = math.pi / 2


def critical_speed(p):
    r, e, m, _, B, g = p[:6]
    Bbar = B - m * e**2
    return math.sqrt(m * g * (r + e) ** 2 / (Bbar * r))


@functools.cache
def normal_form(p, model, jacobian):
    """Critical frequency, q, p.C(q, q, qbar) and the eigenvalue's derivative by Omega, all at
    the critical speed.
    """
    mpmath.mp.dps = 60
    Oc = critical_speed(p)
    y0 = [mpmath.mpf(HALF_PI), mpmath.mpf(HALF_PI), mpmath.mpf(0)]

    def cubic(u):
        """Third derivative of the field in the direction u; the fifth order is taken off."""

        def odd(d):
            plus = model(mpmath, p, Oc, False, *[y + d * x for y, x in zip(y0, u, strict=True)])
            minus = model(mpmath, p, Oc, False, *[y - d * x for y, x in zip(y0, u, strict=True)])
            return [mpmath.mpf(0), *[(plus[i] - minus[i]) / 2 for i in (6, 7)]]

        d = mpmath.mpf(10) ** -9
        one, two = odd(d), odd(2 * d)
        return np.array([complex((b - 2 * a) / d**3) for a, b in zip(one, two, strict=True)])

    J = jacobian(p, Oc, False, [HALF_PI, HALF_PI, 0.0])
    values, right = np.linalg.eig(J)
    k = np.argmax(values.imag)
    omega, q = values[k].imag, right[:, k]
    q = q / np.linalg.norm(q)
    left_values, left = np.linalg.eig(J.T)
    adjoint = left[:, np.argmin(left_values.imag)]
    adjoint = adjoint / np.conj(np.vdot(adjoint, q))
    big = [mpmath.mpc(z) for z in q]
    bar = [mpmath.conj(z) for z in big]
    sums = [
        cubic([a + b for a, b in zip(big, bar, strict=True)]),
        cubic([a - b for a, b in zip(big, bar, strict=True)]),
        cubic(bar),
    ]
    g21 = np.vdot(adjoint, (sums[0] - sums[1] - 2 * sums[2]) / 6)
    d = 1e-4
    slopes = [jacobian(p, Oc + k * d, False, [HALF_PI, HALF_PI, 0.0]) for k in (1, -1)]
    by_Omega = np.vdot(adjoint, (slopes[0] - slopes[1]) / (2 * d) @ q)
    return omega, q, g21, by_Omega


def hopf_point(p, model, jacobian):
    omega, q, g21, by_Omega = normal_form(p, model, jacobian)
    c1 = g21 / 2
    transversality = by_Omega.real
    square = transversality / c1.real  # |z|^2 per unit of Omega_crit - Omega
    return {
        "omega_crit": critical_speed(p),
        "period": 2 * math.pi / omega,
        "first_lyapunov_coefficient": c1.real / omega,
        "transversality": transversality,
        "amplitude_squared_slope": 4 * abs(q[0]) ** 2 * square,
        "period_slope": -2 * math.pi / omega**2 * (-by_Omega.imag + c1.imag * square),
    }


def harmonic_balance(p, row):
    r, e, m, A, B, g = p[:6]
    Omega = float(row["Omega"])
    Bbar = B - m * e**2
    chi = A * (r - 2 * e) - Bbar * (2 * r**2 + e * (r + e)) / (2 * (r + e))
    stiffness = r - e
    if row["form"] == "consistent":
        stiffness = r
        chi = chi + Bbar * e**2 / (2 * (r + e))
    ratio = -(Bbar * r * Omega**2 - m * g * (r + e) ** 2) / (chi * Omega**2 + m * g * e * (r + e))
    C = 2 * math.sqrt(e / (r + e)) * math.sqrt(ratio)
    frequency = Omega * math.sqrt(e / (r + e) - stiffness / (r + e) * C**2 / 8)
    return {"amplitude": C, "frequency": frequency, "period": 2 * math.pi / frequency}


ORDER = 6
PLACES = [(i, j) for i in range(ORDER + 1) for j in range(ORDER + 1 - i)]


class Series:
    """A polynomial in the displacements of beta and gamma, cut off at degree ORDER."""

    def __init__(self, c):
        self.c = c

    def __add__(self, other):
        return Series(self.c + (other.c if isinstance(other, Series) else constant(other).c))

    __radd__ = __add__

    def __sub__(self, other):
        return self + -1 * other

    def __rsub__(self, other):
        return other + -1 * self

    def __mul__(self, other):
        if not isinstance(other, Series):
            return Series(self.c * other)
        c = np.zeros_like(self.c)
        for i, j in PLACES:
            if self.c[i, j]:
                c[i:, j:] += self.c[i, j] * other.c[: ORDER + 1 - i, : ORDER + 1 - j]
        return Series(c)

    __rmul__ = __mul__

    def __truediv__(self, other):
        rest = 1 - other * (1 / other.c[0, 0])
        total = power = constant(1.0)
        for _ in range(ORDER):
            power = power * rest
            total = total + power
        return self * total * (1 / other.c[0, 0])

    def by(self, variable):
        c = np.zeros_like(self.c)
        for k in range(ORDER):
            if variable == "beta":
                c[k] = (k + 1) * self.c[k + 1]
            else:
                c[:, k] = (k + 1) * self.c[:, k + 1]
        return Series(c)


def constant(value):
    c = np.zeros((ORDER + 1, ORDER + 1))
    c[0, 0] = value
    return Series(c)


def circular(x, place):
    """Sine and cosine of x plus a displacement, as series."""
    found = []
    for shift in (0, 1):
        c = np.zeros((ORDER + 1, ORDER + 1))
        for k in range(ORDER + 1):
            c[(k, 0) if place == 0 else (0, k)] = math.sin(
                x + (k + shift) * HALF_PI
            ) / math.factorial(k)
        found.append(Series(c))
    return found


@functools.cache
def slow_manifold(p, Omega, beta, gamma):
    r, e, m, A, B, g, mu, eps = p
    Bbar = B - m * e**2
    sb, cb = circular(beta, 0)
    sg, cg = circular(gamma, 1)
    rho = r + e * sg
    inertia = A * cg * cg + Bbar * sg * sg
    M = inertia + m * rho * rho * cb * cb
    # h + f_G = free + linear v + square v^2, and the friction is -(drag / epsilon)(v - h_0)
    free = (
        inertia * Omega**2 * sb * cb
        + m * e * Omega**2 * rho * sb * cb * cb * cb * sg
        - m * g * rho * cb
    )
    linear = (
        -2 * (A - Bbar) * Omega * cb * sg * cg - m * e * Omega * rho * (3 * sb * sb - 2) * cb * cg
    )
    square = m * rho * rho * sb * cb
    drag = mu * m * g * rho * rho * sb * sb
    h = [e * Omega * sb * cg / rho]
    for n in range(1, ORDER):
        change = -Omega * cb * h[n - 1].by("gamma")
        force = linear * h[n - 1] + (free if n == 1 else 0)
        for i in range(n):
            change = change + h[n - 1 - i] * h[i].by("beta")
            force = force + square * h[i] * h[n - 1 - i]
        h.append((force - M * change) / drag)
    found = {}
    total, by_beta, by_gamma = 0.0, 0.0, 0.0
    at = {
        name: s.c[0, 0]
        for name, s in (("M", M), ("free", free), ("lin", linear), ("sq", square), ("drag", drag))
    }
    for n, term in enumerate(h):
        found[f"h_{n}"] = term.c[0, 0]
        total += eps**n * term.c[0, 0]
        by_beta += eps**n * term.c[1, 0]
        by_gamma += eps**n * term.c[0, 1]
        right = eps * (at["free"] + at["lin"] * total + at["sq"] * total**2) - at["drag"] * (
            total - h[0].c[0, 0]
        )
        left = eps * (by_beta * total - by_gamma * Omega * math.cos(beta))
        found[f"residual_{n}"] = left - right / at["M"]
    return found
