"""Why answers fail: the one mistake that predicts all of them, or nothing.

`causes` decides what is tried, and in which order. A mistake is sought
- in a catalogue (`alternatives`) by what each predicts (`predictions`),
- in the answers themselves (`shapes`, by `relations`, `places` and `sides`; `sizes`, by `differences`), and as one
  free number (`factors`),
- in the formulas of levels 1 to 5: those that are often got wrong (`formulas`, `matrices`, `recursion`), any single
  slip in them (`slips` in what `written` and `written_theory` hold, tried by `slipped`) and in the series'
  `arithmetic`, and a factor (`scaled`),
- in orbits, which `flights` computes: `samples` (which instants), `integrators` (methods with `steps`, tolerances) and
  `defects` (of unknown ones), `orbits` (events), `scans` (one number), and from sample to sample, in `pairs`:
  `restarts` (what is done to states) and `copies` (a slip in the orbits' own equations),
- in cycles, which `shooting` computes: `along` (what else is read along the right ones), `cycles` (what is made of the
  half map, with `starts`), `closing` and `speeds` (what closes them), `quotients` (derivatives), `connection` (the
  search for Omega_h) and `saddle` (the eigenvalues there).
"""

from tippedisk_verify.conformance.diagnosis.causes import Diagnosis, diagnosed

__all__ = ["Diagnosis", "diagnosed"]
