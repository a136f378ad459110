"""Faults for `blind_program.py`, one to a sheet, written down before any of them was graded.

A fault is its name, what a true diagnosis has to say in some words, and replacements in the program's text, each of a
text that stands there once. They were chosen from the paper, the sheet and `docs/grading.md`, without a look at how
the diagnosis works.
"""

__all__ = ["CORRECT", "FAULTS"]

H = "h = h1 + h2 + h3 + h4 + h5"
FORCE = "v_rate = (h + f_G + w_y * lambda_Ty) / M"
SLIP = "gamma_y = rho * v * sb - e * Omega * sb**2 * cg"
SMOOTH = "lambda_Ty = -mu * m * g * gamma_y / (size + eps)"
LINEAR = "lambda_Ty = -mu * m * g / eps * gamma_y"
READ = "    return tuple(float(row[name]) for name in PARAMETERS)\n"
TEXT = "    return repr(float(value))"
JACOBIAN = "return np.array([[0, 0, 1], [gb, gg, gv], [vb, vg, vv]])"
RUN = "    return odeint(lambda t, y: f(y.tolist()), y0, times, tfirst=True, rtol=1e-13, atol=1e-13, mxstep=100000)"
SAMPLE = '{"beta": orbit[i, 0], "gamma": orbit[i, 1], "v": orbit[i, 2]}'
CROSSING = '{"crossing_time": time, "crossing_gamma": gamma, "crossing_v": v}'
ORBIT = "orbit, crossings, flat, last = run("
SCALES = "sorted(values, key=lambda x: (-round(x.real, 9), -x.imag))"


def changed(name, value):
    """The program with one parameter replaced as it is read."""
    return (
        READ,
        f"    p = dict(zip(PARAMETERS, [float(row[name]) for name in PARAMETERS]))\n    p[{name!r}] = {value}\n"
        "    return tuple(p.values())\n",
    )


def solver(method, tolerance):
    return (
        RUN,
        f"    times = np.asarray(times, float)\n    if times[-1] == 0:\n        return np.array([y0, y0])\n"
        f"    run = solve_ivp(lambda t, y: f(y.tolist()), (0, times[-1]), y0, {method!r}, times, rtol={tolerance}, "
        f"atol={tolerance if tolerance < 1e-3 else 1e-6})\n    return run.y.T",
    )


def fixed(step, width):
    """A one-step method with fixed steps of this width; `step` sets z from y and d."""
    return (
        RUN,
        f"""    y, found = np.array(y0, float), [np.array(y0, float)]
    for a, b in itertools.pairwise(times):
        count = max(math.ceil((b - a) / {width} - 1e-6), 1)
        d = (b - a) / count
        for _ in range(count):
            {step}
            y = z
        found.append(y)
    return np.array(found)""",
    )


def moved(kind, order):
    """Answers of one kind exchanged between the rows of each quantity and law."""
    return (
        "    return answers\n",
        f"""    groups = {{}}
    for name in answers:
        if {kind!r} in name:
            groups.setdefault((name.split("/")[1], name.rsplit("/", 1)[1]), []).append(name)
    for names in groups.values():
        old = [answers[name] for name in names]
        answers.update(zip(names, {order}))
    return answers
""",
    )


RK4 = """k1 = np.array(f(y.tolist()))
            k2 = np.array(f((y + d / 2 * k1).tolist()))
            k3 = np.array(f((y + d / 2 * k2).tolist()))
            k4 = np.array(f((y + d * k3).tolist()))
            z = y + d / 6 * (k1 + 2 * k2 + 2 * k3 + k4)"""
EULER = "z = y + d * np.array(f(y.tolist()))"

