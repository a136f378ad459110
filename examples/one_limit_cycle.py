"""A limit cycle with its uncertainties, and the same orbit by an integrator that shares only
the equations.
"""

import tippedisk_verify as tv

disk = tv.Disk("table1")
cycle = disk.limit_cycle(below_crit="0.5")
print(f"period            {cycle.period} s")
print(f"largest angle     {cycle.beta_max} rad from upright")
print(f"slow multiplier   {cycle.multiplier_slow}")

# SciPy's DOP853 once around: it must come back to where it began.
start = (0, cycle.gamma_bar_0.value, cycle.v_0.value)
scipy = tv.ScipyEngine("DOP853")
end = disk.integrate(cycle.omega.value, start, cycle.period.value, shifted=True, engine=scipy).y[
    :, -1
]
away = max(abs(end - [float(part) for part in start]))
print(f"SciPy comes back to within {away:.1e}")
assert away < 1e-9  # DOP853's own error over one period at its tightest tolerance is some 1e-12
