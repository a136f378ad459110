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


# ---- the slow manifold, by series: coefficient [i, j], i + j < size, belongs to beta^i gamma^j ----


def series_product(*factors):
    """The product of truncated series."""
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
    """The quotient of truncated series, by long division."""
    quotient = np.zeros_like(numerator)
    remainder = numerator.copy()
    size = len(numerator)
    for i in range(size):
        for j in range(size - i):
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


def series_of(derivatives, size):
    """The Taylor coefficients of a function whose derivatives at the angle repeat after four."""
    return np.array([derivatives[k % 4] / factorial(k) for k in range(size)])


def series_sine(angle, size):
    return series_of([sin(angle), cos(angle), -sin(angle), -cos(angle)], size)


def series_cosine(angle, size):
    return series_of([cos(angle), -sin(angle), -cos(angle), sin(angle)], size)


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
    w_y = series_product(rho, sin_beta)
    friction_1 = mu * m * g * series_product(w_y, w_y)
    h = [e * Omega * series_quotient(series_product(sin_beta, cos_gamma), rho)]
    for n in range(1, last + 1):
        squares = sum(series_product(h[i], h[n - 1 - i]) for i in range(n))
        transport_beta = sum(series_product(h[i], derivative_beta(h[n - 1 - i])) for i in range(n))
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

S = 21**0.5
STAGES = (
    [1 / 2],
    [1 / 4, 1 / 4],
    [1 / 7, (-7 - 3 * S) / 98, (21 + 5 * S) / 49],
    [(11 + S) / 84, 0, (18 + 4 * S) / 63, (21 - S) / 252],
    [(5 + S) / 48, 0, (9 + S) / 36, (-231 + 14 * S) / 360, (63 - 7 * S) / 80],
    [(10 - S) / 42, 0, (-432 + 92 * S) / 315, (633 - 145 * S) / 90, (-504 + 115 * S) / 70, (63 - 13 * S) / 35],
    [1 / 14, 0, 0, 0, (14 - 3 * S) / 126, (13 - 3 * S) / 63, 1 / 9],
    [1 / 32, 0, 0, 0, (91 - 21 * S) / 576, 11 / 72, (-385 - 75 * S) / 1152, (63 + 13 * S) / 128],
    [1 / 14, 0, 0, 0, 1 / 9, (-733 - 147 * S) / 2205, (515 + 111 * S) / 504, (-51 - 11 * S) / 56, (132 + 28 * S) / 245],
    [0, 0, 0, 0, (-42 + 7 * S) / 18, (-18 + 28 * S) / 45, (-273 - 53 * S) / 72, (301 + 53 * S) / 72]
    + [(28 - 28 * S) / 45, (49 - 7 * S) / 18],
    [1 / 20, 0, 0, 0, 0, 0, 0, 49 / 180, 16 / 45, 49 / 180, 1 / 20],
)  # the last row holds the weights
TABLEAU = [np.array(row) for row in STAGES]
FLIGHT_STEP = 0.005
LONGEST_FLIGHT = 10  # seconds for which an orbit is followed to its crossings, and until it lies flat
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
    dv_rate_dbeta, dv_rate_dgamma, dv_rate_dv, dv_rate_domega, v_rate = derivatives(p, Omega, smooth, beta, gamma, v)
    delta_gamma_rate = Omega * sin(beta) * delta_beta
    delta_v_rate = dv_rate_dbeta * delta_beta + dv_rate_dgamma * delta_gamma + dv_rate_dv * delta_v
    delta_gamma_rate[2] -= cos(beta)
    delta_v_rate[2] += dv_rate_domega
    return np.concatenate([[v, -Omega * cos(beta), v_rate], delta_v, delta_gamma_rate, delta_v_rate, [dv_rate_dv]])


def flight_step(rates, p, Omega, smooth, state, h):
    """A step, in two parts where gamma_y passes zero: there the smooth law's second derivative jumps."""
    after = runge_kutta_step(rates, p, Omega, smooth, state, h)
    if smooth:
        gamma_y_before = equations(p, Omega, smooth, *state[:3])[4]
        gamma_y_after = equations(p, Omega, smooth, *after[:3])[4]
        slips = gamma_y_before * gamma_y_after < 0
        if slips.any():
            some_p, some_omega = tuple((parameter + 0 * Omega)[slips] for parameter in p), Omega[slips]
            before, gamma_y, length = gamma_y_before[slips], gamma_y_after[slips], (h + 0 * Omega)[slips]
            part = length
            for _ in range(3):
                part = part * before / (before - gamma_y)
                middle = runge_kutta_step(rates, some_p, some_omega, smooth, state[:, slips], part)
                gamma_y = equations(some_p, some_omega, smooth, *middle[:3])[4]
            after[:, slips] = runge_kutta_step(rates, some_p, some_omega, smooth, middle, length - part)
    return after


