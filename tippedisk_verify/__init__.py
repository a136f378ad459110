"""True numbers of the tippedisk, with honest uncertainties.

The front door is `tippedisk_verify.disk`: a `Disk`, and what can be asked of it. The rooms behind it, each importing
only from those before it:

- `tippedisk_verify.model`: numbers, parameters, equations of motion;
- `tippedisk_verify.theory`: what follows in closed form, and
  `tippedisk_verify.flow`: how states move (neither knows the other: that they agree is evidence);
- `tippedisk_verify.cycles`: limit cycles, their families and folds, and
  `tippedisk_verify.connection`: the heteroclinic connection and its speed Omega_h;
- `tippedisk_verify.atlas`: which cycles there are, and `tippedisk_verify.motion`: solutions, scenes, basins;
- `tippedisk_verify.proofs`: enclosures with proofs, in ball arithmetic; it knows `model` only;
- `tippedisk_verify.audit`: the paper's claims, and how each is examined;
- `tippedisk_verify.reference_values`: how they are read, checked and drawn anew, and
  `tippedisk_verify.conformance`: the grading of other programs by them;
- `tippedisk_verify.bench`: run time against error, and `tippedisk_verify.stress`: cases that are numerically hard;
- `tippedisk_verify.figures` and `tippedisk_verify.report`: what a person sees of it.

>>> import tippedisk_verify as tv
>>> disk = tv.Disk("printed")
>>> print(f"{disk.omega_crit:.16g}")
30.88659268864357
>>> disk.equilibrium("inverted", "30.4").stable
False
>>> sol = disk.integrate("30.4", ("pi/2", "pi/2 + 0.4", 0), 10)
>>> sol.message, sol.y.shape, bool(sol.uncertainty.max() < 1e-12)
('the final time was reached', (3, 201), True)
>>> print(f"{disk.limit_cycle('30.4').period:.9g}")
1.08255527
>>> print(tv.reference("printed/linear/limit-cycle/crit-0.5/v_0").values["doubles"][0][:20])
-1.71000216164390253
>>> tv.compare("printed/linear/hopf/point/omega_crit", 30.9).verdict
'wrong'

Importing the package loads nothing heavy: each name is fetched when it is first used.
"""

from __future__ import annotations

from importlib import import_module

__version__ = "0.1.0"

TYPE_CHECKING = False  # to type checkers it is true; typing itself would delay the answer to Ctrl-C
if TYPE_CHECKING:
    from typing import Any

    from tippedisk_verify.answers import grade
    from tippedisk_verify.atlas.cycles_at_speed import cycle_above
    from tippedisk_verify.audit.claims import Audit, Verdict
    from tippedisk_verify.conformance.grading import compare
    from tippedisk_verify.connection.bisection import bisect_omega_h
    from tippedisk_verify.connection.heteroclinic import heteroclinic
    from tippedisk_verify.cycles.shooting import limit_cycle
    from tippedisk_verify.cycles.spectral import balanced_cycle
    from tippedisk_verify.disk import Disk
    from tippedisk_verify.errors import InputError, Shortfall
    from tippedisk_verify.flow.baseline import Baseline
    from tippedisk_verify.flow.contract import Event, Request, Result, Status
    from tippedisk_verify.flow.lanes import BatchTaylor
    from tippedisk_verify.flow.taylor import Taylor
    from tippedisk_verify.model.exact import Exact, exact
    from tippedisk_verify.model.measured import Measured
    from tippedisk_verify.model.parameters import CALIBRATED, GEOMETRY, PRINTED, Parameters
    from tippedisk_verify.model.precision import DOUBLE, EXTENDED, QUADRUPLE, Precision, bits
    from tippedisk_verify.motion.basins import basins
    from tippedisk_verify.motion.scenes import SCENES, scene_named
    from tippedisk_verify.motion.solution import Solution
    from tippedisk_verify.reference_values.lookup import reference, references
    from tippedisk_verify.theory.equilibria import equilibrium
    from tippedisk_verify.theory.harmonic_balance import one_harmonic
    from tippedisk_verify.theory.hopf import hopf_point, omega_crit, period_crit
    from tippedisk_verify.theory.melnikov import limit_period, limit_speed
    from tippedisk_verify.theory.slow_manifold import analyse_slow_manifold

_HOMES = {
    "disk": ("Disk",),
    "motion.solution": ("Solution",),
    "answers": ("grade",),
    "errors": ("InputError", "Shortfall"),
    "audit.claims": ("Audit", "Verdict"),
    "conformance.grading": ("compare",),
    "reference_values.lookup": ("reference", "references"),
    "flow.baseline": ("Baseline",),
    "flow.contract": ("Event", "Request", "Result", "Status"),
    "flow.lanes": ("BatchTaylor",),
    "flow.taylor": ("Taylor",),
    "model.parameters": ("CALIBRATED", "GEOMETRY", "PRINTED", "Parameters"),
    "model.exact": ("Exact", "exact"),
    "model.measured": ("Measured",),
    "model.precision": ("DOUBLE", "EXTENDED", "QUADRUPLE", "Precision", "bits"),
    "motion.basins": ("basins",),
    "connection.bisection": ("bisect_omega_h",),
    "connection.heteroclinic": ("heteroclinic",),
    "atlas.cycles_at_speed": ("cycle_above",),
    "cycles.shooting": ("limit_cycle",),
    "motion.scenes": ("SCENES", "scene_named"),
    "theory.equilibria": ("equilibrium",),
    "theory.harmonic_balance": ("one_harmonic",),
    "theory.melnikov": ("limit_period", "limit_speed"),
    "theory.hopf": ("hopf_point", "omega_crit", "period_crit"),
    "theory.slow_manifold": ("analyse_slow_manifold",),
    "cycles.spectral": ("balanced_cycle",),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "CALIBRATED",
    "DOUBLE",
    "EXTENDED",
    "GEOMETRY",
    "PRINTED",
    "QUADRUPLE",
    "SCENES",
    "Audit",
    "Baseline",
    "BatchTaylor",
    "Disk",
    "Event",
    "Exact",
    "InputError",
    "Measured",
    "Parameters",
    "Precision",
    "Request",
    "Result",
    "Shortfall",
    "Solution",
    "Status",
    "Taylor",
    "Verdict",
    "analyse_slow_manifold",
    "balanced_cycle",
    "basins",
    "bisect_omega_h",
    "bits",
    "compare",
    "cycle_above",
    "equilibrium",
    "exact",
    "grade",
    "heteroclinic",
    "hopf_point",
    "limit_cycle",
    "limit_period",
    "limit_speed",
    "omega_crit",
    "one_harmonic",
    "period_crit",
    "reference",
    "references",
    "scene_named",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'tippedisk_verify' has no attribute '{name}'")
    value = getattr(import_module(f"tippedisk_verify.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
