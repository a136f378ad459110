# ---- flights: the explicit Runge-Kutta method of Cooper and Verner, order 8 in 11 stages ----

S = 21**0.5
STAGES = (
    [1 / 2],
    [1 / 4, 1 / 4],
    [1 / 7, (-7 - 3 * S) / 98, (21 + 5 * S) / 49],
    [(11 + S) / 84, 0, (18 + 4 * S) / 63, (21 - S) / 252],
    [(5 + S) / 48, 0, (9 + S) / 36, (-231 + 14 * S) / 360, (63 - 7 * S) / 80],
    [
        (10 - S) / 42,
        0,
        (-432 + 92 * S) / 315,
        (633 - 145 * S) / 90,
        (-504 + 115 * S) / 70,
        (63 - 13 * S) / 35,
    ],
    [1 / 14, 0, 0, 0, (14 - 3 * S) / 126, (13 - 3 * S) / 63, 1 / 9],
    [1 / 32, 0, 0, 0, (91 - 21 * S) / 576, 11 / 72, (-385 - 75 * S) / 1152, (63 + 13 * S) / 128],
    [
        1 / 14,
        0,
        0,
        0,
        1 / 9,
        (-733 - 147 * S) / 2205,
        (515 + 111 * S) / 504,
        (-51 - 11 * S) / 56,
        (132 + 28 * S) / 245,
    ],
    [0, 0, 0, 0, (-42 + 7 * S) / 18, (-18 + 28 * S) / 45, (-273 - 53 * S) / 72, (301 + 53 * S) / 72]
    + [(28 - 28 * S) / 45, (49 - 7 * S) / 18],
    [1 / 20, 0, 0, 0, 0, 0, 0, 49 / 180, 16 / 45, 49 / 180, 1 / 20],
)  # the last row holds the weights
TABLEAU = [np.array(row) for row in STAGES]
FLIGHT_STEP = 0.005
# Seconds for which an orbit is followed to its crossings, and until it lies flat
MAX_FLIGHT = 10
# Seconds to a section; a longer flight passes a saddle closer than doubles can resolve
LONGEST = 2.8


def runge_kutta_step(rates, p, Omega, smooth, state, h):
    """Return the states after one Runge-Kutta step of length h, which may differ between the
    entries.
    """
    slopes = np.empty((len(TABLEAU), state.size))
    stage = state
    for i, row in enumerate(TABLEAU):
        slopes[i] = rates(p, Omega, smooth, stage).ravel()
        stage = state + h * (row @ slopes[: i + 1]).reshape(state.shape)
    return stage


def flow(p, Omega, smooth, state):
    """Return the rates of motion (beta', gamma', v') at a state."""
    beta, gamma, v = state
    M, h, f_G, w_y, gamma_y, lambda_Ty, gamma_rate, v_rate, *_ = equations(
        p, Omega, smooth, beta, gamma, v
    )
    return np.array([v, gamma_rate, v_rate])


def variational_flow(p, Omega, smooth, state):
    """Return the rates of a state, of its three variations and of the divergence's integral.

    The third variation is the one with respect to Omega.
    """
    beta, gamma, v = state[:3]
    delta_beta, delta_gamma, delta_v = state[3:6], state[6:9], state[9:12]
    dv_rate_dbeta, dv_rate_dgamma, dv_rate_dv, dv_rate_domega, v_rate = derivatives(
        p, Omega, smooth, beta, gamma, v
    )
    delta_gamma_rate = Omega * sin(beta) * delta_beta
    delta_v_rate = dv_rate_dbeta * delta_beta + dv_rate_dgamma * delta_gamma + dv_rate_dv * delta_v
    delta_gamma_rate[2] -= cos(beta)
    delta_v_rate[2] += dv_rate_domega
    return np.concatenate(
        [[v, -Omega * cos(beta), v_rate], delta_v, delta_gamma_rate, delta_v_rate, [dv_rate_dv]]
    )


def flight_step(rates, p, Omega, smooth, state, h):
    """Return the states after a Runge-Kutta step, taken in two parts where gamma_y passes zero.

    There the second derivative of the smooth law jumps.
    """
    after = runge_kutta_step(rates, p, Omega, smooth, state, h)
    if smooth:
        gamma_y_before = equations(p, Omega, smooth, *state[:3])[4]
        gamma_y_after = equations(p, Omega, smooth, *after[:3])[4]
        slips = gamma_y_before * gamma_y_after < 0
        if slips.any():
            some_p, some_omega = (
                tuple((parameter + 0 * Omega)[slips] for parameter in p),
                Omega[slips],
            )
            before, gamma_y, length = (
                gamma_y_before[slips],
                gamma_y_after[slips],
                (h + 0 * Omega)[slips],
            )
            part = length
            for _ in range(3):
                part = part * before / (before - gamma_y)
                middle = runge_kutta_step(rates, some_p, some_omega, smooth, state[:, slips], part)
                gamma_y = equations(some_p, some_omega, smooth, *middle[:3])[4]
            after[:, slips] = runge_kutta_step(
                rates, some_p, some_omega, smooth, middle, length - part
            )
    return after


