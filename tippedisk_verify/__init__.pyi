# Which module has each public name, for type checkers; `__init__.py` fetches it from there when it is first used.

from tippedisk_verify.audit.claims import Audit as Audit
from tippedisk_verify.audit.claims import Verdict as Verdict
from tippedisk_verify.bench.problems import problem_named as problem_named
from tippedisk_verify.bench.race import Race as Race
from tippedisk_verify.bench.race import race as race
from tippedisk_verify.conformance.answers import grade as grade
from tippedisk_verify.conformance.grading import compare as compare
from tippedisk_verify.connection.bisection import bisect_omega_h as bisect_omega_h
from tippedisk_verify.cycles.collocation.collocation_cycles import (
    collocation_cycle as collocation_cycle,
)
from tippedisk_verify.cycles.near_omega_h.cycle_at_distance import (
    cycle_above_omega_h as cycle_above_omega_h,
)
from tippedisk_verify.cycles.shooting.shoot import shoot_limit_cycle as shoot_limit_cycle
from tippedisk_verify.disk import Disk as Disk
from tippedisk_verify.errors import AccuracyError as AccuracyError
from tippedisk_verify.errors import InputError as InputError
from tippedisk_verify.flow.batch import BatchTaylor as BatchTaylor
from tippedisk_verify.flow.contract import Event as Event
from tippedisk_verify.flow.contract import Request as Request
from tippedisk_verify.flow.contract import Result as Result
from tippedisk_verify.flow.contract import Status as Status
from tippedisk_verify.flow.scipy_engine import ScipyEngine as ScipyEngine
from tippedisk_verify.flow.taylor import Taylor as Taylor
from tippedisk_verify.model.friction import FrictionLaw as FrictionLaw
from tippedisk_verify.model.parameters import CALIBRATED as CALIBRATED
from tippedisk_verify.model.parameters import GEOMETRY as GEOMETRY
from tippedisk_verify.model.parameters import PRINTED as PRINTED
from tippedisk_verify.model.parameters import Parameters as Parameters
from tippedisk_verify.motion.basins import basins as basins
from tippedisk_verify.motion.saved_results import load as load
from tippedisk_verify.motion.scenes import SCENES as SCENES
from tippedisk_verify.motion.scenes import scene_named as scene_named
from tippedisk_verify.motion.solution import Solution as Solution
from tippedisk_verify.numbers.exact import Exact as Exact
from tippedisk_verify.numbers.exact import exact as exact
from tippedisk_verify.numbers.measured import Measured as Measured
from tippedisk_verify.numbers.precision import DOUBLE as DOUBLE
from tippedisk_verify.numbers.precision import EXTENDED as EXTENDED
from tippedisk_verify.numbers.precision import QUADRUPLE as QUADRUPLE
from tippedisk_verify.numbers.precision import Precision as Precision
from tippedisk_verify.numbers.precision import precision_of_bits as precision_of_bits
from tippedisk_verify.omega_h.methods import heteroclinic as heteroclinic
from tippedisk_verify.reference_values.lookup import reference as reference
from tippedisk_verify.reference_values.lookup import references as references
from tippedisk_verify.theory.equilibria import equilibrium as equilibrium
from tippedisk_verify.theory.hopf import hopf_point as hopf_point
from tippedisk_verify.theory.hopf import omega_crit as omega_crit
from tippedisk_verify.theory.hopf import period_crit as period_crit
from tippedisk_verify.theory.one_harmonic_law import one_harmonic as one_harmonic
from tippedisk_verify.theory.slow_manifold import analyse_slow_manifold as analyse_slow_manifold

__version__: str
__all__: list[str]
