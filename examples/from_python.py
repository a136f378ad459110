"""The example in the README: a motion, a limit cycle, Omega_h, a reference value, an answer graded."""

import tippedisk_verify as tv

disk = tv.Disk("printed")
sol = disk.integrate("30.4", ("pi/2", "pi/2 + 0.4", 0), 10)
print(sol.message, sol.end.time, sol.end.state, sol.end.uncertainty)
cycle = disk.limit_cycle("30.4", digits=20)
print(cycle.period, f"{cycle.multiplier_slow:.6f}", cycle.stable)
t, y = cycle.orbit(400)
print(disk.omega_crit - disk.heteroclinic().omega_h)
print(tv.reference("printed/linear/heteroclinic/point/omega_h"))
print(tv.compare("printed/linear/hopf/point/omega_crit", 30.886592688643568).digits)
print(tv.grade({q.id: q.for_doubles for q in tv.references("printed/linear/rhs/001")}))
