"""The tippedisk: answers to a sheet of questions, with NumPy alone.

All ten levels and both friction laws are covered.

    python client.py SHEET.csv ANSWERS.csv

Every function works on arrays over entries: p is the tuple (r, e, m, A, B, g, mu, epsilon) of such
arrays. `smooth` is True for the smooth friction law, False for the linear one, for all entries.
Units are SI, angles in rad. KINDS at the end names the function that answers each kind of question.
"""

import csv
import sys
from math import factorial

import numpy as np
from numpy import abs, cos, hypot, log, pi, sin, sqrt

# ---- the equations of motion ----


def equations(p, Omega, smooth, beta, gamma, v):
    """Return the terms of the equations of motion at a state: M, h, f_G, w_y, gamma_y, lambda_Ty,
    gamma', v', Bbar and the terms of h.
    """
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
    gamma_y = rho * v * sin(beta) - e * Omega * sin(beta) ** 2 * cos(gamma)
    normal_force = m * g
    if smooth:
        lambda_Ty = -mu * normal_force * gamma_y / (abs(gamma_y) + epsilon)
    else:
        lambda_Ty = -mu * normal_force / epsilon * gamma_y
    gamma_rate = -Omega * cos(beta)
    force = h + f_G + w_y * lambda_Ty
    v_rate = force / M
    terms = Bbar, h_1, h_2, h_3, h_4, h_5
    return M, h, f_G, w_y, gamma_y, lambda_Ty, gamma_rate, v_rate, *terms


def quotient_rate(dforce, dM, M, v_rate):
    """Return the derivative of v' = force / M, from the derivatives of force and M."""
    return (dforce - dM * v_rate) / M


