"""A limit cycle and the multipliers of its family against the speed, as `limit_cycles.py
[FILE.png]`.
"""

import sys

from matplotlib import pyplot

import tippedisk_verify as tv

disk = tv.Disk("table1")
_, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4), layout="constrained")
disk.limit_cycle("30.4").plot(left)
left.legend()
branch = disk.branch()
right.semilogy(branch.omega, branch.multiplier_slow)
right.set(xlabel="Ω [rad/s]", ylabel="slow Floquet multiplier")
pyplot.savefig(sys.argv[1] if len(sys.argv) > 1 else "limit_cycles.png", dpi=120)
