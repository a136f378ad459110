"""Other right ways of writing functions of the specimen: a mistake in a program that has it so is one change in them.

Each is held against the specimen in the tests. It is no mistake itself, and nothing is said of it.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from tippedisk_verify.conformance.diagnosis.specimen import Specimen, specimen

__all__ = ["ways"]

_TINY = 1e-20

_COMPLEX_STEPS = """
def derivatives(p, Omega, smooth, beta, gamma, v):
    step = 1e-30
    dv_rate_dbeta = equations(p, Omega, smooth, beta + 1j * step, gamma, v)[7].imag / step
    dv_rate_dgamma = equations(p, Omega, smooth, beta, gamma + 1j * step, v)[7].imag / step
    dv_rate_dv = equations(p, Omega, smooth, beta, gamma, v + 1j * step)[7].imag / step
    dv_rate_domega = equations(p, Omega + 1j * step, smooth, beta, gamma, v)[7].imag / step
    v_rate = equations(p, Omega, smooth, beta, gamma, v)[7]
    return dv_rate_dbeta, dv_rate_dgamma, dv_rate_dv, dv_rate_domega, v_rate
"""
_GENERAL_STATE = """
def linearisation(p, Omega, side):
    beta = pi / 2 + 0 * Omega
    gamma = side * pi / 2 + 0 * Omega
    v = 0 * Omega
    A_31, A_32, A_33, dv_rate_domega, v_rate = derivatives(p, Omega, False, beta, gamma, v)
    matrix = np.zeros((len(p[0]), 3, 3))
    matrix[:, 0, 2] = 1
    matrix[:, 1, 0] = Omega * sin(beta)
    matrix[:, 2, 0] = A_31
    matrix[:, 2, 1] = A_32
    matrix[:, 2, 2] = A_33
    return matrix
"""
_ONE_LAW = """
def one_harmonic_law(p, Omega, form):
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    chi_printed = A * (r - 2 * e) - Bbar * (2 * r**2 + e * (r + e)) / (2 * (r + e))
    chi = chi_printed + np.where(form == "printed", 0, Bbar * e**2 / (2 * (r + e)))
    stiffness = np.where(form == "printed", r - e, r)
    delta = -1 / 8 * Omega**2 * stiffness / (r + e)
    numerator = Bbar * r * Omega**2 - m * g * (r + e) ** 2
    denominator = chi * Omega**2 + m * g * e * (r + e)
    C = sqrt(-4 * e / (r + e) * numerator / denominator)
    omega = sqrt(e / (r + e) * Omega**2 + delta * C**2)
    return C, omega
"""
_ONE_FRACTION = """
def one_harmonic_law(p, Omega, form):
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    added = np.where(form == "printed", 0, e**2)
    chi = A * (r - 2 * e) - Bbar * (2 * r**2 + e * (r + e) - added) / (2 * (r + e))
    stiffness = np.where(form == "printed", r - e, r)
    numerator = Bbar * r * Omega**2 - m * g * (r + e) ** 2
    denominator = chi * Omega**2 + m * g * e * (r + e)
    C = sqrt(-4 * e / (r + e) * numerator / denominator)
    omega = Omega * sqrt(e / (r + e) - stiffness / (r + e) * C**2 / 8)
    return C, omega
"""
_NAMED_TERMS = """
def equations(p, Omega, smooth, beta, gamma, v):
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    rho = r + e * sin(gamma)
    inertia = A * cos(gamma) ** 2 + Bbar * sin(gamma) ** 2
    M = inertia + m * rho**2 * cos(beta) ** 2
    h_1 = inertia * Omega**2 * sin(beta) * cos(beta)
    h_2 = -2 * (A - Bbar) * Omega * v * cos(beta) * sin(gamma) * cos(gamma)
    h_3 = m * rho**2 * v**2 * sin(beta) * cos(beta)
    h_4 = m * e * rho * Omega**2 * sin(beta) * cos(beta) ** 3 * sin(gamma)
    h_5 = -m * e * rho * (3 * sin(beta) ** 2 - 2) * Omega * v * cos(beta) * cos(gamma)
    h = h_1 + h_2 + h_3 + h_4 + h_5
    f_G = -m * g * rho * cos(beta)
    w_y = rho * sin(beta)
    gamma_y = w_y * v - e * Omega * sin(beta) ** 2 * cos(gamma)
    normal_force = m * g
    if smooth:
        lambda_Ty = -mu * normal_force * gamma_y / (abs(gamma_y) + epsilon)
    else:
        lambda_Ty = -mu * normal_force * gamma_y / epsilon
    gamma_rate = -Omega * cos(beta)
    force = h + f_G + w_y * lambda_Ty
    v_rate = force / M
    return M, h, f_G, w_y, gamma_y, lambda_Ty, gamma_rate, v_rate