def fly_to(rates, p, Omega, smooth, state, event, sign=1, longest=LONGEST, h=FLIGHT_STEP):
    """Integrate until a function of the state passes zero, upward for sign 1. Return the time and
    the state.

    They are NaN where the function never passes zero.
    """
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
        change = np.where(
            value == value_before, 0, value * (tau - tau_before) / (value_before - value)
        )
        tau, tau_before, value_before = tau + change, tau, value
    return time + tau, flight_step(rates, p, Omega, smooth, before, tau)


def trajectory(p, smooth, inputs, quantities):
    """Answer the questions of level 6: states at given times, crossings of beta = pi/2, and when
    the disk lies flat.
    """
    names = "beta", "gamma", "v"
    Omega, state, time = inputs["Omega"], np.array([inputs[name] for name in names]), 0
    answers = {"flat_time": np.full(len(Omega), np.nan)}
    for sample in sorted(
        {0.01} | {float(name.split("@")[1]) for name in quantities if "@" in name}
    ):
        h = (sample - time) / np.ceil((sample - time) / FLIGHT_STEP)
        while time < sample - h / 2:
            state, time = flight_step(flow, p, Omega, smooth, state, h), time + h
        answers.update(zip((f"{name}@{sample:g}" for name in names), state))
    # Events count from 0.01 s on; sin(2 beta) is zero where beta = pi/2, and where the disk lies
    # flat.
    state, time, n = np.array([answers[f"{name}@0.01"] for name in names]), 0.01, 0
    side = np.sign(state[0] - pi / 2)
    while n == 0 or (time < MAX_FLIGHT).any():
        passed, state = fly_to(
            flow, p, Omega, smooth, state, lambda s: sin(2 * s[0]), side, MAX_FLIGHT, 0.01
        )
        time, side, n = time + passed, -side, n + 1
        flat = abs(state[0] - pi / 2) > 1
        answers["flat_time"] = np.where(flat, time, answers["flat_time"])
        state = np.where(flat, np.nan, state)
        answers.update(
            zip(
                (f"crossing_time#{n}", f"crossing_gamma#{n}", f"crossing_v#{n}"), (time, *state[1:])
            )
        )
    return answers


# ---- cycles, from a section to itself: beta = pi/2 with the symmetry (index 0), gamma = pi/2 + 2 pi (index 1) ----

# For each section: the number of returns in a period, and the names of x and v in questions.
SECTIONS = (2, "gamma_bar_0", "v_0"), (1, "beta_bar_top", "v_top")


def section_state(Omega, index, x, v):
    """Return an orbit's start on a section, a state with its variations and the divergence's
    integral.

    x is gamma - pi/2 for index 0, beta - pi/2 for index 1.
    """
    state = np.zeros((13,) + Omega.shape)
    state[:3] = pi / 2 + index * x, pi / 2 + (1 - index) * x, v
    state[[6 - 3 * index, 10]] = 1  # the first variation begins along x, the second along v
    return state


def section_return(rates, p, Omega, smooth, index, x, v, h=FLIGHT_STEP):
    """Fly from the point (x, v) of a section until the orbit returns to the section. Return the
    time, x, v and state of the return.
    """
    state = section_state(Omega, index, x, v)
    state = state[:3] if rates is flow else state
    time, end = fly_to(
        rates, p, Omega, smooth, state, lambda s: s[index] - pi / 2 - 2 * pi * index, h=h
    )
    return time, (2 * index - 1) * (end[1 - index] - pi / 2), (2 * index - 1) * end[2], end


def return_derivative(p, Omega, smooth, index, end):
    """Return the derivatives of the return time, and of (x, v) at the return.

    They are derivatives with respect to x, v and Omega at the start.
    """
    end_rate = flow(p, Omega, smooth, end[:3])
    delta = end[3:12].reshape((3, 3) + Omega.shape)
    dtime = -delta[index] / end_rate[index]
    delta = (2 * index - 1) * (delta + end_rate[:, np.newaxis] * dtime)
    return dtime, np.moveaxis(delta[[1 - index, 2]], 2, 0)


