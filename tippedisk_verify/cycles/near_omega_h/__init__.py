"""Limit cycles near Omega_h, where the period tends to infinity and doubles end.

- `cycle_at_distance` solves for the cycle at a distance from Omega_h. It tries these methods in
turn: `cycles_by_passages`, with the maps of `saddle_passages`, then `cycles_by_broyden`.
- `period_continuation` follows the family to its limit.
- `required_precision` is the arithmetic that a distance needs.
"""