"""
_SOLVER = """
def hopf_eigenvectors(p, Omega, omega):
    matrix = linearisation(p, Omega, 1)
    eigenvalues, right = np.linalg.eig(matrix)
    pair = np.argmax(eigenvalues.imag, axis=-1)
    q = np.array([right[k, :, pair[k]] for k in range(len(pair))]).T
    q = q / sqrt(sum(abs(q) ** 2)) * abs(q[1]) / q[1]
    eigenvalues, left = np.linalg.eig(np.swapaxes(matrix, 1, 2))
    pair = np.argmax(eigenvalues.imag, axis=-1)
    p_star = np.array([left[k, :, pair[k]] for k in range(len(pair))]).T
    p_star = p_star / sum(p_star * q)
    return q, p_star

def pair_frequency(p, Omega):
    eigenvalues = np.linalg.eigvals(linearisation(p, Omega, 1))
    return np.max(eigenvalues.imag, axis=-1)
"""
_POLARISED = """
def third_derivative(p, Omega, u):
    circle = 0.05 * np.exp(2j * pi * np.arange(16) / 16)
    weight = 6 / (16 * circle**3)
    gamma_rates, v_rates = 0, 0
    for k in range(16):
        beta = pi / 2 + circle[k] * u[0]
        gamma = pi / 2 + circle[k] * u[1]
        v = circle[k] * u[2]
        rates = equations(p, Omega, False, beta, gamma, v)
        gamma_rates = gamma_rates + weight[k] * rates[6]
        v_rates = v_rates + weight[k] * rates[7]
    return np.array([gamma_rates, v_rates])

def cubic_terms(p, Omega, q):
    plus = third_derivative(p, Omega, q + q.conj())
    minus = third_derivative(p, Omega, q - q.conj())
    conjugate = third_derivative(p, Omega, q.conj())
    cubic = (plus - minus - 2 * conjugate) / 6
    return cubic[0], cubic[1]
"""
_SHARED_FORCES = """
def manifold_forces(p, Omega, beta, gamma, size):
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    sin_beta = series_in(0, series_sine(beta, size))
    cos_beta = series_in(0, series_cosine(beta, size))
    sin_gamma = series_in(1, series_sine(gamma, size))
    cos_gamma = series_in(1, series_cosine(gamma, size))
    radius, mass = np.zeros_like(sin_beta), np.zeros_like(sin_beta)
    radius[0, 0] = r
    mass[0, 0] = Bbar
    rho = radius + e * sin_gamma
    rho_squared = series_product(rho, rho)
    inertia = A * series_product(cos_gamma, cos_gamma) + Bbar * series_product(sin_gamma, sin_gamma)
    M = inertia + m * series_product(rho_squared, cos_beta, cos_beta)
    gyroscopic = Omega**2 * series_product(inertia, sin_beta, cos_beta)
    cos_beta_cubed = series_product(cos_beta, cos_beta, cos_beta)
    eccentric = m * e * Omega**2 * series_product(rho, sin_beta, cos_beta_cubed, sin_gamma)
    gravity = -m * g * series_product(rho, cos_beta)
    free = gyroscopic + eccentric + gravity
    three_sines = 3 * series_product(sin_beta, sin_beta)
    three_sines[0, 0] -= 2
    linear_1 = -2 * (A - Bbar) * Omega * series_product(cos_beta, sin_gamma, cos_gamma)
    linear_2 = -m * e * Omega * series_product(rho, three_sines, cos_beta, cos_gamma)
    linear = linear_1 + linear_2
    square = m * series_product(rho_squared, sin_beta, cos_beta)
    drag = mu * m * g * series_product(rho_squared, sin_beta, sin_beta)
    h_0 = e * Omega * series_quotient(series_product(sin_beta, cos_gamma), rho)
    return M, mass, free, linear, square, drag, h_0, cos_beta