def cycle_derivatives(p, Omega, smooth, index, end):
    """Return a cycle's multipliers and its derivatives with respect to Omega, by name.

    ``end`` is the state with variations at the return.
    """
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
    """Return the largest beta on a cycle, and on a rotating one the state next to the saddle.

    ``end`` is the state at the return.
    """
    time_highest, highest = fly_to(flow, p, Omega, smooth, end[:3], lambda s: s[2], -1)
    if index == 0:
        return {"beta_max": highest[0] - pi / 2}
    time_low, low = fly_to(flow, p, Omega, smooth, end[:3], lambda s: s[1] - 7 * pi / 2)
    return {"beta_max": highest[0] - pi / 2, "beta_bar_0": low[0] - pi / 2, "v_0": low[2]}


def cycle_answers(p, Omega, smooth, index, time, x, v, end):
    """Return the answers to all questions about a cycle, by name.

    x and v are its start on the section, and ``time`` and ``end`` are those of its return.
    """
    parts, x_name, v_name = SECTIONS[index]
    answers = {"omega": Omega, "period": parts * time, x_name: x, v_name: v}
    answers.update(cycle_derivatives(p, Omega, smooth, index, end))
    answers.update(cycle_extremes(p, Omega, smooth, index, end))
    return answers


def cycle(p, Omega, smooth, index, stable, fold=False, h=FLIGHT_STEP):
    """Find a limit cycle and return the answers to the questions about it, by name.

    For a ``fold`` it is the cycle where dOmega/dx is zero. The answers are NaN where no cycle was
    found.
    """
    # Stable cycles lie where returns begin to lead inward, unstable ones where they stop doing so.
    # The first return only lets the orbit settle.
    columns = tuple(parameter[:, np.newaxis] for parameter in p)
    speeds = Omega[:, np.newaxis] + np.zeros(60)
    x_next, v_next = np.linspace((3.1, 0.1)[index], (0.01, 1)[index], 60) + 0 * speeds, 0 * speeds
    for _ in range(2):
        x, v = x_next, v_next
        time, x_next, v_next, end = section_return(
            flow, columns, speeds, smooth, index, x, v, 2 * FLIGHT_STEP
        )
    towards = (2 * index - 1) * (x_next - x) < 0
    away = ~towards & np.logical_or.accumulate(towards, axis=1)
    chosen = np.arange(len(Omega)), np.where(stable, towards.argmax(axis=1), away.argmax(axis=1))
    x, v = np.where(stable, [x_next[chosen], v_next[chosen]], [x[chosen], v[chosen]])
    free, fixed, step, slope = ([1, 2], 0, 0.02, 0) if fold else ([0, 1], 2, 0, 0)
    for k in range(20 if fold else 11):
        time, x_next, v_next, end = section_return(
            variational_flow, p, Omega, smooth, index, x, v, h
        )
        derivative = return_derivative(p, Omega, smooth, index, end)[1]
        # The cycle closes by a change of x, v and Omega. One of them is fixed, or takes a chosen
        # step; the others follow.
        matrix = derivative - np.eye(2, 3)
        sides = np.stack([np.array([x - x_next, v - v_next]).T, -matrix[:, :, fixed]], axis=2)
        newton, tangent = np.linalg.solve(matrix[:, :, free], sides).T
        # Stable cycles attract
        newton = np.where(stable & (k < 2), [x_next - x, v_next - v], newton)
        if fold:
            step = np.clip(-tangent[1] * step / (tangent[1] - slope), -0.02, 0.02)
            slope = tangent[1]
        change = np.zeros((3,) + Omega.shape)
        change[free], change[fixed] = newton + tangent * step, step
        x, v, Omega = np.array([x, v, Omega]) + change
        if not (abs(change) > 2e-8).any():
            break
    answers = cycle_answers(p, Omega, smooth, index, time, x, v, end)
    # Newton's method also comes to rest at the equilibrium, within some 1e-8 of it: there is no
    # cycle then.
    return {name: np.where(hypot(x, v) > 1e-6, values, np.nan) for name, values in answers.items()}


def limit_cycle(p, smooth, inputs, quantities):
    """Answer the questions of level 7 about the limit cycle at a speed."""
    return cycle(p, inputs["Omega"], smooth, 0, True)