def derivatives(p, Omega, smooth, beta, gamma, v):
    """Return the partial derivatives of v' with respect to beta, gamma, v and Omega, and v'."""
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    rho = r + e * sin(gamma)
    drho_dgamma = e * cos(gamma)
    M, h, f_G, w_y, gamma_y, lambda_Ty, gamma_rate, v_rate, *_ = equations(
        p, Omega, smooth, beta, gamma, v
    )
    dM_dbeta = -2 * m * rho**2 * sin(beta) * cos(beta)
    dM_dgamma = (
        2 * (Bbar - A) * sin(gamma) * cos(gamma) + 2 * m * rho * drho_dgamma * cos(beta) ** 2
    )
    dh_dbeta = (
        (A * cos(gamma) ** 2 + Bbar * sin(gamma) ** 2)
        * Omega**2
        * (cos(beta) ** 2 - sin(beta) ** 2)
        + 2 * (A - Bbar) * Omega * v * sin(beta) * sin(gamma) * cos(gamma)
        + m * rho**2 * v**2 * (cos(beta) ** 2 - sin(beta) ** 2)
        + m
        * e
        * rho
        * Omega**2
        * (cos(beta) ** 4 - 3 * sin(beta) ** 2 * cos(beta) ** 2)
        * sin(gamma)
        - m
        * e
        * rho
        * (6 * cos(beta) ** 2 - 3 * sin(beta) ** 2 + 2)
        * sin(beta)
        * Omega
        * v
        * cos(gamma)
    )
    dh_dgamma = (
        2 * (Bbar - A) * sin(gamma) * cos(gamma) * Omega**2 * sin(beta) * cos(beta)
        - 2 * (A - Bbar) * Omega * v * cos(beta) * (cos(gamma) ** 2 - sin(gamma) ** 2)
        + 2 * m * rho * drho_dgamma * v**2 * sin(beta) * cos(beta)
        + m
        * e
        * Omega**2
        * sin(beta)
        * cos(beta) ** 3
        * (drho_dgamma * sin(gamma) + rho * cos(gamma))
        - m * e * drho_dgamma * (3 * sin(beta) ** 2 - 2) * Omega * v * cos(beta) * cos(gamma)
        + m * e * rho * (3 * sin(beta) ** 2 - 2) * Omega * v * cos(beta) * sin(gamma)
    )
    dh_dv = (
        -2 * (A - Bbar) * Omega * cos(beta) * sin(gamma) * cos(gamma)
        + 2 * m * rho**2 * v * sin(beta) * cos(beta)
        - m * e * rho * (3 * sin(beta) ** 2 - 2) * Omega * cos(beta) * cos(gamma)
    )
    dh_domega = (
        2 * (A * cos(gamma) ** 2 + Bbar * sin(gamma) ** 2) * Omega * sin(beta) * cos(beta)
        - 2 * (A - Bbar) * v * cos(beta) * sin(gamma) * cos(gamma)
        + 2 * m * e * rho * Omega * sin(beta) * cos(beta) ** 3 * sin(gamma)
        - m * e * rho * (3 * sin(beta) ** 2 - 2) * v * cos(beta) * cos(gamma)
    )
    df_G_dbeta = m * g * rho * sin(beta)
    df_G_dgamma = -m * g * drho_dgamma * cos(beta)
    dw_y_dbeta = rho * cos(beta)
    dw_y_dgamma = drho_dgamma * sin(beta)
    dgamma_y_dbeta = rho * v * cos(beta) - 2 * e * Omega * sin(beta) * cos(beta) * cos(gamma)
    dgamma_y_dgamma = drho_dgamma * v * sin(beta) + e * Omega * sin(beta) ** 2 * sin(gamma)
    dgamma_y_dv = rho * sin(beta)
    dgamma_y_domega = -e * sin(beta) ** 2 * cos(gamma)
    if smooth:
        dlambda_dgamma_y = -mu * m * g * epsilon / (abs(gamma_y) + epsilon) ** 2
    else:
        dlambda_dgamma_y = -mu * m * g / epsilon
    dforce_dbeta = (
        dh_dbeta + df_G_dbeta + dw_y_dbeta * lambda_Ty + w_y * dlambda_dgamma_y * dgamma_y_dbeta
    )
    dforce_dgamma = (
        dh_dgamma + df_G_dgamma + dw_y_dgamma * lambda_Ty + w_y * dlambda_dgamma_y * dgamma_y_dgamma
    )
    dforce_dv = dh_dv + w_y * dlambda_dgamma_y * dgamma_y_dv
    dforce_domega = dh_domega + w_y * dlambda_dgamma_y * dgamma_y_domega
    dv_rate_dbeta = quotient_rate(dforce_dbeta, dM_dbeta, M, v_rate)
    dv_rate_dgamma = quotient_rate(dforce_dgamma, dM_dgamma, M, v_rate)
    dv_rate_dv = dforce_dv / M
    dv_rate_domega = dforce_domega / M
    return dv_rate_dbeta, dv_rate_dgamma, dv_rate_dv, dv_rate_domega, v_rate


def rhs(p, smooth, inputs, quantities):
    """Answer the questions of level 1: the terms of the equations at a state, and the derivatives
    of v'.
    """
    Omega, beta, gamma, v = inputs["Omega"], inputs["beta"], inputs["gamma"], inputs["v"]
    names = "M", "h", "f_G", "w_y", "gamma_y", "lambda_Ty", "gamma_rate", "v_rate"
    names += "Bbar", "h_1", "h_2", "h_3", "h_4", "h_5"  # optional
    names += "dv_rate_dbeta", "dv_rate_dgamma", "dv_rate_dv"
    values = (
        equations(p, Omega, smooth, beta, gamma, v)
        + derivatives(p, Omega, smooth, beta, gamma, v)[:3]
    )
    return dict(zip(names, values))


# ---- equilibria and the Hopf point ----


def linearisation(p, Omega, side):
    """Return the matrices (n, 3, 3) of the linearised motion at beta = pi/2, gamma = side pi/2.

    Side 1 is inverted spinning, side -1 noninverted spinning.
    """
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    rho = r + side * e
    A_31 = m * g / Bbar * rho - Omega**2
    A_32 = -mu * m * g / (epsilon * Bbar) * side * e * rho * Omega
    A_33 = -mu * m * g / (epsilon * Bbar) * rho**2
    matrix = np.zeros((len(r), 3, 3))
    matrix[:, 0, 2] = 1
    matrix[:, 1, 0] = Omega
    matrix[:, 2, 0] = A_31
    matrix[:, 2, 1] = A_32
    matrix[:, 2, 2] = A_33
    return matrix


