"""The example in the README: a trajectory with its half-widths, a reference value, an answer graded."""

import tippedisk_verify as tv

taylor = tv.Taylor()
result = taylor(tv.Request(tv.PRINTED, "30.4", ("pi/2", "pi/2 + 0.4", 0), 10, error_estimate=True))
print(result.status, result.state)
if result.error:  # as asked for
    print(result.error.state)
print(tv.reference("printed/linear/heteroclinic/point/omega_h").measured())
print(tv.compare("printed/linear/hopf/point/omega_crit", 30.886592688643568).digits)