def fly_to(rates, p, Omega, smooth, state, event, sign=1, longest=LONGEST, h=FLIGHT_STEP):
    """Time and state where a function of the state passes zero, upward for sign 1; NaN where it never does."""
    before, time = np.full_like(state, np.nan), np.full(Omega.shape, np.nan)
    for k in range(int(longest / h)):
        after = flight_step(rates, p, Omega, smooth, state, h)
        passes = np.isnan(time) & (sign * event(state) < 0) & (sign * event(after) >= 0)
        before[:, passes] = state[:, passes]
        time[passes] = k * h
        if (np.isfinite(time) | ~(sin(after[0]) > 0)).all():
            break
        state = after
    tau, tau_before, value_before = h / 2, 0, event(before)
    for _ in range(6):
        value = event(flight_step(flow, p, Omega, smooth, before[:3], tau))
        change = np.where(value == value_before, 0, value * (tau - tau_before) / (value_before - value))
        tau, tau_before, value_before = tau + change, tau, value
    return time + tau, flight_step(rates, p, Omega, smooth, before, tau)


def trajectory(p, smooth, given, asked):
    """Level 6: states at the asked times, crossings of beta = pi/2, and the time when the disk lies flat."""
    names = "beta", "gamma", "v"
    Omega, state, time = given["Omega"], np.array([given[name] for name in names]), 0
    answers = {"flat_time": np.full(len(Omega), np.nan)}
    for sample in sorted({0.01} | {float(name.split("@")[1]) for name in asked if "@" in name}):
        h = (sample - time) / np.ceil((sample - time) / FLIGHT_STEP)
        while time < sample - h / 2:
            state, time = flight_step(flow, p, Omega, smooth, state, h), time + h
        answers.update(zip((f"{name}@{sample:g}" for name in names), state))
    # Events count from 0.01 s on; sin(2 beta) is zero where beta = pi/2, and where the disk lies flat.
    state, time, n = np.array([answers[f"{name}@0.01"] for name in names]), 0.01, 0
    side = np.sign(state[0] - pi / 2)
    while n == 0 or (time < LONGEST_FLIGHT).any():
        passed, state = fly_to(flow, p, Omega, smooth, state, lambda s: sin(2 * s[0]), side, LONGEST_FLIGHT, 0.01)
        time, side, n = time + passed, -side, n + 1
        flat = abs(state[0] - pi / 2) > 1
        answers["flat_time"] = np.where(flat, time, answers["flat_time"])
        state = np.where(flat, np.nan, state)
        answers.update(zip((f"crossing_time#{n}", f"crossing_gamma#{n}", f"crossing_v#{n}"), (time, *state[1:])))
    return answers


# ---- cycles, from a section to itself: beta = pi/2 with the symmetry (index 0), gamma = pi/2 + 2 pi (index 1) ----

# Returns to a period, and what is asked of x and v.
SECTIONS = (2, "gamma_bar_0", "v_0"), (1, "beta_bar_top", "v_top")


def section_state(Omega, index, x, v):
    """A state on a section with its variations; x is gamma - pi/2 for index 0, beta - pi/2 for index 1."""
    state = np.zeros((13,) + Omega.shape)
    state[:3] = pi / 2 + index * x, pi / 2 + (1 - index) * x, v
    state[[6 - 3 * index, 10]] = 1  # the first variation begins along x, the second along v
    return state


def section_return(rates, p, Omega, smooth, index, x, v, h=FLIGHT_STEP):
    """Time, x, v and state of the return to a section."""
    state = section_state(Omega, index, x, v)
    state = state[:3] if rates is flow else state
    time, end = fly_to(rates, p, Omega, smooth, state, lambda s: s[index] - pi / 2 - 2 * pi * index, h=h)
    return time, (2 * index - 1) * (end[1 - index] - pi / 2), (2 * index - 1) * end[2], end


def return_derivative(p, Omega, smooth, index, end):
    """How the time of the return, and x and v there, change with x, v and Omega of the start."""
    end_rate = flow(p, Omega, smooth, end[:3])
    delta = end[3:12].reshape((3, 3) + Omega.shape)
    dtime = -delta[index] / end_rate[index]
    delta = (2 * index - 1) * (delta + end_rate[:, np.newaxis] * dtime)
    return dtime, np.moveaxis(delta[[1 - index, 2]], 2, 0)


