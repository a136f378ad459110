"""The ten lines of the README: the critical speed, a limit cycle, a motion, and an answer
graded.
"""

import tippedisk_verify as tv

disk = tv.Disk("table1")
print(disk.omega_crit)  # 30.8865926886435672...
print(disk.heteroclinic(digits=20).omega_h)  # 30.0488682607225011227...
cycle = disk.limit_cycle("30.4", digits=20)
print(cycle.period)  # 1.0825552726783306222...
t, y = cycle.orbit(400)
sol = disk.integrate("30.4", ("pi/2", "pi/2 + 0.4", 0), 10)
print(sol.y.shape, sol.uncertainty.max() < 1e-12)  # (3, 201) True
print(tv.compare("table1/linear/hopf/point/period", 0.88672).digits)  # 6.423...