FAULTS = [
    # ---- level 1: the equations
    (
        "h1-sign",
        "the first term of h, with Omega^2 sin b cos b, has the wrong sign",
        (H, "h = -h1 + h2 + h3 + h4 + h5"),
    ),
    ("h5-sign", "h's term with 3 sin^2 b - 2 has the wrong sign", (H, "h = h1 + h2 + h3 + h4 - h5")),
    ("h2-factor", "the factor 2 before (A - Bbar) is missing", ("h2 = -2 * (A - Bbar)", "h2 = -(A - Bbar)")),
    ("h4-square", "cos^2 b for cos^3 b in h's fourth term", ("sb * cb**3 * sg", "sb * cb**2 * sg")),
    ("h5-bracket", "3 sin^2 b - 1 for 3 sin^2 b - 2", ("(3 * sb**2 - 2)", "(3 * sb**2 - 1)")),
    ("h1-omega", "Omega for Omega^2 in h's first term", ("h1 = inertia * Omega**2", "h1 = inertia * Omega")),
    ("h5-sine", "sin g for cos g in h's last term", ("Omega * v * cb * cg", "Omega * v * cb * sg")),
    (
        "inertia-swapped",
        "sin^2 g and cos^2 g swapped (A and Bbar swapped) in the inertia",
        ("inertia = A * cg**2 + Bbar * sg**2", "inertia = A * sg**2 + Bbar * cg**2"),
    ),
    ("M-sine", "sin^2 b for cos^2 b in M", ("inertia + m * rho**2 * cb**2", "inertia + m * rho**2 * sb**2")),
    ("M-steiner", "M lacks m rho^2 cos^2 b", ("M = inertia + m * rho**2 * cb**2", "M = inertia")),
    ("Bbar-plus", "Bbar = B + m e^2", ("Bbar = B - m * e**2\n    sb, cb, sg", "Bbar = B + m * e**2\n    sb, cb, sg")),
    ("Bbar-B", "B for Bbar", ("Bbar = B - m * e**2\n    sb, cb, sg", "Bbar = B\n    sb, cb, sg")),
    ("rho-r", "rho = r", ("rho = r + e * sg\n    inertia = A * cg**2", "rho = r\n    inertia = A * cg**2")),
    ("f_G-sine", "sin b for cos b in f_G", ("f_G = -m * g * rho * cb", "f_G = -m * g * rho * sb")),
    ("f_G-mass", "f_G lacks m", ("f_G = -m * g * rho * cb", "f_G = -g * rho * cb")),
    ("w_y-cosine", "cos b for sin b in w_y", ("w_y = rho * sb", "w_y = rho * cb")),
    ("w_y-sine", "w_y lacks sin b", ("w_y = rho * sb", "w_y = rho")),
    ("slip-square", "sin b for sin^2 b in gamma_y", (SLIP, SLIP.replace("sb**2", "sb"))),
    (
        "slip-sin-of-square",
        "sin(b^2) for sin^2 b in gamma_y, as printed",
        (SLIP, SLIP.replace("sb**2", "o.sin(beta**2)")),
    ),
    ("slip-sign", "gamma_y's second term has the wrong sign", (SLIP, SLIP.replace("- e", "+ e"))),
    ("slip-sine", "sin g for cos g in gamma_y", (SLIP, SLIP.replace("cg", "sg"))),
    ("slip-r", "r for rho in gamma_y", (SLIP, SLIP.replace("rho", "r"))),
    ("gamma-sign", "gamma' has the wrong sign", ("gamma_rate = -Omega * cb", "gamma_rate = Omega * cb")),
    ("v-no-friction", "v' lacks friction", (FORCE, "v_rate = (h + f_G) / M")),
    ("v-no-w_y", "lambda_Ty is not multiplied by w_y in v'", (FORCE, "v_rate = (h + f_G + lambda_Ty) / M")),
    ("v-h-left", "h has the wrong sign in v'", (FORCE, "v_rate = (-h + f_G + w_y * lambda_Ty) / M")),
    (
        "friction-sign",
        "lambda_Ty has the wrong sign in the linear law",
        (LINEAR, "lambda_Ty = mu * m * g / eps * gamma_y"),
    ),
    ("friction-no-epsilon", "the linear law is not divided by epsilon", (LINEAR, "lambda_Ty = -mu * m * g * gamma_y")),
    ("smooth-no-mass", "the smooth law lacks m", (SMOOTH, "lambda_Ty = -mu * g * gamma_y / (size + eps)")),
    ("smooth-tanh", "another smooth law: tanh", (SMOOTH, "lambda_Ty = -mu * m * g * o.tanh(gamma_y / eps)")),
    (
        "smooth-root",
        "another smooth law: the root of squares",
        (SMOOTH, "lambda_Ty = -mu * m * g * gamma_y / o.sqrt(gamma_y**2 + eps**2)"),
    ),
    ("linear-is-smooth", "the smooth law for the linear one", (LINEAR, SMOOTH)),
    (
        "smooth-set-valued",
        "the set-valued law -mu m g sign(gamma_y) for the smooth one",
        (SMOOTH, "lambda_Ty = -mu * m * g * gamma_y / size"),
    ),
    ("smooth-no-modulus", "the smooth law lacks the modulus of gamma_y", (SMOOTH, SMOOTH.replace("size", "gamma_y"))),
    # ---- level 1: parameters, units and conventions
    ("g-9.8", "g = 9.8", changed("g", "9.8")),
    ("parameters-single", "single precision", (READ, READ.replace("float(row[name])", "float(np.float32(row[name]))"))),
    ("g-standard", "g = 9.80665", changed("g", "9.80665")),
    (
        "mu-epsilon",
        "mu and epsilon swapped",
        (READ, READ.replace("PARAMETERS)", '("r", "e", "m", "A", "B", "g", "epsilon", "mu"))')),
    ),
    ("e-ten", "e = 0.025, ten times too large", changed("e", "0.025")),
    ("r-diameter", "r = 0.09, the diameter", changed("r", "0.09")),
    ("m-digits", "m = 0.453", changed("m", "0.453")),
    ("A-printed-to-two", "A = 0.25e-3", changed("A", "0.25e-3")),
    (
        "other-disk",
        "the disk `calibrated`: A = 0.24884e-3 and B = 0.22656e-3",
        (
            READ,
            '    p = dict(zip(PARAMETERS, [float(row[name]) for name in PARAMETERS]))\n    p |= {"A": 0.24884e-3, "B": 0.22656e-3}\n'
            "    return tuple(p.values())\n",
        ),
    ),
    ("rhs-degrees", "angles taken for degrees", ('names = ("M"', 'y[:2] = np.radians(y[:2])\n    names = ("M"')),
    ("rhs-beta-bar", "beta taken for beta - pi/2", ('names = ("M"', 'y[0] += HALF_PI\n    names = ("M"')),
    (
        "rhs-omega-sign",
        "Omega has the wrong sign",
        ('    Omega = float(row["Omega"])\n    y = [', '    Omega = -float(row["Omega"])\n    y = ['),
    ),
    ("rhs-v-sign", "v has the wrong sign", ('names = ("M"', 'y[2] = -y[2]\n    names = ("M"')),
    (
        "rhs-state-rounded",
        "the state read with two decimals",
        ('names = ("M"', 'y = [round(z, 2) for z in y]\n    names = ("M"'),
    ),
    # ---- level 1: derivatives and figures
    (
        "derivatives-forward",
        "forward differences with the step 1e-6 for derivatives",
        (
            "    J = jacobian(p, Omega, smooth, y)\n",
            "    J = np.array([(np.array(rates(p, Omega, smooth, [*np.add(y, 1e-6 * unit)])) - rates(p, Omega, smooth, y)) / 1e-6"
            " for unit in np.eye(3)]).T\n",
        ),
    ),
    (
        "derivatives-swapped",
        "the derivatives by beta and gamma are swapped",
        (
            'found["dv_rate_dbeta"] = J[2, 0]\n    found["dv_rate_dgamma"] = J[2, 1]',
            'found["dv_rate_dbeta"] = J[2, 1]\n    found["dv_rate_dgamma"] = J[2, 0]',
        ),
    ),
    (
        "derivatives-linear",
        "the linear law's derivatives for the smooth law",
        ("    J = jacobian(p, Omega, smooth, y)\n", "    J = jacobian(p, Omega, False, y)\n"),
    ),
    ("derivatives-mass", "the derivative of 1/M is left out", (FORCE, FORCE.replace("/ M", "/ M.real"))),
    ("text-4f", "four decimals", (TEXT, "    return f'{value:.4f}'")),
    ("text-g", "six significant digits (%g)", (TEXT, "    return f'{value:g}'")),
    ("text-single", "single precision", (TEXT, "    return repr(float(np.float32(value)))")),
    # ---- level 2
    ("eigenvalues-unsorted", "eigenvalues in another order", (SCALES, "list(values)")),
    (
        "eigenvalues-ascending",
        "eigenvalues in ascending order",
        (SCALES, "sorted(values, key=lambda x: (round(x.real, 9), -x.imag))"),
    ),
    (
        "eigenvalues-conjugate",
        "the conjugate pair in the other order (imaginary parts' signs)",
        (SCALES, "sorted(values, key=lambda x: (-round(x.real, 9), x.imag))"),
    ),
    ("equilibrium-swapped", "the other equilibrium", ('== "inverted" else', '!= "inverted" else')),
    (
        "equilibrium-inverted-only",
        "the inverted equilibrium's eigenvalues for the noninverted one",
        ('gamma = HALF_PI if row["equilibrium"] == "inverted" else -HALF_PI', "gamma = HALF_PI"),
    ),
    ("eigenvalues-modulus", "the modulus for the real part", ('_re"] = value.real', '_re"] = abs(value)')),
    (
        "eigenvalues-hertz",
        "imaginary parts divided by 2 pi",
        ('_im"] = value.imag', '_im"] = value.imag / (2 * math.pi)'),
    ),
    (
        "eigenvalues-differences",
        "a finite-difference Jacobian",
        (
            "# ---- jacobian\ndef jacobian(p, Omega, smooth, y):\n",
            "# ---- jacobian\ndef jacobian(p, Omega, smooth, y):\n    if y[2] == 0:\n        return np.array([(np.array(rates(p, Omega, smooth, [*np.add(y, 1e-5 * unit)]))"
            " - rates(p, Omega, smooth, y)) / 1e-5 for unit in np.eye(3)]).T\n",
        ),
    ),
    ("pi-3.1416", "pi = 3.1416", ("HALF_PI = math.pi / 2", "HALF_PI = 3.1416 / 2")),
    # ---- level 3
    (
        "crit-B",
        "B for Bbar in Omega_crit",
        (
            "    return math.sqrt(m * g * (r + e) ** 2 / (Bbar * r))",
            "    return math.sqrt(m * g * (r + e) ** 2 / (B * r))",
        ),
    ),
    (
        "crit-square",
        "Omega_crit lacks the square of r + e (r cancelled): sqrt(m g (r + e) / Bbar)",
        ("    return math.sqrt(m * g * (r + e) ** 2 / (Bbar * r))", "    return math.sqrt(m * g * (r + e) / Bbar)"),
    ),
    (
        "crit-hertz",
        "Omega_crit in revolutions per second",
        ('"omega_crit": critical_speed(p)', '"omega_crit": critical_speed(p) / (2 * math.pi)'),
    ),
    ("hopf-half-period", "half the period", ('"period": 2 * math.pi / omega,', '"period": math.pi / omega,')),
    (
        "hopf-period-ms",
        "the period in milliseconds",
        ('"period": 2 * math.pi / omega,', '"period": 2e3 * math.pi / omega,'),
    ),
    ("hopf-no-2pi", "the period lacks 2 pi", ('"period": 2 * math.pi / omega,', '"period": 1 / omega,')),
    ("lyapunov-omega", "l_1 is not divided by the frequency", ("c1.real / omega,", "c1.real,")),
    ("lyapunov-two", "l_1 is twice as large (Re g21 / omega)", ("c1.real / omega,", "2 * c1.real / omega,")),
    (
        "lyapunov-norm",
        "l_1 with q's component beta set to 1",
        ("c1.real / omega,", "c1.real / omega / abs(q[0]) ** 2,"),
    ),
    (
        "transversality-sign",
        "the wrong sign of the transversality",
        ('"transversality": transversality', '"transversality": -transversality'),
    ),
    (
        "transversality-imaginary",
        "the derivative of the imaginary part",
        ('"transversality": transversality', '"transversality": by_Omega.imag'),
    ),
    (
        "amplitude-root",
        "the root of the slope: the amplitude's instead of its square's",
        ("4 * abs(q[0]) ** 2 * square", "math.sqrt(4 * abs(q[0]) ** 2 * square)"),
    ),
    (
        "amplitude-half",
        "the amplitude is half as large: |z q| for 2 |z q|",
        ("4 * abs(q[0]) ** 2 * square", "abs(q[0]) ** 2 * square"),
    ),
    ("period-slope-sign", "dT/dOmega: the wrong sign", ('"period_slope": -2 *', '"period_slope": 2 *')),
    (
        "period-slope-linear",
        "the period slope lacks the cubic terms' part",
        ("(-by_Omega.imag + c1.imag * square)", "(-by_Omega.imag)"),
    ),
    # ---- level 4
    ("consistent-is-printed", "the printed law for the consistent one", ('row["form"] == "consistent"', "False")),
    ("printed-is-consistent", "the consistent law for the printed one", ('row["form"] == "consistent"', "True")),
    (
        "consistent-delta-only",
        "the consistent law has the printed chi",
        ("        chi = chi + Bbar * e**2 / (2 * (r + e))\n", ""),
    ),
    ("delta-sign", "delta has the wrong sign", ("e / (r + e) - stiffness", "e / (r + e) + stiffness")),
    ("delta-quarter", "1/4 for 1/8 in delta", ("* C**2 / 8)", "* C**2 / 4)")),
    (
        "delta-missing",
        "delta is missing: the frequency of the linear system",
        (" - stiffness / (r + e) * C**2 / 8", ""),
    ),
    ("C-two", "the factor 2 of C is missing", ("C = 2 * math.sqrt(e", "C = math.sqrt(e")),
    ("C-root", "C lacks sqrt(e / (r + e))", ("C = 2 * math.sqrt(e / (r + e)) *", "C = 2 *")),
    ("chi-e", "r - e for r - 2 e in chi", ("chi = A * (r - 2 * e)", "chi = A * (r - e)")),
    ("hb-degrees", "the amplitude in degrees", ('"amplitude": C', '"amplitude": math.degrees(C)')),
    ("hb-hertz", "the frequency in Hz", ('"frequency": frequency', '"frequency": frequency / (2 * math.pi)')),
    ("hb-B", "B for Bbar in the law of one harmonic", ("    Bbar = B - m * e**2\n    chi", "    Bbar = B\n    chi")),
    # ---- level 5
    ("h_0-sign", "h_0 has the wrong sign", ("h = [e * Omega", "h = [-e * Omega")),
    (
        "h_1-sign",
        "h_1 has the wrong sign",
        (
            "h.append((force - M * change) / drag)",
            "h.append((M * change - force if n == 1 else force - M * change) / drag)",
        ),
    ),
    (
        "h-epsilon",
        "h_n is multiplied by epsilon^n",
        ('found[f"h_{n}"] = term.c[0, 0]', 'found[f"h_{n}"] = eps**n * term.c[0, 0]'),
    ),
    (
        "h-partial-sums",
        "partial sums for the terms h_n",
        ('found[f"h_{n}"] = term.c[0, 0]', 'found[f"h_{n}"] = sum(eps**k * h[k].c[0, 0] for k in range(n + 1))'),
    ),
    (
        "h-cross-terms",
        "h_i dh_j/dbeta is left out but for h_0",
        (
            'change = change + h[n - 1 - i] * h[i].by("beta")',
            'change = change + (h[n - 1 - i] * h[i].by("beta") if i == n - 1 else 0)',
        ),
    ),
    (
        "h-square-terms",
        "products h_i h_j of the term with v^2 are left out from h_2 on",
        (
            "force = force + square * h[i] * h[n - 1 - i]",
            "force = force + (square * h[i] * h[n - 1 - i] if n == 1 else 0)",
        ),
    ),
    (
        "h-by-gamma",
        "the derivative by gamma is left out",
        ('change = -Omega * cb * h[n - 1].by("gamma")', "change = constant(0.0)"),
    ),
    (
        "h-shifted",
        "h_(n+1) for h_n: counted from 1",
        ('found[f"h_{n}"] = term.c[0, 0]', 'found[f"h_{n - 1}"] = term.c[0, 0]'),
    ),
    ("h-weight", "the slow manifold lacks f_G", (" - m * g * rho * cb\n    linear", "\n    linear")),
    ("residual-sign", "the residual has the wrong sign", ('= left - right / at["M"]', '= right / at["M"] - left')),
    (
        "residual-epsilon",
        "the residual is divided by epsilon",
        ('= left - right / at["M"]', '= (left - right / at["M"]) / eps'),
    ),
    # ---- level 6
    ("rk45-1e-3", "a tolerance of 1e-3 shows", solver("RK45", 1e-3)),
    ("rk45-1e-6", "a tolerance of 1e-6 shows", solver("RK45", 1e-6)),
    ("rk4-coarse", "RK4 with too large a step", fixed(RK4, 0.01)),
    ("bdf-1e-6", "a tolerance of 1e-6 shows", solver("BDF", 1e-6)),
    ("euler", "the Euler method, or too low an order", fixed(EULER, 2e-4)),
    (
        "event-linear",
        "crossings by linear interpolation",
        (
            "            rest, y = crossing(f, orbit[i], GRID[i + 1] - GRID[i])\n",
            "            rest = (HALF_PI - beta[i]) / (beta[i + 1] - beta[i])\n            y = (1 - rest) * orbit[i] + rest * orbit[i + 1]\n            rest *= 2e-3\n",
        ),
    ),
    (
        "event-nearest",
        "crossings at the next sample: not located",
        (
            "            rest, y = crossing(f, orbit[i], GRID[i + 1] - GRID[i])\n",
            "            rest, y = GRID[i + 1] - GRID[i], orbit[i + 1]\n",
        ),
    ),
    (
        "crossings-rising",
        "rising crossings only: every second one",
        ("if GRID[i] > 0.0095 and (beta[i]", "if GRID[i] > 0.0095 and beta[i] < HALF_PI and (beta[i]"),
    ),
    (
        "crossings-previous",
        "the start counts as the first crossing: the previous crossing",
        (
            'n = int(row["n"]) - 1\n        if n < len(crossings):',
            'n = int(row["n"]) - 1\n        crossings = [(0.0, *start[1:]), *crossings]\n        if n < len(crossings):',
        ),
    ),
    ("crossings-next", "the next crossing", ('n = int(row["n"]) - 1', 'n = int(row["n"])')),
    (
        "samples-shifted",
        "each row has the sample before",
        ('i = round(float(row["t"]) / 2e-3)', 'i = round((float(row["t"]) - 0.5) / 2e-3)'),
    ),
    (
        "samples-late",
        "samples one step of output later",
        ('i = round(float(row["t"]) / 2e-3)', 'i = round(float(row["t"]) / 2e-3) + 1'),
    ),
    (
        "gamma-wrapped",
        "gamma wrapped to (-pi, pi]",
        (SAMPLE, SAMPLE.replace("orbit[i, 1]", "math.remainder(orbit[i, 1], 2 * math.pi)")),
    ),
    (
        "samples-degrees",
        "angles in degrees",
        (
            SAMPLE,
            SAMPLE.replace("orbit[i, 0]", "math.degrees(orbit[i, 0])").replace(
                "orbit[i, 1]", "math.degrees(orbit[i, 1])"
            ),
        ),
    ),
    ("samples-beta-bar", "beta - pi/2 for beta", (SAMPLE, SAMPLE.replace("orbit[i, 0]", "orbit[i, 0] - HALF_PI"))),
    (
        "samples-swapped",
        "gamma and v swapped",
        (SAMPLE, '{"beta": orbit[i, 0], "gamma": orbit[i, 2], "v": orbit[i, 1]}'),
    ),
    (
        "orbits-linear",
        "the linear law's orbits for the smooth law",
        (
            '    orbit, crossings, flat, last = run(p, float(row["Omega"]), row["friction"] == "smooth", start)',
            '    orbit, crossings, flat, last = run(p, float(row["Omega"]), False, start)',
        ),
    ),
    (
        "friction-frozen",
        "the sign of gamma_y in the smooth law is kept from the start",
        (
            "# ---- trajectories\n",
            "# ---- trajectories\ndef frozen(p, Omega, start):\n    r, e, m, A, B, g, mu, eps = p\n"
            "    sign = math.copysign(1.0, model(math, p, Omega, True, *start)[4])\n\n    def f(y):\n        q = model(math, p, Omega, True, *y)\n"
            "        force = -mu * m * g * q[4] / (sign * q[4] + eps)\n        return [y[2], q[6], (q[1] + q[2] + q[3] * force) / q[0]]\n\n    return f\n\n\n",
        ),
        (
            "    orbit = integrate(f, list(start), GRID)\n",
            "    f = frozen(p, Omega, start) if smooth else f\n    orbit = integrate(f, list(start), GRID)\n",
        ),
    ),
    (
        "orbits-other-start",
        "the first start of each speed for both orbits",
        ("    orbit, crossings", "    start = (HALF_PI, -HALF_PI, 2.0)\n    orbit, crossings"),
    ),
    (
        "orbits-omega-rounded",
        "Omega rounded to two decimals",
        (
            '    orbit, crossings, flat, last = run(p, float(row["Omega"])',
            '    orbit, crossings, flat, last = run(p, round(float(row["Omega"]), 2)',
        ),
    ),
    (
        "orbits-start-digits",
        "the start rounded: 1.5708 for pi/2",
        ("    orbit, crossings", "    start = tuple(round(z, 4) for z in start)\n    orbit, crossings"),
    ),
    ("crossings-speed", "the modulus of v at crossings", (CROSSING, CROSSING.replace('_v": v', '_v": abs(v)'))),
    # ---- level 7
    ("cycle-half-period", "half the period", ('"period": 2 * half,', '"period": half,')),
    (
        "cycle-multiplier-squared",
        "the multiplier is squared twice",
        ('"multiplier_slow": slow,', '"multiplier_slow": slow**2,'),
    ),
    (
        "cycle-half-multiplier",
        "the half map's multiplier: not squared",
        ("slow = max(abs(np.linalg.eigvals(by_x))) ** 2", "slow = max(abs(np.linalg.eigvals(by_x)))"),
    ),
    (
        "cycle-log10",
        "log10 for the natural logarithm",
        ('"log_multiplier_slow": math.log(slow)', '"log_multiplier_slow": math.log10(slow)'),
    ),
    (
        "cycle-exponent",
        "the Floquet exponent: the logarithm divided by the period",
        ('"log_multiplier_slow": math.log(slow)', '"log_multiplier_slow": math.log(slow) / (2 * half)'),
    ),
    (
        "cycle-divergence",
        "the slow logarithm is not taken off: the integral of the divergence for log_multiplier_fast",
        ("2 * divergence - math.log(slow)", "2 * divergence"),
    ),
    (
        "cycle-half-divergence",
        "the integral of the divergence over half a period",
        ("2 * divergence - math.log(slow)", "divergence - math.log(slow)"),
    ),
    ("cycle-gamma", "gamma for gamma - pi/2", ('"gamma_bar_0": x[0]', '"gamma_bar_0": HALF_PI + x[0]')),
    (
        "cycle-beta",
        "the largest beta for beta - pi/2",
        ('"beta_max": HALF_PI - deepest', '"beta_max": math.pi - deepest'),
    ),
    (
        "cycle-beta-double",
        "peak to peak: twice beta_max",
        ('"beta_max": HALF_PI - deepest', '"beta_max": 2 * (HALF_PI - deepest)'),
    ),
    (
        "cycle-dperiod-half",
        "half the derivative of the period",
        ("2 * (dtime[:2] @ by_Omega + dtime[2])", "dtime[:2] @ by_Omega + dtime[2]"),
    ),
    (
        "cycle-dperiod-partial",
        "the fixed point's shift is left out of dperiod_domega",
        ("2 * (dtime[:2] @ by_Omega + dtime[2])", "2 * dtime[2]"),
    ),
    (
        "cycle-derivative-sign",
        "derivatives by Omega_crit - Omega: the wrong sign",
        ("by[:, 2])\n    slow", "-by[:, 2])\n    slow"),
        ("dtime[:2] @ by_Omega + dtime[2]", "dtime[:2] @ by_Omega - dtime[2]"),
    ),
    (
        "cycle-linear",
        "the linear law's cycles for the smooth law",
        ("    half, x, by, dtime, divergence", "    smooth = False\n    half, x, by, dtime, divergence"),
    ),
    (
        "cycle-transient",
        "a transient: the orbit after three periods for the cycle",
        (
            "# ---- heteroclinic\n",
            "# ---- heteroclinic\ndef simulated(p, Omega, smooth):\n    y, t = [HALF_PI, HALF_PI + 1.6, -1.7], 0.0\n    for _ in range(6):\n"
            "        orbit = integrate(lambda y: rates(p, Omega, smooth, y), y, np.arange(0, 3, 2e-3))\n"
            "        i = np.flatnonzero(np.diff(np.sign(orbit[3:, 0] - HALF_PI)))[0] + 3\n"
            "        rest, z = crossing(lambda y: rates(p, Omega, smooth, y), orbit[i], 2e-3)\n"
            "        y, t = [HALF_PI, math.pi - z[1], -z[2]], 2e-3 * i + rest\n    return t, np.array([y[1] - HALF_PI, y[2]])\n\n\n",
        ),
        ("    by_x = by[:, :2]\n", "    by_x = by[:, :2]\n    half, x = simulated(p, Omega, smooth)\n"),
    ),
    (
        "cycle-saltation",
        "the map's derivative lacks the arrival time's change",
        (
            "        by = -(change + np.outer(speed, dtime))[1:]\n",
            "        by = -(change + np.outer(speed, dtime))[1:]\n        raw = -change[1:]\n",
        ),
        ("return half, x, by, dtime, y[12]", "return half, x, raw, dtime, y[12]"),
    ),
    ("cycle-stale", "all rows have the first cycle's answers", moved("/limit-cycle/", "[old[0]] * len(old)")),
    ("cycle-shifted", "each row has the answers of the row before", moved("/limit-cycle/", "[old[0], *old[:-1]]")),
    (
        "cycle-degrees",
        "angles in degrees",
        ('"gamma_bar_0": x[0]', '"gamma_bar_0": math.degrees(x[0])'),
        ('"beta_max": HALF_PI - deepest', '"beta_max": math.degrees(HALF_PI - deepest)'),
    ),
    # ---- level 8 and 9
    ("het-paper", "Omega_h as the paper prints it, 30.07", ('"omega_h": Omega', '"omega_h": 30.07')),
    (
        "het-linear",
        "the linear law's Omega_h for the smooth law",
        ("    Omega = connection(p, smooth)", "    Omega = connection(p, False)"),
    ),
    (
        "het-inverted",
        "the inverted equilibrium's eigenvalues",
        ("spectrum(p, Omega, smooth, -HALF_PI)]\n", "spectrum(p, Omega, smooth, HALF_PI)]\n"),
    ),
    (
        "het-crit",
        "the eigenvalues at Omega_crit",
        ("spectrum(p, Omega, smooth, -HALF_PI)]\n", "spectrum(p, critical_speed(p), smooth, -HALF_PI)]\n"),
    ),
    (
        "het-swapped",
        "lambda_s and lambda_ss swapped",
        ("lambda_u, lambda_s, lambda_ss = [", "lambda_u, lambda_ss, lambda_s = ["),
    ),
    (
        "het-bisection",
        "Omega_h to four digits: too early an end of the search",
        ("while high - low > 1e-12", "while high - low > 1e-3"),
    ),
    (
        "near-het-rounded",
        "Omega rounded to four decimals near Omega_h",
        (
            '    smooth = row["friction"] == "smooth"\n    half, x',
            '    smooth = row["friction"] == "smooth"\n    Omega = round(Omega, 4) if row["kind"] == "near-heteroclinic" else Omega\n    half, x',
        ),
    ),
]