def sorted_eigenvalues(matrix):
    """Return eigenvalues (n, 3) by descending real part, then by descending imaginary part."""
    eigenvalues = np.linalg.eigvals(matrix).astype(complex)
    order = np.lexsort((-eigenvalues.imag, -eigenvalues.real), axis=-1)
    return np.take_along_axis(eigenvalues, order, axis=-1)


def equilibrium(p, smooth, inputs, quantities):
    """Answer the questions of level 2: the eigenvalues of inverted and of noninverted spinning."""
    side = np.where(inputs["equilibrium"] == "inverted", 1, -1)
    eigenvalues = sorted_eigenvalues(linearisation(p, inputs["Omega"], side))
    answers = {}
    for n in (1, 2, 3):
        answers[f"lambda_{n}_re"] = eigenvalues[:, n - 1].real
        answers[f"lambda_{n}_im"] = eigenvalues[:, n - 1].imag
    return answers


def critical_speed(p):
    """Return Omega_crit, where a pair of eigenvalues of inverted spinning is imaginary."""
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    return sqrt((r + e) ** 2 / r * m * g / Bbar)


def hopf_eigenvectors(p, Omega, omega):
    """Return the eigenvector q of the linearised motion to the eigenvalue i omega, and the adjoint.

    q| = 1, and the adjoint p_star has p_star q = 1.
    """
    A_31, A_32, A_33 = linearisation(p, Omega, 1)[:, 2].T
    q = np.array([1j * omega, Omega, -(omega**2)])
    q = q / sqrt(sum(abs(q) ** 2))
    p_star = np.array([1j * omega * (1j * omega - A_33), A_32, 1j * omega])
    p_star = p_star / sum(p_star * q)
    return q, p_star


def triple(q_1, q_2, q_3):
    """Return the contribution of a product of three variables, with the entries q_1, q_2, q_3 of a
    vector q, to the cubic form C(q, q, conj(q)).
    """
    return 2 * (q_1 * q_2 * q_3.conj() + q_1 * q_2.conj() * q_3 + q_1.conj() * q_2 * q_3)


def cubic_terms(p, Omega, q):
    """Return the cubic terms C(q, q, conj(q)) of gamma' and of v' about inverted spinning, for a
    complex vector q.

    Both rates have no terms of second order there.
    """
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    rho = r + e
    k = mu * m * g / epsilon
    A_31, A_32, A_33 = linearisation(p, Omega, 1)[:, 2].T
    bbb = 2 / 3 * Bbar * Omega**2 - m * e * rho * Omega**2 - m * g * rho / 6 - m * rho**2 * A_31
    bbc = 3 / 2 * k * e * rho * Omega - m * rho**2 * A_32
    bbv = k * rho**2 - m * rho**2 * A_33
    bcc = -(A - Bbar) * Omega**2 - m * g * e / 2 - (A - Bbar) * A_31
    bcv = -2 * (A - Bbar) * Omega - m * e * rho * Omega
    bvv = -m * rho**2
    ccc = k * e * Omega * (rho / 6 + e / 2) - (A - Bbar) * A_32
    ccv = k * e * rho - (A - Bbar) * A_33
    q_b, q_c, q_v = q
    cubic_gamma = -Omega / 6 * triple(q_b, q_b, q_b)
    cubic_v = (
        bbb * triple(q_b, q_b, q_b)
        + bbc * triple(q_b, q_b, q_c)
        + bbv * triple(q_b, q_b, q_v)
        + bcc * triple(q_b, q_c, q_c)
        + bcv * triple(q_b, q_c, q_v)
        + bvv * triple(q_b, q_v, q_v)
        + ccc * triple(q_c, q_c, q_c)
        + ccv * triple(q_c, q_c, q_v)
    ) / Bbar
    return cubic_gamma, cubic_v


