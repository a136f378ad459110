"""Limit cycles, and which cycle there is at a speed or at a distance from Omega_h.

- `cycle_at_speed` solves for the cycle at a speed. `locator` predicts where it is.
- `near_omega_h` solves for the cycle at a distance from Omega_h.
- `branch_cycles` finds the cycles of many speeds, and `branch` has them as a result.
- `limit_cycle` has the results. `monodromy` and `sensitivity` are computed when a result is asked
for them.
- `shooting`, `families` and `collocation` are the methods.
"""