def near_heteroclinic(p, smooth, inputs, quantities):
    """Answer the questions of level 9: the limit cycle near Omega_h, on which errors grow next to
    the saddles.
    """
    return cycle(p, inputs["Omega"], smooth, 0, True, h=FLIGHT_STEP / 2 if smooth else FLIGHT_STEP)


def rotating_cycle(p, smooth, inputs, quantities):
    """Answer the questions of level 10 about a rotating cycle, the stable or the unstable one."""
    return cycle(p, inputs["Omega"], smooth, 1, inputs["form"] == "stable")


def rotation_fold(p, smooth, inputs, quantities):
    """Answer the questions of level 10 about the fold of rotating cycles, reached from the unstable
    cycle at the Hopf point's speed.
    """
    return cycle(p, critical_speed(p), smooth, 1, False, fold=True)


def heteroclinic(p, smooth, inputs, quantities):
    """Answer the questions of level 8: find Omega_h by repeatedly cutting an interval that holds it
    into a hundred.
    """
    columns = tuple(parameter[:, np.newaxis] for parameter in p)
    low, width = 0.9 * critical_speed(p), 0.1 * critical_speed(p)
    for _ in range(5):
        width = width / 100
        Omega = low[:, np.newaxis] + width[:, np.newaxis] * np.arange(101)
        # Below Omega_h the saddle's unstable orbit passes gamma = 3 pi/2 before it comes back to
        # beta = pi/2.
        lambda_u = sorted_eigenvalues(linearisation(p, low, -1)).real[:, :1] + 0 * Omega
        state = np.array(
            [pi / 2 + 1e-3 + 0 * Omega, -pi / 2 + 1e-3 * Omega / lambda_u, 1e-3 * lambda_u]
        )
        time, end = fly_to(
            flow,
            columns,
            Omega,
            smooth,
            state,
            lambda s: np.maximum(s[1] - 3 * pi / 2, pi / 2 - s[0]),
        )
        low = low + width * ((end[1] - 3 * pi / 2 > pi / 2 - end[0]).sum(axis=1) - 1)
    lambda_u, lambda_s, lambda_ss = sorted_eigenvalues(linearisation(p, low, -1)).real.T
    return {
        "omega_h": low + width / 2,
        "lambda_u": lambda_u,
        "lambda_s": lambda_s,
        "lambda_ss": lambda_ss,
    }


# ---- from sheet to answers ----

PARAMETERS = "r", "e", "m", "A", "B", "g", "mu", "epsilon"
LEVELS_1_TO_5 = rhs, equilibrium, hopf, harmonic_balance, slow_manifold
LEVELS_6_TO_10 = (
    trajectory,
    limit_cycle,
    heteroclinic,
    near_heteroclinic,
    rotating_cycle,
    rotation_fold,
)
KINDS = {
    function.__name__.replace("_", "-"): function for function in LEVELS_1_TO_5 + LEVELS_6_TO_10
}


def answered(rows):
    """Return the answers to all questions in a sheet's rows, by id; NaN for those without a value.

    Entries of one kind and friction law are computed together.
    """
    groups = {}
    for row in rows:
        if row["kind"] not in KINDS:
            continue
        entry, name = row["id"].rsplit("/", 1)
        groups.setdefault((row["kind"], row["friction"]), {}).setdefault(entry, {})[name] = row
    answers = {}
    for (kind, friction), entries in groups.items():
        firsts = [next(iter(entry.values())) for entry in entries.values()]
        inputs = {
            column: np.array([row[column] for row in firsts]) for column in ("equilibrium", "form")
        }
        for column in PARAMETERS + ("Omega", "beta", "gamma", "v"):
            inputs[column] = np.array([float(row[column] or "nan") for row in firsts])
        p = tuple(inputs[column] for column in PARAMETERS)
        quantities = {name for entry in entries.values() for name in entry}
        with np.errstate(all="ignore"):
            results = KINDS[kind](p, friction == "smooth", inputs, quantities)
        for k, entry in enumerate(entries.values()):
            for name, row in entry.items():
                answers[row["id"]] = float(results[name][k]) if name in results else np.nan
    return answers


def main(sheet, target):
    """Read a sheet of questions (CSV) and write the answers to the file ``target``.

    Questions whose answer is not a finite number are left out.
    """
    with open(sheet, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    with open(target, "w", encoding="utf-8") as file:
        file.write("id,answer,from\n")
        file.writelines(
            f"{name},{x!r},doubles\n" for name, x in answered(rows).items() if np.isfinite(x)
        )


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python client.py SHEET.csv ANSWERS.csv")
    main(sys.argv[1], sys.argv[2])