def eigenvalue_rate(p, Omega, q, p_star):
    """Return d(lambda)/dOmega of the critical eigenvalues, from the matrix's derivative with
    respect to Omega.
    """
    A_32 = linearisation(p, Omega, 1)[:, 2, 1]
    dA_21 = 1
    dA_31 = -2 * Omega
    dA_32 = A_32 / Omega
    return p_star[1] * dA_21 * q[0] + p_star[2] * (dA_31 * q[0] + dA_32 * q[1])


def hopf(p, smooth, inputs, quantities):
    """Answer the questions of level 3: the Hopf point, its normal form, and the slopes of the
    family of cycles.
    """
    r, e, m, A, B, g, mu, epsilon = p
    Omega = critical_speed(p)
    omega = sqrt(e / (r + e)) * Omega
    q, p_star = hopf_eigenvectors(p, Omega, omega)
    cubic_gamma, cubic_v = cubic_terms(p, Omega, q)
    c_1 = (p_star[1] * cubic_gamma + p_star[2] * cubic_v) / 2
    dlambda = eigenvalue_rate(p, Omega, q, p_star)
    # On the cycles |z|^2 = z_squared_slope (Omega_crit - Omega), and beta - pi/2 = 2 Re(z q_b).
    z_squared_slope = dlambda.real / c_1.real
    frequency_slope = c_1.imag * z_squared_slope - dlambda.imag
    return {
        "omega_crit": Omega,
        "period": 2 * pi / omega,
        "first_lyapunov_coefficient": c_1.real / omega,
        "transversality": dlambda.real,
        "amplitude_squared_slope": 4 * abs(q[0]) ** 2 * z_squared_slope,
        "period_slope": -2 * pi / omega**2 * frequency_slope,
    }


# ---- the one-harmonic law ----


def one_harmonic_law(p, Omega, form):
    """Return amplitude C and frequency omega of the one-harmonic law, in its printed or its
    consistent form.
    """
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    stiffness = np.where(form == "printed", r - e, r)
    added = np.where(form == "printed", 0, e**2)
    chi = A * (r - 2 * e) - Bbar * (2 * r**2 + e * (r + e) - added) / (2 * (r + e))
    delta = -1 / 8 * Omega**2 * stiffness / (r + e)
    excess = Bbar * r * Omega**2 - m * g * (r + e) ** 2
    C = sqrt(-4 * e / (r + e) * excess / (chi * Omega**2 + m * g * e * (r + e)))
    omega = sqrt(e * Omega**2 / (r + e) + delta * C**2)
    return C, omega


def harmonic_balance(p, smooth, inputs, quantities):
    """Answer the questions of level 4: amplitude, frequency and period of the one-harmonic law."""
    C, omega = one_harmonic_law(p, inputs["Omega"], inputs["form"])
    return {"amplitude": C, "frequency": omega, "period": 2 * pi / omega}


# ---- the slow manifold, by series: coefficient [i, j], i + j < size, belongs to beta^i gamma^j ----


def series_product(*factors):
    """Return the product of truncated power series in beta and gamma."""
    product = factors[0]
    for factor in factors[1:]:
        partial = np.zeros_like(product)
        size = len(product)
        for i in range(size):
            for j in range(size - i):
                partial[i:, j:] += product[i, j] * factor[: size - i, : size - j]
        product = partial
    return product


def series_quotient(numerator, denominator):
    """Return the quotient of truncated power series in beta and gamma, by long division."""
    quotient = np.zeros_like(numerator)
    remainder = numerator.copy()
    size = len(numerator)
    for i in range(size):
        for j in range(size - i):
            quotient[i, j] = remainder[i, j] / denominator[0, 0]
            remainder[i:, j:] -= quotient[i, j] * denominator[: size - i, : size - j]
    return quotient


def series_in(variable, coefficients):
    """Convert the coefficients of a series in beta (variable 0) or gamma (variable 1) alone to a
    series in both.
    """
    series = np.zeros((len(coefficients),) + coefficients.shape)
    if variable == 0:
        series[:, 0] = coefficients
    else:
        series[0, :] = coefficients
    return series


