"""The trusted kernel: enclosures of flows, returns and fixed points, tested by strict
comparisons.

It is read from the bottom up:

- numbers: `balls`, `doubles`, `ball_array`, `jets`, `small_matrices`;
- the field and its series: `vector_field`, `taylor_recurrences`;
- flights: `doubleton`, `step`, `proved_flow`, `sliding`;
- maps: `poincare_map`, `half_map_of_curves`, `scaled_half_map`, and `krawczyk` for fixed points;
- the saddles: `saddle`, `saddle_passage`;
- theorems: `certificate_format` and `certificates`, a module for each kind.
"""