CORRECT = [
    ("as-it-is", "LSODA at 1e-13"),
    ("lsoda-1e-12", "LSODA at 1e-12", (RUN, RUN.replace("1e-13", "1e-12"))),
    ("dop853-1e-13", "SciPy's DOP853 at 1e-13", solver("DOP853", 1e-13)),
    ("dop853-1e-12", "SciPy's DOP853 at 1e-12", solver("DOP853", 1e-12)),
    (
        "rk4-fine",
        "RK4 with steps of 2e-4 s for the orbits, LSODA for the rest",
        (RUN, "    if len(times) < 4000:\n    " + RUN + "\n" + fixed(RK4, 2e-4)[1]),
    ),
    (
        "long-double",
        "the right-hand sides in long double",
        (
            "    found = dict(zip(names, model(math, p, Omega, smooth, *y)))",
            "    found = dict(zip(names, model(np, [np.longdouble(z) for z in p], np.longdouble(Omega), smooth, *[np.longdouble(z) for z in y])))",
        ),
    ),
    (
        "factored",
        "M and h in another order of operations",
        (H, "h = h5 + (h4 + (h3 + (h2 + h1)))"),
        ("M = inertia + m * rho**2 * cb**2", "M = inertia + m * (rho * cb) ** 2"),
    ),
    (
        "mpmath-eigenvalues",
        "eigenvalues from mpmath",
        (
            "    values = np.linalg.eigvals(jacobian(p, Omega, smooth, [HALF_PI, gamma, 0.0])).astype(complex)",
            "    values = [complex(z) for z in mpmath.eig(mpmath.matrix(jacobian(p, Omega, smooth, [HALF_PI, gamma, 0.0]).tolist()), left=False, right=False)]",
        ),
    ),
    ("fifteen-digits", "fifteen digits of each answer", (TEXT, "    return f'{value:.15g}'")),
    ("sixteen-decimals", "an exponent form with sixteen digits", (TEXT, "    return f'{value:.16e}'")),
]
