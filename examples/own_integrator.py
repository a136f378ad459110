"""An integrator of one's own in the work-precision diagram: SciPy's solve_ivp and a
Runge-Kutta method.
"""

import numpy as np
from scipy.integrate import solve_ivp

import tippedisk_verify as tv
from tippedisk_verify.bench.problems import Problem


def vode(problem: Problem, tolerance: float) -> np.ndarray:
    options = {"method": "BDF", "rtol": tolerance, "atol": tolerance}
    span = (0, problem.duration)
    return np.array(
        solve_ivp(problem.rhs, span, problem.start, t_eval=problem.times, **options).y.T
    )


def runge_kutta(problem: Problem, tolerance: float) -> np.ndarray:
    rhs, states, y, t = problem.rhs, [], np.array(problem.start), 0.0
    for end in problem.times:
        steps = max(2, int((end - t) * 60 / tolerance**0.25))
        h = (end - t) / steps
        for _ in range(steps):
            a = rhs(t, y)
            b = rhs(t, y + h / 2 * a)
            c = rhs(t, y + h / 2 * b)
            y = y + h / 6 * (a + 2 * b + 2 * c + rhs(t, y + h * c))
        t = end
        states.append(y)
    return np.array(states)


solvers = {"my BDF": vode, "my RK4": runge_kutta}
found = tv.race(solvers, problems=["transient"], tolerances=[1e-4, 1e-6], against=["taylor"])
print(found)
found.plot(columns=1).savefig("race.png")