def cycle_derivatives(p, Omega, smooth, index, end):
    """The multipliers of a cycle, from where it returned, and its derivatives by Omega."""
    parts, x_name, v_name = SECTIONS[index]
    dtime, derivative = return_derivative(p, Omega, smooth, index, end)
    P, by_omega = derivative[:, :, :2], derivative[:, :, 2:]
    eigenvalue = np.max(abs(np.linalg.eigvals(np.nan_to_num(P))), axis=1)
    multiplier_slow = eigenvalue**parts
    tangent = np.linalg.solve(np.eye(2) - P, by_omega)[:, :, 0].T
    return {
        "multiplier_slow": multiplier_slow,
        "log_multiplier_slow": log(multiplier_slow),
        "log_multiplier_fast": parts * end[12] - log(multiplier_slow),
        "dperiod_domega": parts * (sum(dtime[:2] * tangent) + dtime[2]),
        f"d{x_name}_domega": tangent[0],
        f"d{v_name}_domega": tangent[1],
        "null_vector": tangent[1] / tangent[0],
    }


def cycle_extremes(p, Omega, smooth, index, end):
    """The largest beta on a cycle, from where it returned, and the state next to the saddle on a rotating one."""
    time_highest, highest = fly_to(flow, p, Omega, smooth, end[:3], lambda s: s[2], -1)
    if index == 0:
        return {"beta_max": highest[0] - pi / 2}
    time_low, low = fly_to(flow, p, Omega, smooth, end[:3], lambda s: s[1] - 7 * pi / 2)
    return {"beta_max": highest[0] - pi / 2, "beta_bar_0": low[0] - pi / 2, "v_0": low[2]}


def cycle(p, Omega, smooth, index, stable, fold=False, h=FLIGHT_STEP):
    """A cycle with its multipliers and derivatives by Omega; for a fold the one where dOmega/dx is zero."""
    # Stable cycles lie where returns begin to lead inward, unstable ones where they end to; the first is to settle.
    columns = tuple(parameter[:, np.newaxis] for parameter in p)
    speeds = Omega[:, np.newaxis] + np.zeros(60)
    x_next, v_next = np.linspace((3.1, 0.1)[index], (0.01, 1)[index], 60) + 0 * speeds, 0 * speeds
    for _ in range(2):
        x, v = x_next, v_next
        time, x_next, v_next, end = section_return(flow, columns, speeds, smooth, index, x, v, 2 * FLIGHT_STEP)
    towards = (2 * index - 1) * (x_next - x) < 0
    away = ~towards & np.logical_or.accumulate(towards, axis=1)
    chosen = np.arange(len(Omega)), np.where(stable, towards.argmax(axis=1), away.argmax(axis=1))
    x, v = np.where(stable, [x_next[chosen], v_next[chosen]], [x[chosen], v[chosen]])
    free, fixed, step, slope = ([1, 2], 0, 0.02, 0) if fold else ([0, 1], 2, 0, 0)
    for k in range(20 if fold else 11):
        time, x_next, v_next, end = section_return(variational_flow, p, Omega, smooth, index, x, v, h)
        derivative = return_derivative(p, Omega, smooth, index, end)[1]
        # x, v and Omega are to close the cycle: one of them is fixed, or takes a chosen step; the others follow.
        matrix = derivative - np.eye(2, 3)
        sides = np.stack([np.array([x - x_next, v - v_next]).T, -matrix[:, :, fixed]], axis=2)
        newton, tangent = np.linalg.solve(matrix[:, :, free], sides).T
        newton = np.where(stable & (k < 2), [x_next - x, v_next - v], newton)  # stable cycles attract
        if fold:
            step = np.clip(-tangent[1] * step / (tangent[1] - slope), -0.02, 0.02)
            slope = tangent[1]
        change = np.zeros((3,) + Omega.shape)
        change[free], change[fixed] = newton + tangent * step, step
        x, v, Omega = np.array([x, v, Omega]) + change
        if not (abs(change) > 2e-8).any():
            break
    parts, x_name, v_name = SECTIONS[index]
    answers = {"omega": Omega, "period": parts * time, x_name: x, v_name: v}
    answers.update(cycle_derivatives(p, Omega, smooth, index, end))
    answers.update(cycle_extremes(p, Omega, smooth, index, end))
    # Newton's method also comes to rest at the equilibrium, within some 1e-8 of it: there is no cycle then.
    return {name: np.where(hypot(x, v) > 1e-6, values, np.nan) for name, values in answers.items()}


