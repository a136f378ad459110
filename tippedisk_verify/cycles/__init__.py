"""Limit cycles, and which cycle there is at a speed or at a distance from Omega_h.

- `cycle_at_speed` and `cycle_at_distance` solve for one cycle. `locator` predicts where it is.
- `branch` and `distance_study` compare many cycles.
- `limit_cycle` has the results. `monodromy` and `sensitivity` are computed when a result is asked
for them.
- `shooting`, `families`, `near_omega_h` and `collocation` are the methods.
"""