def series_sine(angle, size):
    return np.array([sin(angle + k * pi / 2) / factorial(k) for k in range(size)])


def series_cosine(angle, size):
    return np.array([cos(angle + k * pi / 2) / factorial(k) for k in range(size)])


def derivative_beta(series):
    """Return the derivative of a power series with respect to beta; the highest order is lost."""
    derivative = np.zeros_like(series)
    for i in range(1, len(series)):
        derivative[i - 1, :] = i * series[i, :]
    return derivative


def derivative_gamma(series):
    """Return the derivative of a power series with respect to gamma; the highest order is lost."""
    derivative = np.zeros_like(series)
    for j in range(1, len(series)):
        derivative[:, j - 1] = j * series[:, j]
    return derivative


def manifold_terms(p, Omega, beta, gamma, size):
    """Return the series in beta and gamma of the terms of the equation of motion of v.

    The equation is M v' = free + linear v + square v^2 - drag (v - h_0) / epsilon. The last series
    returned is cos(beta).
    """
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    sin_beta = series_in(0, series_sine(beta, size))
    cos_beta = series_in(0, series_cosine(beta, size))
    sin_gamma = series_in(1, series_sine(gamma, size))
    cos_gamma = series_in(1, series_cosine(gamma, size))
    radius = np.zeros_like(sin_beta)
    radius[0, 0] = r
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
    w_y = series_product(rho, sin_beta)
    drag = mu * m * g * series_product(w_y, w_y)
    h_0 = e * Omega * series_quotient(series_product(sin_beta, cos_gamma), rho)
    return M, free, linear, square, drag, h_0, cos_beta


def slow_manifold_orders(p, Omega, beta, gamma, last):
    """Return the series in beta and gamma of the slow manifold's orders h_0 ... h_last.

    The order epsilon^n of the invariance equation gives h_n.
    """
    M, free, linear, square, drag, h_0, cos_beta = manifold_terms(p, Omega, beta, gamma, last + 2)
    h = [h_0]
    for n in range(1, last + 1):
        squares = sum(series_product(h[i], h[n - 1 - i]) for i in range(n))
        transport_beta = sum(series_product(h[i], derivative_beta(h[n - 1 - i])) for i in range(n))
        transport_gamma = -Omega * series_product(derivative_gamma(h[n - 1]), cos_beta)
        force = series_product(linear, h[n - 1]) + series_product(square, squares)
        if n == 1:
            force = force + free
        transport = series_product(M, transport_beta + transport_gamma)
        h.append(series_quotient(force - transport, drag))
    return h


def invariance_residual(p, Omega, beta, gamma, h):
    """Return the residual of the slow manifold's invariance equation, from the series of its orders
    h.
    """
    epsilon = p[7]
    series = manifold_terms(p, Omega, beta, gamma, 1)
    M, free, linear, square, drag, h_0, cos_beta = [one[0, 0] for one in series]
    v, dv_dbeta, dv_dgamma = 0, 0, 0
    for n in range(len(h)):
        v = v + epsilon**n * h[n][0, 0]
        dv_dbeta = dv_dbeta + epsilon**n * h[n][1, 0]
        dv_dgamma = dv_dgamma + epsilon**n * h[n][0, 1]
    transport = dv_dbeta * v - dv_dgamma * Omega * cos(beta)
    force = free + linear * v + square * v**2 - drag * (v - h_0) / epsilon
    return epsilon * (transport - force / M)


def slow_manifold(p, smooth, inputs, quantities):
    """Answer the questions of level 5: the orders of the slow manifold and their residuals."""
    Omega, beta, gamma = inputs["Omega"], inputs["beta"], inputs["gamma"]
    last = max(int(name.rsplit("_", 1)[1]) for name in quantities)
    h = slow_manifold_orders(p, Omega, beta, gamma, last)
    answers = {}
    for n in range(last + 1):
        answers[f"h_{n}"] = h[n][0, 0]
        answers[f"residual_{n}"] = invariance_residual(p, Omega, beta, gamma, h[: n + 1])
    return answers