def limit_cycle(p, smooth, given, asked):
    """Level 7: the limit cycle."""
    return cycle(p, given["Omega"], smooth, 0, True)


def near_heteroclinic(p, smooth, given, asked):
    """Level 9: the limit cycle near Omega_h, where errors grow while it passes the saddles."""
    return cycle(p, given["Omega"], smooth, 0, True, h=FLIGHT_STEP / 2 if smooth else FLIGHT_STEP)


def rotating_cycle(p, smooth, given, asked):
    """Level 10: a rotating cycle."""
    return cycle(p, given["Omega"], smooth, 1, given["form"] == "stable")


def rotation_fold(p, smooth, given, asked):
    """Level 10: the fold, on from the unstable cycle at the Hopf point's speed."""
    return cycle(p, critical_speed(p), smooth, 1, False, fold=True)


def heteroclinic(p, smooth, given, asked):
    """Level 8: Omega_h, by cutting an interval that holds it into a hundred, again and again."""
    columns = tuple(parameter[:, np.newaxis] for parameter in p)
    low, width = 0.9 * critical_speed(p), 0.1 * critical_speed(p)
    for _ in range(5):
        width = width / 100
        Omega = low[:, np.newaxis] + width[:, np.newaxis] * np.arange(101)
        # Below Omega_h the saddle's unstable orbit passes gamma = 3 pi/2 before it comes back to beta = pi/2.
        lambda_u = sorted_eigenvalues(linearisation(p, low, -1)).real[:, :1] + 0 * Omega
        state = np.array([pi / 2 + 1e-3 + 0 * Omega, -pi / 2 + 1e-3 * Omega / lambda_u, 1e-3 * lambda_u])
        time, end = fly_to(flow, columns, Omega, smooth, state, lambda s: np.maximum(s[1] - 3 * pi / 2, pi / 2 - s[0]))
        low = low + width * ((end[1] - 3 * pi / 2 > pi / 2 - end[0]).sum(axis=1) - 1)
    lambda_u, lambda_s, lambda_ss = sorted_eigenvalues(linearisation(p, low, -1)).real.T
    return {"omega_h": low + width / 2, "lambda_u": lambda_u, "lambda_s": lambda_s, "lambda_ss": lambda_ss}


# ---- from sheet to answers ----

PARAMETERS = "r", "e", "m", "A", "B", "g", "mu", "epsilon"
LEVELS_1_TO_5 = rhs, equilibrium, hopf, harmonic_balance, slow_manifold
LEVELS_6_TO_10 = trajectory, limit_cycle, heteroclinic, near_heteroclinic, rotating_cycle, rotation_fold
KINDS = {function.__name__.replace("_", "-"): function for function in LEVELS_1_TO_5 + LEVELS_6_TO_10}


def answered(rows):
    """The answers to a sheet's rows, by id; entries of one kind and friction law are computed together."""
    groups = {}
    for row in rows:
        if row["kind"] not in KINDS:
            continue
        entry, name = row["id"].rsplit("/", 1)
        groups.setdefault((row["kind"], row["friction"]), {}).setdefault(entry, {})[name] = row
    answers = {}
    for (kind, friction), entries in groups.items():
        firsts = [next(iter(entry.values())) for entry in entries.values()]
        given = {column: np.array([row[column] for row in firsts]) for column in ("equilibrium", "form")}
        for column in PARAMETERS + ("Omega", "beta", "gamma", "v"):
            given[column] = np.array([float(row[column] or "nan") for row in firsts])
        p = tuple(given[column] for column in PARAMETERS)
        asked = {name for entry in entries.values() for name in entry}
        with np.errstate(all="ignore"):
            results = KINDS[kind](p, friction == "smooth", given, asked)
        for k, entry in enumerate(entries.values()):
            for name, row in entry.items():
                answers[row["id"]] = float(results[name][k]) if name in results else np.nan
    return answers


def main(sheet, target):
    """Answer a sheet; what has no value is left out."""
    with open(sheet, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    with open(target, "w", encoding="utf-8") as file:
        file.write("id,answer,from\n")
        file.writelines(f"{name},{x!r},doubles\n" for name, x in answered(rows).items() if np.isfinite(x))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python client.py SHEET.csv ANSWERS.csv")
    main(sys.argv[1], sys.argv[2])
