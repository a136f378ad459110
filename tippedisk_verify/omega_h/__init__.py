"""Omega_h as an answer, and the study of its neighbourhood.

- `methods` finds Omega_h by four methods.
- `connecting_orbit` has the result: Omega_h with the connecting orbit and its saddles.
- `period_law` is the asymptotic law of the cycles' period next to Omega_h.
- `distance_study` compares cycles, the law and other programs' answers at many distances.

The splitting of the manifolds is in `connection`, the cycles next to Omega_h in
`cycles.near_omega_h`.
"""
