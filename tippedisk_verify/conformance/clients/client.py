"""The tippedisk: answers to a sheet of questions, all ten levels and both friction laws, with NumPy alone.

    python client.py SHEET.csv ANSWERS.csv

Every function works on arrays over entries: p is the tuple (r, e, m, A, B, g, mu, epsilon) of such arrays,
and `smooth` says which friction law all of them have. Units are SI, angles in rad. KINDS at the end names
the function that answers each kind of question.
"""

import csv
import sys
from math import factorial

import numpy as np
from numpy import abs, cos, hypot, log, pi, sin, sqrt

# ---- the equations of motion ----


def equations(p, Omega, smooth, beta, gamma, v):
    """M, h, f_G, w_y, gamma_y, lambda_Ty, gamma' and v' at a state."""
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    rho = r + e * sin(gamma)
    M = A * cos(gamma) ** 2 + Bbar * sin(gamma) ** 2 + m * rho**2 * cos(beta) ** 2
    h = (
        (A * cos(gamma) ** 2 + Bbar * sin(gamma) ** 2) * Omega**2 * sin(beta) * cos(beta)
        - 2 * (A - Bbar) * Omega * v * cos(beta) * sin(gamma) * cos(gamma)
        + m * rho**2 * v**2 * sin(beta) * cos(beta)
        + m * e * rho * Omega**2 * sin(beta) * cos(beta) ** 3 * sin(gamma)
        - m * e * rho * (3 * sin(beta) ** 2 - 2) * Omega * v * cos(beta) * cos(gamma)
    )
    f_G = -m * g * rho * cos(beta)
    w_y = rho * sin(beta)
    gamma_y = rho * v * sin(beta) - e * Omega * sin(beta) ** 2 * cos(gamma)
    if smooth:
        lambda_Ty = -mu * m * g * gamma_y / (abs(gamma_y) + epsilon)
    else:
        lambda_Ty = -mu * m * g / epsilon * gamma_y
    gamma_rate = -Omega * cos(beta)
    v_rate = (h + f_G + w_y * lambda_Ty) / M
    return M, h, f_G, w_y, gamma_y, lambda_Ty, gamma_rate, v_rate


