"""A limit cycle with its uncertainties, and the same orbit by an integrator that shares only the equations."""

from fractions import Fraction

import tippedisk_verify as tv

speed = tv.omega_crit(tv.PRINTED, digits=40).value - Fraction("0.5")
cycle = tv.limit_cycle(tv.PRINTED, speed, tv.Taylor())
print(f"period            {cycle.period} s")
print(f"largest angle     {cycle.beta_max} rad from upright")
print(f"slow multiplier   {cycle.multiplier_slow}")

# SciPy's DOP853 once around: it must come back to where it began.
start = (Fraction(0), cycle.gamma_bar_0.value, cycle.v_0.value)
request = tv.Request(tv.PRINTED, speed, start, cycle.period.value, shifted=True)
end = tv.Baseline("DOP853")(request).state
away = max(abs(float(after) - float(before)) for after, before in zip(end, start, strict=True))
print(f"SciPy comes back to within {away:.1e}")
assert away < 1e-9  # DOP853's own error over one period at its tightest tolerance is some 1e-12