def slow_manifold_orders(p, Omega, beta, gamma, last):
    M, mass, free, linear, square, drag, h_0, cos_beta = manifold_forces(p, Omega, beta, gamma, last + 2)
    h = [h_0]
    for n in range(1, last + 1):
        change = -Omega * series_product(cos_beta, derivative_gamma(h[n - 1]))
        force = series_product(linear, h[n - 1])
        if n == 1:
            force = force + free
        for i in range(n):
            change = change + series_product(h[i], derivative_beta(h[n - 1 - i]))
            force = force + series_product(square, h[i], h[n - 1 - i])
        h.append(series_quotient(force - series_product(M, change), drag))
    return h

def invariance_residual(p, Omega, beta, gamma, h):
    epsilon = p[7]
    series = manifold_forces(p, Omega, beta, gamma, 1)
    M, mass, free, linear, square, drag, h_0, cos_beta = [one[0, 0] for one in series]
    v, dv_dbeta, dv_dgamma = 0, 0, 0
    for n in range(len(h)):
        v = v + epsilon**n * h[n][0, 0]
        dv_dbeta = dv_dbeta + epsilon**n * h[n][1, 0]
        dv_dgamma = dv_dgamma + epsilon**n * h[n][0, 1]
    force = epsilon * (free + linear * v + square * v**2) - drag * (v - h_0)
    return epsilon * (dv_dbeta * v - dv_dgamma * Omega * cos_beta) - force / M
"""
_ROOTS_OF_MODULI = """
def sqrt(x):
    return np.sqrt(abs(x))
"""
_QUOTIENT_RULE = """
def quotient_rate(dforce, dM, M, v_rate):
    return (dforce - dM * v_rate) / M
"""


def _analytic(x: object) -> object:
    """The modulus of a real number, carried on for the imaginary parts of complex steps."""
    x = np.asarray(x)
    if np.iscomplexobj(x) and np.all(np.abs(x.imag) < _TINY):
        return np.where(x.real < 0, -x, x)
    return np.abs(x)


@cache
def ways() -> tuple[Specimen, ...]:
    """The specimen as it is, and in other ways."""
    plain = specimen()
    hopf = plain.text("hopf").replace("sqrt(e / (r + e)) * Omega", "pair_frequency(p, Omega)")
    quotients = plain.text("derivatives")
    for name in ("beta", "gamma"):
        old = f"(dforce_d{name} - dM_d{name} * v_rate) / M"
        quotients = quotients.replace(old, f"quotient_rate(dforce_d{name}, dM_d{name}, M, v_rate)")
    old = "-mu * m * g * epsilon / (abs(gamma_y) + epsilon) ** 2"
    new = "-mu * m * g * (1 / (abs(gamma_y) + epsilon) - abs(gamma_y) / (abs(gamma_y) + epsilon) ** 2)"
    pair = "def pair_frequency(p, Omega):\n    return sqrt(-linearisation(p, Omega, 1)[:, 2, 0])\n"
    steps = plain.patched("complex steps", _COMPLEX_STEPS, abs=_analytic)
    general = plain.patched("general state", _GENERAL_STATE + plain.text("derivatives"))
    return (
        plain,
        plain.patched("shared forces", _SHARED_FORCES),
        steps,
        steps.patched("named terms, complex steps", _NAMED_TERMS),
        plain.patched("named terms", _NAMED_TERMS),
        general,
        steps.patched("general state, complex steps", _GENERAL_STATE + plain.text("equations")),
        plain.patched("frequency of the matrix", hopf + pair),
        plain.patched("eigenvectors of a solver", hopf + _SOLVER),
        plain.patched("polarised cubic terms", hopf + _SOLVER + _POLARISED),
        plain.patched("one law", _ONE_LAW),
        plain.patched("one law, one fraction", _ONE_FRACTION),
        plain.patched("one law, roots of moduli", _ONE_LAW + _ROOTS_OF_MODULI),
        plain.patched(
            "period written out",
            plain.text("hopf").replace("2 * pi / omega,", "2 * pi / (sqrt(e / (r + e)) * Omega),"),
        ),
        plain.patched("quotient rule", quotients.replace(old, new) + _QUOTIENT_RULE),
    )