def derivatives(p, Omega, smooth, beta, gamma, v):
    """The partial derivatives of v' by beta, gamma, v and Omega, in closed form, and v' itself."""
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    rho = r + e * sin(gamma)
    drho_dgamma = e * cos(gamma)
    M, h, f_G, w_y, gamma_y, lambda_Ty, gamma_rate, v_rate = equations(p, Omega, smooth, beta, gamma, v)
    dM_dbeta = -2 * m * rho**2 * sin(beta) * cos(beta)
    dM_dgamma = 2 * (Bbar - A) * sin(gamma) * cos(gamma) + 2 * m * rho * drho_dgamma * cos(beta) ** 2
    dh_dbeta = (
        (A * cos(gamma) ** 2 + Bbar * sin(gamma) ** 2) * Omega**2 * (cos(beta) ** 2 - sin(beta) ** 2)
        + 2 * (A - Bbar) * Omega * v * sin(beta) * sin(gamma) * cos(gamma)
        + m * rho**2 * v**2 * (cos(beta) ** 2 - sin(beta) ** 2)
        + m * e * rho * Omega**2 * (cos(beta) ** 4 - 3 * sin(beta) ** 2 * cos(beta) ** 2) * sin(gamma)
        - m * e * rho * (6 * cos(beta) ** 2 - 3 * sin(beta) ** 2 + 2) * sin(beta) * Omega * v * cos(gamma)
    )
    dh_dgamma = (
        2 * (Bbar - A) * sin(gamma) * cos(gamma) * Omega**2 * sin(beta) * cos(beta)
        - 2 * (A - Bbar) * Omega * v * cos(beta) * (cos(gamma) ** 2 - sin(gamma) ** 2)
        + 2 * m * rho * drho_dgamma * v**2 * sin(beta) * cos(beta)
        + m * e * Omega**2 * sin(beta) * cos(beta) ** 3 * (drho_dgamma * sin(gamma) + rho * cos(gamma))
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
    dlambda_dbeta = dlambda_dgamma_y * dgamma_y_dbeta
    dlambda_dgamma = dlambda_dgamma_y * dgamma_y_dgamma
    dlambda_dv = dlambda_dgamma_y * dgamma_y_dv
    dlambda_domega = dlambda_dgamma_y * dgamma_y_domega
    dforce_dbeta = dh_dbeta + df_G_dbeta + dw_y_dbeta * lambda_Ty + w_y * dlambda_dbeta
    dforce_dgamma = dh_dgamma + df_G_dgamma + dw_y_dgamma * lambda_Ty + w_y * dlambda_dgamma
    dforce_dv = dh_dv + w_y * dlambda_dv
    dforce_domega = dh_domega + w_y * dlambda_domega
    dv_rate_dbeta = (dforce_dbeta - dM_dbeta * v_rate) / M
    dv_rate_dgamma = (dforce_dgamma - dM_dgamma * v_rate) / M
    dv_rate_dv = dforce_dv / M
    dv_rate_domega = dforce_domega / M
    return dv_rate_dbeta, dv_rate_dgamma, dv_rate_dv, dv_rate_domega, v_rate


def rhs(p, smooth, given, asked):
    """Level 1: the terms of the equations at a state, and the derivatives of v'."""
    Omega, beta, gamma, v = given["Omega"], given["beta"], given["gamma"], given["v"]
    names = "M", "h", "f_G", "w_y", "gamma_y", "lambda_Ty", "gamma_rate", "v_rate"
    answers = dict(zip(names, equations(p, Omega, smooth, beta, gamma, v)))
    names = "dv_rate_dbeta", "dv_rate_dgamma", "dv_rate_dv"
    answers.update(zip(names, derivatives(p, Omega, smooth, beta, gamma, v)))
    return answers


# ---- equilibria and the Hopf point ----


def linearisation(p, Omega, side):
    """The matrix at beta = pi/2, gamma = side pi/2: inverted spinning for side 1, noninverted for side -1."""
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
    """Eigenvalues by descending real part, then by descending imaginary part."""
    eigenvalues = np.linalg.eigvals(matrix).astype(complex)
    order = np.lexsort((-eigenvalues.imag, -eigenvalues.real), axis=-1)
    return np.take_along_axis(eigenvalues, order, axis=-1)


def equilibrium(p, smooth, given, asked):
    """Level 2: the eigenvalues of inverted and of noninverted spinning."""
    side = np.where(given["equilibrium"] == "inverted", 1, -1)
    eigenvalues = sorted_eigenvalues(linearisation(p, given["Omega"], side))
    answers = {}
    for n in (1, 2, 3):
        answers[f"lambda_{n}_re"] = eigenvalues[:, n - 1].real
        answers[f"lambda_{n}_im"] = eigenvalues[:, n - 1].imag
    return answers


def critical_speed(p):
    """Omega_crit, where a pair of eigenvalues of inverted spinning is imaginary."""
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    return sqrt((r + e) ** 2 / r * m * g / Bbar)


def hopf_eigenvectors(p, Omega, omega):
    """The eigenvector q, |q| = 1, of i omega, and the adjoint one p_star, with p_star q = 1."""
    A_31, A_32, A_33 = linearisation(p, Omega, 1)[:, 2].T
    q = np.array([1j * omega, Omega, -(omega**2)])
    q = q / sqrt(sum(abs(q) ** 2))
    p_star = np.array([1j * omega * (1j * omega - A_33), A_32, 1j * omega])
    p_star = p_star / sum(p_star * q)
    return q, p_star


def triple(q_1, q_2, q_3):
    """What the product of three variables gives in C(q, q, conj(q))."""
    return 2 * (q_1 * q_2 * q_3.conj() + q_1 * q_2.conj() * q_3 + q_1.conj() * q_2 * q_3)


def cubic_terms(p, Omega, q):
    """C(q, q, conj(q)) of gamma' and v' about inverted spinning, which have no terms of second order."""
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
    """d(lambda)/dOmega of the pair, from the derivative of the matrix by Omega."""
    A_32 = linearisation(p, Omega, 1)[:, 2, 1]
    dA_21 = 1
    dA_31 = -2 * Omega
    dA_32 = A_32 / Omega
    return p_star[1] * dA_21 * q[0] + p_star[2] * (dA_31 * q[0] + dA_32 * q[1])


def hopf(p, smooth, given, asked):
    """Level 3: the Hopf point, its normal form, and the slopes of the family of cycles that begins there."""
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
    """C and omega of the one-harmonic law, in its printed or its consistent form."""
    r, e, m, A, B, g, mu, epsilon = p
    Bbar = B - m * e**2
    chi_printed = A * (r - 2 * e) - Bbar * (2 * r**2 + e * (r + e)) / (2 * (r + e))
    chi_consistent = A * (r - 2 * e) - Bbar * (2 * r**2 + e * (r + e) - e**2) / (2 * (r + e))
    delta_printed = -1 / 8 * (r - e) / (r + e) * Omega**2
    delta_consistent = -1 / 8 * r / (r + e) * Omega**2
    chi = np.where(form == "printed", chi_printed, chi_consistent)
    delta = np.where(form == "printed", delta_printed, delta_consistent)
    excess = Bbar * r * Omega**2 - m * g * (r + e) ** 2
    C = sqrt(-4 * e / (r + e) * excess / (chi * Omega**2 + m * g * e * (r + e)))
    omega = sqrt(e * Omega**2 / (r + e) + delta * C**2)
    return C, omega


def harmonic_balance(p, smooth, given, asked):
    """Level 4: amplitude, frequency and period of the one-harmonic law."""
    C, omega = one_harmonic_law(p, given["Omega"], given["form"])
    return {"amplitude": C, "frequency": omega, "period": 2 * pi / omega}


# ---- the slow manifold, by truncated series: coefficient [i, j] belongs to beta^i gamma^j ----


def series_product(*factors):
    """The product of truncated series."""
    product = factors[0]
    for factor in factors[1:]:
        partial = np.zeros_like(product)
        size = len(product)
        for i in range(size):
            for j in range(size):
                partial[i:, j:] += product[i, j] * factor[: size - i, : size - j]
        product = partial
    return product


def series_quotient(numerator, denominator):
    """The quotient of truncated series, by long division."""
    quotient = np.zeros_like(numerator)
    remainder = numerator.copy()
    size = len(numerator)
    for i in range(size):
        for j in range(size):
            quotient[i, j] = remainder[i, j] / denominator[0, 0]
            remainder[i:, j:] -= quotient[i, j] * denominator[: size - i, : size - j]
    return quotient


def series_in(variable, coefficients):
    """A series in beta (variable 0) or gamma (variable 1) alone, as one in both."""
    series = np.zeros((len(coefficients),) + coefficients.shape)
    if variable == 0:
        series[:, 0] = coefficients
    else:
        series[0, :] = coefficients
    return series


def series_sine(angle, size):
    """The Taylor coefficients of the sine at an angle."""
    cycle = [sin(angle), cos(angle), -sin(angle), -cos(angle)]
    return np.array([cycle[k % 4] / factorial(k) for k in range(size)])


def series_cosine(angle, size):
    """The Taylor coefficients of the cosine at an angle."""
    cycle = [cos(angle), -sin(angle), -cos(angle), sin(angle)]
    return np.array([cycle[k % 4] / factorial(k) for k in range(size)])


def derivative_beta(series):
    """The derivative by beta; the highest order is lost."""
    derivative = np.zeros_like(series)
    for i in range(1, len(series)):
        derivative[i - 1, :] = i * series[i, :]
    return derivative


def derivative_gamma(series):
    """The derivative by gamma; the highest order is lost."""
    derivative = np.zeros_like(series)
    for j in range(1, len(series)):
        derivative[:, j - 1] = j * series[:, j]
    return derivative


def slow_manifold_orders(p, Omega, beta, gamma, last):
    """The series of h_0 ... h_last: epsilon^n in the invariance equation gives h_n."""
    r, e, m, A, B, g, mu, epsilon = p
    size = last + 2
    Bbar = B - m * e**2
    sin_beta = series_in(0, series_sine(beta, size))
    cos_beta = series_in(0, series_cosine(beta, size))
    sin_gamma = series_in(1, series_sine(gamma, size))
    cos_gamma = series_in(1, series_cosine(gamma, size))
    rho = e * sin_gamma
    rho[0, 0] += r
    rho_squared = series_product(rho, rho)
    inertia = A * series_product(cos_gamma, cos_gamma) + Bbar * series_product(sin_gamma, sin_gamma)
    M = inertia + m * series_product(rho_squared, cos_beta, cos_beta)
    # h + f_G = force_0 + force_1 v + force_2 v^2, and -epsilon w_y lambda_Ty = friction_1 v - friction_0.
    force_0 = (
        Omega**2 * series_product(inertia, sin_beta, cos_beta)
        + m * e * Omega**2 * series_product(rho, sin_beta, cos_beta, cos_beta, cos_beta, sin_gamma)
        - m * g * series_product(rho, cos_beta)
    )
    three_sines = 3 * series_product(sin_beta, sin_beta)
    three_sines[0, 0] -= 2
    force_1 = -2 * (A - Bbar) * Omega * series_product(cos_beta, sin_gamma, cos_gamma) - m * e * Omega * series_product(
        rho, three_sines, cos_beta, cos_gamma
    )
    force_2 = m * series_product(rho_squared, sin_beta, cos_beta)
    friction_1 = mu * m * g * series_product(rho_squared, sin_beta, sin_beta)
    h = [e * Omega * series_quotient(series_product(sin_beta, cos_gamma), rho)]
    for n in range(1, last + 1):
        squares = sum(series_product(h[i], h[n - 1 - i]) for i in range(n))
        transport_beta = sum(series_product(derivative_beta(h[i]), h[n - 1 - i]) for i in range(n))
        transport_gamma = -Omega * series_product(derivative_gamma(h[n - 1]), cos_beta)
        force = series_product(force_1, h[n - 1]) + series_product(force_2, squares)
        if n == 1:
            force = force + force_0
        transport = series_product(M, transport_beta + transport_gamma)
        h.append(series_quotient(force - transport, friction_1))
    return h


def invariance_residual(p, Omega, beta, gamma, h):
    """What the series of the orders h leaves of the invariance equation."""
    epsilon = p[7]
    v = sum(epsilon**i * h[i][0, 0] for i in range(len(h)))
    dv_dbeta = sum(epsilon**i * h[i][1, 0] for i in range(len(h)))
    dv_dgamma = sum(epsilon**i * h[i][0, 1] for i in range(len(h)))
    v_rate = equations(p, Omega, False, beta, gamma, v)[7]
    return epsilon * (dv_dbeta * v - dv_dgamma * Omega * cos(beta) - v_rate)


def slow_manifold(p, smooth, given, asked):
    """Level 5: the orders of the slow manifold and their residuals."""
    Omega, beta, gamma = given["Omega"], given["beta"], given["gamma"]
    last = max(int(name.rsplit("_", 1)[1]) for name in asked)
    h = slow_manifold_orders(p, Omega, beta, gamma, last)
    answers = {}
    for n in range(last + 1):
        answers[f"h_{n}"] = h[n][0, 0]
        answers[f"residual_{n}"] = invariance_residual(p, Omega, beta, gamma, h[: n + 1])
    return answers


# ---- flights: the explicit Runge-Kutta method of Cooper and Verner, order 8 in 11 stages ----

ROOT = 21**0.5
STAGES = (
    [1 / 2],
    [1 / 4, 1 / 4],
    [1 / 7, (-7 - 3 * ROOT) / 98, (21 + 5 * ROOT) / 49],
    [(11 + ROOT) / 84, 0, (18 + 4 * ROOT) / 63, (21 - ROOT) / 252],
    [(5 + ROOT) / 48, 0, (9 + ROOT) / 36, (-231 + 14 * ROOT) / 360, (63 - 7 * ROOT) / 80],
    [(10 - ROOT) / 42, 0, (-432 + 92 * ROOT) / 315, (633 - 145 * ROOT) / 90]
    + [(-504 + 115 * ROOT) / 70, (63 - 13 * ROOT) / 35],
    [1 / 14, 0, 0, 0, (14 - 3 * ROOT) / 126, (13 - 3 * ROOT) / 63, 1 / 9],
    [1 / 32, 0, 0, 0, (91 - 21 * ROOT) / 576, 11 / 72, (-385 - 75 * ROOT) / 1152, (63 + 13 * ROOT) / 128],
    [1 / 14, 0, 0, 0, 1 / 9, (-733 - 147 * ROOT) / 2205, (515 + 111 * ROOT) / 504]
    + [(-51 - 11 * ROOT) / 56, (132 + 28 * ROOT) / 245],
    [0, 0, 0, 0, (-42 + 7 * ROOT) / 18, (-18 + 28 * ROOT) / 45, (-273 - 53 * ROOT) / 72]
    + [(301 + 53 * ROOT) / 72, (28 - 28 * ROOT) / 45, (49 - 7 * ROOT) / 18],
    [1 / 20, 0, 0, 0, 0, 0, 0, 49 / 180, 16 / 45, 49 / 180, 1 / 20],
)  # the last row holds the weights
TABLEAU = [np.array(row) for row in STAGES]
FLIGHT_STEP = 0.005
LONGEST_FLIGHT = 10  # seconds for which an orbit is followed if nothing is asked at given times
LONGEST = 2.8  # seconds to a section; what takes longer passes a saddle nearer than doubles can tell


def runge_kutta_step(rates, p, Omega, smooth, state, h):
    """The state after one step of length h, which may differ between the entries."""
    slopes = np.empty((len(TABLEAU), state.size))
    stage = state
    for i, row in enumerate(TABLEAU):
        slopes[i] = rates(p, Omega, smooth, stage).ravel()
        stage = state + h * (row @ slopes[: i + 1]).reshape(state.shape)
    return stage


def flow(p, Omega, smooth, state):
    """The rates of (beta, gamma, v)."""
    beta, gamma, v = state
    M, h, f_G, w_y, gamma_y, lambda_Ty, gamma_rate, v_rate = equations(p, Omega, smooth, beta, gamma, v)
    return np.array([v, gamma_rate, v_rate])


def variational_flow(p, Omega, smooth, state):
    """The rates of a state, of three variations, the third by Omega, and of the divergence's integral."""
    beta, gamma, v = state[:3]
    delta_beta, delta_gamma, delta_v = state[3:6], state[6:9], state[9:12]
    delta_omega = np.array([0, 0, 1])[:, np.newaxis]
    all_derivatives = derivatives(p, Omega, smooth, beta, gamma, v)
    dv_rate_dbeta, dv_rate_dgamma, dv_rate_dv, dv_rate_domega, v_rate = all_derivatives
    delta_gamma_rate = Omega * sin(beta) * delta_beta - cos(beta) * delta_omega
    delta_v_rate = (
        dv_rate_dbeta * delta_beta + dv_rate_dgamma * delta_gamma + dv_rate_dv * delta_v + dv_rate_domega * delta_omega
    )
    rates = np.array([v, -Omega * cos(beta), v_rate])
    divergence = dv_rate_dv[np.newaxis]
    return np.concatenate([rates, delta_v, delta_gamma_rate, delta_v_rate, divergence])


def flight_step(rates, p, Omega, smooth, state, h):
    """A step, in two parts where gamma_y passes zero: there the smooth law's second derivative jumps."""
    after = runge_kutta_step(rates, p, Omega, smooth, state, h)
    if smooth:
        gamma_y_before = equations(p, Omega, smooth, *state[:3])[4]
        gamma_y_after = equations(p, Omega, smooth, *after[:3])[4]
        slips = gamma_y_before * gamma_y_after < 0
        if slips.any():
            some_p, some_omega = tuple(parameter[slips] for parameter in p), Omega[slips]
            before, length = state[:, slips], (h + 0 * Omega)[slips]
            gamma_y_before, gamma_y_after = gamma_y_before[slips], gamma_y_after[slips]
            part = slip_time(some_p, some_omega, before[:3], length, gamma_y_before, gamma_y_after)
            middle = runge_kutta_step(rates, some_p, some_omega, smooth, before, part)
            after[:, slips] = runge_kutta_step(rates, some_p, some_omega, smooth, middle, length - part)
    return after


def slip_time(p, Omega, state, h, gamma_y_before, gamma_y_after):
    """The part of a step until gamma_y = 0, by the secant method."""
    part = h * gamma_y_before / (gamma_y_before - gamma_y_after)
    other, gamma_y_other = h, gamma_y_after
    for _ in range(3):
        middle = runge_kutta_step(flow, p, Omega, True, state, part)
        gamma_y = equations(p, Omega, True, *middle)[4]
        change = -gamma_y * (part - other) / (gamma_y - gamma_y_other)
        other, gamma_y_other = part, gamma_y
        part = part + np.where(np.isfinite(change), change, 0)
    return part


def shortened_step(rates, p, Omega, smooth, before, after, h, index, target):
    """The step's length until a component comes to the target, by Newton's method, and the state there."""
    tau = h * (target - before[index]) / (after[index] - before[index])
    for _ in range(3):
        end = flight_step(flow, p, Omega, smooth, before[:3], tau)
        tau = tau + (target - end[index]) / flow(p, Omega, smooth, end)[index]
    return tau, flight_step(rates, p, Omega, smooth, before, tau)


def fly_to(rates, p, Omega, smooth, state, index, target, sign, longest=LONGEST, h=FLIGHT_STEP):
    """Time and state where a component passes the target, upward for sign 1; NaN where it never does."""
    before, after = np.full_like(state, np.nan), np.full_like(state, np.nan)
    time = np.full(Omega.shape, np.nan)
    for k in range(int(longest / h)):
        following = flight_step(rates, p, Omega, smooth, state, h)
        passes = (sign * (state[index] - target) < 0) & (sign * (following[index] - target) >= 0)
        passes = passes & np.isnan(time)
        before[:, passes] = state[:, passes]
        after[:, passes] = following[:, passes]
        time[passes] = k * h
        if (np.isfinite(time) | np.isnan(following[0])).all():
            break
        state = following
    tau, end = shortened_step(rates, p, Omega, smooth, before, after, h, index, target)
    return time + tau, end


def trajectory(p, smooth, given, asked):
    """Level 6: states at the asked times, crossings of beta = pi/2, and the time when the disk lies flat."""
    Omega = given["Omega"]
    state = np.array([given["beta"], given["gamma"], given["v"]])
    answers = {name: np.full(len(Omega), np.nan) for name in asked}
    number = np.zeros(len(Omega), dtype=int)
    flat_time = np.full(len(Omega), np.inf)
    samples = sorted({float(name.split("@")[1]) for name in asked if "@" in name})
    # A disk lies flat soon after its last sample; without samples, nothing says how long to wait for an event.
    end = samples[-1] + 0.5 if samples else LONGEST_FLIGHT
    stops = samples + [end] if "flat_time" in asked or not samples else samples
    start = 0
    for stop in stops:
        steps = int(np.ceil((stop - start) / FLIGHT_STEP))
        h = (stop - start) / steps
        for k in range(steps):
            time = start + k * h
            after = flight_step(flow, p, Omega, smooth, state, h)
            lies = np.isinf(flat_time) & (sin(after[0]) < 0)
            for i in np.flatnonzero(lies):
                target = np.where(after[0, [i]] < pi / 2, 0, pi)
                tau, end = crossing_of(p, Omega, smooth, state, after, h, [i], target)
                flat_time[i] = time + tau[0]
            crosses = np.flatnonzero(np.isinf(flat_time) & ((state[0] - pi / 2) * (after[0] - pi / 2) < 0))
            if len(crosses) > 0:
                tau, end = crossing_of(p, Omega, smooth, state, after, h, crosses, pi / 2)
                for i, crossing_time, crossing_gamma, crossing_v in zip(crosses, time + tau, end[1], end[2]):
                    if crossing_time > 0.01:
                        number[i] += 1
                        set_crossing(answers, i, number[i], crossing_time, crossing_gamma, crossing_v)
            state = after
        if stop in samples:
            for name, values in zip(("beta", "gamma", "v"), state):
                answers[f"{name}@{stop:g}"] = np.where(np.isinf(flat_time), values, np.nan)
        start = stop
    answers["flat_time"] = flat_time
    return answers


def crossing_of(p, Omega, smooth, before, after, h, entries, target):
    """Where beta comes to the target between two states of these entries."""
    some_p, some_omega = tuple(parameter[entries] for parameter in p), Omega[entries]
    before, after = before[:, entries], after[:, entries]
    return shortened_step(flow, some_p, some_omega, smooth, before, after, h, 0, target)


def set_crossing(answers, i, number, crossing_time, crossing_gamma, crossing_v):
    """Enter what is asked of the crossing of this number."""
    crossing = {"crossing_time": crossing_time, "crossing_gamma": crossing_gamma, "crossing_v": crossing_v}
    for quantity, value in crossing.items():
        if f"{quantity}#{number}" in answers:
            answers[f"{quantity}#{number}"][i] = value


# ---- limit cycles: the half map leads from beta = pi/2, v < 0 to the next crossing, mirrored ----


def flight_with_variations(p, Omega, smooth, state, kept, index, target, h=FLIGHT_STEP):
    """Time and state on a section, their derivatives by the kept components and Omega, and the divergence."""
    variations = np.zeros((10,) + Omega.shape)
    variations[3 * kept[0]] = 1
    variations[3 * kept[1] + 1] = 1
    state = np.concatenate([state, variations])
    time, end = fly_to(variational_flow, p, Omega, smooth, state, index, target, 1, LONGEST, h)
    end_rate = flow(p, Omega, smooth, end[:3])
    delta = end[3:12].reshape((3, 3) + Omega.shape)
    dtime = -delta[index] / end_rate[index]
    delta_section = [delta[i] + end_rate[i] * dtime for i in kept]
    return time, end[:3], np.moveaxis(np.array(delta_section), 2, 0), dtime, end[12]


def half_map(p, Omega, smooth, gamma_bar, v, longest=LONGEST):
    """Where the orbit from (pi/2, pi/2 + gamma_bar, v) is at the next crossing, turned back."""
    state = np.array([pi / 2 + 0 * v, pi / 2 + gamma_bar, v])
    time, end = fly_to(flow, p, Omega, smooth, state, 0, pi / 2, 1, longest)
    return -(end[1] - pi / 2), -end[2]


def half_map_derivatives(p, Omega, smooth, gamma_bar, v, h):
    """The half map, its time, and its derivatives: P by (gamma_bar, v), dmap by Omega, dtime by all three."""
    state = np.array([pi / 2 + 0 * v, pi / 2 + gamma_bar, v])
    flight = flight_with_variations(p, Omega, smooth, state, (1, 2), 0, pi / 2, h)
    half_time, end, delta, dtime, divergence = flight
    gamma_bar_next = -(end[1] - pi / 2)
    v_next = -end[2]
    P = -delta[:, :, :2]
    dmap_domega = -delta[:, :, 2]
    return half_time, gamma_bar_next, v_next, P, dmap_domega, dtime, divergence


def solve_along(P, right_side):
    """(I - P)^-1 times a right side: what changes of a fixed point come to."""
    finite = np.isfinite(P).all(axis=(1, 2))
    matrix = np.where(finite[:, np.newaxis, np.newaxis], np.eye(2) - P, np.eye(2))
    solution = np.linalg.solve(matrix, right_side[:, :, np.newaxis])[:, :, 0]
    return np.where(finite[:, np.newaxis], solution, np.nan).T


def limit_cycle_start(p, Omega, smooth):
    """Guesses of gamma_bar and v from a scan: inside the cycle the half map leads outward."""
    columns = tuple(parameter[:, np.newaxis] + np.zeros(60) for parameter in p)
    speeds = Omega[:, np.newaxis] + np.zeros(60)
    gamma_bar = np.linspace(0.01, 3.1, 60) + 0 * speeds
    v = -columns[1] * speeds * sin(gamma_bar) / (columns[0] + columns[1] * cos(gamma_bar))
    gamma_bar, v = half_map(columns, speeds, smooth, gamma_bar, v, 0.8)
    change = half_map(columns, speeds, smooth, gamma_bar, v, 0.8)[0] - gamma_bar
    rows = np.arange(len(Omega))
    outer = np.argmax(~(change > 0), axis=1)
    inner = np.maximum(outer - 1, 0)
    part = change[rows, inner] / (change[rows, inner] - change[rows, outer])
    outer = np.where(np.isfinite(part), outer, inner)
    part = np.where(np.isfinite(part), part, 0)
    gamma_bar_start = (1 - part) * gamma_bar[rows, inner] + part * gamma_bar[rows, outer]
    v_start = (1 - part) * v[rows, inner] + part * v[rows, outer]
    return gamma_bar_start, v_start


def limit_cycle_state(p, Omega, smooth):
    """Better guesses: the half map attracts, the more the nearer the cycle comes to the saddles."""
    gamma_bar, v = limit_cycle_start(p, Omega, smooth)
    for _ in range(25):
        gamma_bar_before = gamma_bar
        gamma_bar, v = half_map(p, Omega, smooth, gamma_bar, v)
        if np.nanmax(abs(gamma_bar - gamma_bar_before)) < 1e-3:
            break
    return gamma_bar, v


def limit_cycle_derivatives(p, Omega, smooth, gamma_bar, v, h):
    """gamma_bar and v of the cycle by Newton's method, and the half map's time and derivatives there."""
    for _ in range(8):
        flight = half_map_derivatives(p, Omega, smooth, gamma_bar, v, h)
        half_time, gamma_bar_next, v_next, P, dmap_domega, dtime, divergence = flight
        change = solve_along(P, np.array([gamma_bar_next - gamma_bar, v_next - v]).T)
        if np.nanmax(abs(change)) < 2e-8:
            break
        gamma_bar, v = gamma_bar + change[0], v + change[1]
    # Newton's method also comes to rest at the equilibrium, within some 1e-8 of it: there is no cycle then.
    away = np.where(hypot(gamma_bar, v) > 1e-6, 1, np.nan)
    P = away[:, np.newaxis, np.newaxis] * P
    return away * gamma_bar, away * v, away * half_time, P, dmap_domega, dtime, divergence


def spectral_radius(P):
    """The modulus of the larger eigenvalue of each matrix."""
    trace = P[:, 0, 0] + P[:, 1, 1]
    determinant = P[:, 0, 0] * P[:, 1, 1] - P[:, 0, 1] * P[:, 1, 0]
    root = sqrt(trace**2 / 4 - determinant + 0j)
    return np.maximum(abs(trace / 2 + root), abs(trace / 2 - root))


def cycle_beta_max(p, Omega, smooth, gamma_bar, v):
    """The largest abs(beta - pi/2), where v passes zero."""
    state = np.array([pi / 2 + 0 * v, pi / 2 + gamma_bar, v])
    time, end = fly_to(flow, p, Omega, smooth, state, 2, 0, 1)
    return pi / 2 - end[0]


def limit_cycle(p, smooth, given, asked):
    """Level 7: the limit cycle."""
    return limit_cycle_quantities(p, given["Omega"], smooth, FLIGHT_STEP)


def near_heteroclinic(p, smooth, given, asked):
    """Level 9: the limit cycle near Omega_h, where errors grow while it passes the saddles."""
    return limit_cycle_quantities(p, given["Omega"], smooth, FLIGHT_STEP / 2 if smooth else FLIGHT_STEP)


def limit_cycle_quantities(p, Omega, smooth, h):
    """State, period and multipliers of the limit cycle, and its derivatives by Omega."""
    guess = limit_cycle_state(p, Omega, smooth)
    flight = limit_cycle_derivatives(p, Omega, smooth, *guess, h)
    gamma_bar, v, half_time, P, dmap_domega, dtime, divergence = flight
    multiplier_slow = spectral_radius(P) ** 2
    dgamma_bar_domega, dv_domega = solve_along(P, dmap_domega)
    dhalf_time_domega = dtime[0] * dgamma_bar_domega + dtime[1] * dv_domega + dtime[2]
    return {
        "period": 2 * half_time,
        "gamma_bar_0": gamma_bar,
        "v_0": v,
        "beta_max": cycle_beta_max(p, Omega, smooth, gamma_bar, v),
        "multiplier_slow": multiplier_slow,
        "log_multiplier_slow": log(multiplier_slow),
        "log_multiplier_fast": 2 * divergence - log(multiplier_slow),
        "dperiod_domega": 2 * dhalf_time_domega,
        "dgamma_bar_0_domega": dgamma_bar_domega,
        "dv_0_domega": dv_domega,
    }


# ---- the heteroclinic connection ----


def turns_over(p, Omega, smooth):
    """Whether the saddle's unstable orbit passes gamma = 3 pi/2 before it comes back to beta = pi/2."""
    matrix = linearisation(tuple(parameter.ravel() for parameter in p), Omega.ravel(), -1)
    lambda_u = sorted_eigenvalues(matrix)[:, 0].real.reshape(Omega.shape)
    distance = 1e-4
    state = np.array([pi / 2 + distance + 0 * Omega, -pi / 2 + distance * Omega / lambda_u, distance * lambda_u])
    over = np.zeros(Omega.shape, dtype=bool)
    back = np.zeros(Omega.shape, dtype=bool)
    for _ in range(int(6 / FLIGHT_STEP)):
        state = flight_step(flow, p, Omega, smooth, state, FLIGHT_STEP)
        over = over | ~back & (state[1] > 3 * pi / 2)
        back = back | ~over & (state[0] < pi / 2)
        if (over | back).all():
            break
    return over


def heteroclinic_speed(p, smooth):
    """Omega_h, by cutting an interval that holds it into a hundred, again and again."""
    low = 0.9 * critical_speed(p)
    high = critical_speed(p)
    columns = tuple(parameter[:, np.newaxis] + np.zeros(101) for parameter in p)
    for _ in range(5):
        Omega = np.linspace(low, high, 101).T
        over = turns_over(columns, Omega, smooth)
        last = np.where(over, np.arange(101), 0).max(axis=1)
        last = np.minimum(last, 99)
        low = Omega[np.arange(len(low)), last]
        high = Omega[np.arange(len(low)), last + 1]
    return (low + high) / 2


def heteroclinic(p, smooth, given, asked):
    """Level 8: Omega_h, and the saddle's eigenvalues there."""
    Omega = heteroclinic_speed(p, smooth)
    lambda_u, lambda_s, lambda_ss = sorted_eigenvalues(linearisation(p, Omega, -1)).real.T
    return {"omega_h": Omega, "lambda_u": lambda_u, "lambda_s": lambda_s, "lambda_ss": lambda_ss}


# ---- rotating cycles: the turn map from gamma = pi/2 to gamma = 5 pi/2 ----


def turn_derivatives(p, Omega, smooth, beta_bar, v):
    """The turn map, its time, and its derivatives: P by (beta_bar, v), dmap by Omega, dtime by all three."""
    state = np.array([pi / 2 + beta_bar, pi / 2 + 0 * v, v])
    flight = flight_with_variations(p, Omega, smooth, state, (0, 2), 1, 5 * pi / 2)
    time, end, delta, dtime, divergence = flight
    P = delta[:, :, :2]
    dmap_domega = delta[:, :, 2]
    return time, end[0] - pi / 2, end[2], P, dmap_domega, dtime, divergence


def scan_of_turns(p, Omega, smooth, starts):
    """beta_bar and v at gamma = pi/2 of orbits on the slow manifold, and a turn's change of beta_bar."""
    columns = tuple(parameter[:, np.newaxis] + 0 * starts for parameter in p)
    Omega = Omega[:, np.newaxis] + 0 * starts
    beta_bar = starts + 0 * Omega
    v = columns[1] * Omega * cos(beta_bar) / columns[0]
    state = np.array([pi / 2 + beta_bar, 0 * v, v])
    time, top = fly_to(flow, columns, Omega, smooth, state, 1, pi / 2, 1, 0.5)
    time, end = fly_to(flow, columns, Omega, smooth, top, 1, 5 * pi / 2, 1, 1.2)
    return top[0] - pi / 2, top[2], end[0] - top[0]


def rotating_cycle_start(p, Omega, smooth, stable):
    """Guesses of beta_bar and v: stable cycles lie below where a turn lowers beta_bar most."""
    beta_bar, v, change = scan_of_turns(p, Omega, smooth, np.linspace(0.1, 1, 120))
    falls_most = np.nanargmin(change, axis=1)
    above = np.arange(beta_bar.shape[1]) > falls_most[:, np.newaxis]
    rises = np.argmax(above & (change > 0), axis=1)
    chosen = np.where(stable, falls_most, rises)
    rows = np.arange(len(Omega))
    return beta_bar[rows, chosen], v[rows, chosen]


def rotating_cycle(p, smooth, given, asked):
    """Level 10: a rotating cycle, by Newton's method on the turn map."""
    Omega, stable = given["Omega"], given["form"] == "stable"
    beta_bar, v = rotating_cycle_start(p, Omega, smooth, stable)
    for _ in range(8):  # stable cycles attract
        state = np.array([pi / 2 + beta_bar, pi / 2 + 0 * v, v])
        time, end = fly_to(flow, p, Omega, smooth, state, 1, 5 * pi / 2, 1)
        beta_bar = np.where(stable, end[0] - pi / 2, beta_bar)
        v = np.where(stable, end[2], v)
    for _ in range(8):
        flight = turn_derivatives(p, Omega, smooth, beta_bar, v)
        time, beta_bar_next, v_next, P, dmap_domega, dtime, divergence = flight
        change = solve_along(P, np.array([beta_bar_next - beta_bar, v_next - v]).T)
        if np.nanmax(abs(change)) < 2e-8:
            break
        beta_bar, v = beta_bar + change[0], v + change[1]
    multiplier_slow = spectral_radius(P)
    dbeta_bar_domega, dv_domega = solve_along(P, dmap_domega)
    answers = rotating_cycle_shape(p, Omega, smooth, beta_bar, v)
    answers["period"] = time
    answers["multiplier_slow"] = multiplier_slow
    answers["log_multiplier_slow"] = log(multiplier_slow)
    answers["log_multiplier_fast"] = divergence - log(multiplier_slow)
    answers["dperiod_domega"] = dtime[0] * dbeta_bar_domega + dtime[1] * dv_domega + dtime[2]
    answers["dbeta_bar_top_domega"] = dbeta_bar_domega
    answers["dv_top_domega"] = dv_domega
    return answers


def rotating_cycle_shape(p, Omega, smooth, beta_bar, v):
    """What a rotating cycle passes through: top, gamma = -pi/2 modulo 2 pi, and its largest beta."""
    state = np.array([pi / 2 + beta_bar, pi / 2 + 0 * v, v])
    time, bottom = fly_to(flow, p, Omega, smooth, state, 1, 3 * pi / 2, 1)
    time, highest = fly_to(flow, p, Omega, smooth, state, 2, 0, -1)
    return {
        "beta_bar_0": bottom[0] - pi / 2,
        "v_0": bottom[2],
        "beta_bar_top": beta_bar,
        "v_top": v,
        "beta_max": highest[0] - pi / 2,
    }


def rotation_fold_start(p, smooth):
    """Guesses of the fold's Omega, beta_bar and v: the lowest speed where some turn lowers beta_bar."""
    guesses = []
    for entry in np.array(p).T:
        speeds = critical_speed(entry) * np.linspace(0.95, 1, 26)
        columns = tuple(parameter + 0 * speeds for parameter in entry)
        beta_bar, v, change = scan_of_turns(columns, speeds, smooth, np.linspace(0.1, 1, 40))
        lowest = np.argmax(np.nanmin(change, axis=1) < 0)
        falls_most = np.nanargmin(change[lowest])
        guesses.append((speeds[lowest], beta_bar[lowest, falls_most], v[lowest, falls_most]))
    return np.array(guesses).T


def rotation_fold(p, smooth, given, asked):
    """Level 10: the fold, where the family's dOmega/d(beta_bar) is zero: a secant within Newton's method."""
    Omega, beta_bar, v = rotation_fold_start(p, smooth)
    step, slope_before = 0.003 + 0 * v, np.nan
    for _ in range(12):
        flight = turn_derivatives(p, Omega, smooth, beta_bar, v)
        time, beta_bar_next, v_next, P, dmap_domega, dtime, divergence = flight
        # (P - I) d(beta_bar, v) + dmap_domega dOmega = - (map - identity), with beta_bar chosen.
        matrix = np.stack([P[:, :, 1] - [0, 1], dmap_domega], axis=2)
        mismatch = np.array([beta_bar_next - beta_bar, v_next - v]).T
        dv, dOmega = np.linalg.solve(matrix, -mismatch[:, :, np.newaxis])[:, :, 0].T
        dv_dbeta_bar, slope = np.linalg.solve(matrix, ([1, 0] - P[:, :, 0])[:, :, np.newaxis])[:, :, 0].T
        if not np.isnan(slope_before).all():
            step = -slope * step / (slope - slope_before)
        slope_before = slope
        beta_bar = beta_bar + step
        v = v + dv + dv_dbeta_bar * step
        Omega = Omega + dOmega + slope * step
        if np.max(abs(step)) < 1e-8:
            break
    answers = rotating_cycle_shape(p, Omega, smooth, beta_bar, v)
    answers["omega"] = Omega
    answers["period"] = time
    answers["null_vector"] = dv_dbeta_bar
    answers["log_multiplier_fast"] = divergence
    return answers


# ---- from sheet to answers ----

PARAMETERS = "r", "e", "m", "A", "B", "g", "mu", "epsilon"
KINDS = {
    "rhs": rhs,
    "equilibrium": equilibrium,
    "hopf": hopf,
    "harmonic-balance": harmonic_balance,
    "slow-manifold": slow_manifold,
    "trajectory": trajectory,
    "limit-cycle": limit_cycle,
    "heteroclinic": heteroclinic,
    "near-heteroclinic": near_heteroclinic,
    "rotating-cycle": rotating_cycle,
    "rotation-fold": rotation_fold,
}


def answered(rows):
    """The answers to a sheet's rows, by id; entries of one kind and friction law are computed together."""
    groups = {}
    for row in rows:
        entry, name = row["id"].rsplit("/", 1)
        entries = groups.setdefault((row["kind"], row["friction"]), {})
        entries.setdefault(entry, (row, []))[1].append(name)
    answers = {}
    for (kind, friction), entries in groups.items():
        if kind not in KINDS:
            continue
        firsts = [row for row, names in entries.values()]
        p = tuple(np.array([float(row[column]) for row in firsts]) for column in PARAMETERS)
        given = {}
        for column in ("Omega", "beta", "gamma", "v"):
            if all(row[column] for row in firsts):
                given[column] = np.array([float(row[column]) for row in firsts])
        for column in ("equilibrium", "form"):
            given[column] = np.array([row[column] for row in firsts])
        asked = {name for row, names in entries.values() for name in names}
        with np.errstate(all="ignore"):
            results = KINDS[kind](p, friction == "smooth", given, asked)
        for k, entry in enumerate(entries):
            for name in entries[entry][1]:
                if name in results:
                    answers[f"{entry}/{name}"] = float(results[name][k])
    return answers


def main(sheet, target):
    """Answer a sheet; what has no value is left out."""
    with open(sheet, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    with open(target, "w", encoding="utf-8") as file:
        file.write("id,answer,from\n")
        for name, number in answered(rows).items():
            if np.isfinite(number):
                file.write(f"{name},{number!r},doubles\n")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python client.py SHEET.csv ANSWERS.csv")
    main(sys.argv[1], sys.argv[2])
