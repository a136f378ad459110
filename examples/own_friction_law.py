"""A friction law of one's own: Coulomb friction smoothed by an arctangent."""

from typing import Any

from scipy.integrate import solve_ivp

import tippedisk_verify as tv


def force(ops: Any, gamma_y: Any, c: Any) -> Any:
    """Return lambda_Ty [N]; its slope at zero is -mu m g / epsilon."""
    return -2 * c.mu * c.m * c.g / c.pi * ops.atan(c.pi * gamma_y / (2 * c.epsilon))


disk = tv.Disk("table1", friction=tv.FrictionLaw("arctan", force))
print("Omega_crit ", disk.omega_crit, "rad/s, which does not depend on the law")
cycle = disk.limit_cycle("30.4", digits=20)
print("T          ", cycle.period, "s by shooting")
print("T          ", disk.harmonic_balance("30.4").period, "s by harmonic balance")
print("Omega_h    ", disk.heteroclinic(digits=20).omega_h, "rad/s")

times, states = cycle.orbit()
options = {"method": "Radau", "jac": disk.jacobian("30.4"), "rtol": 1e-12, "atol": 1e-12}
end = solve_ivp(disk.rhs("30.4"), (0, times[-1]), states[:, 0], **options).y[:, -1]
print("Radau closes the cycle to within", f"{abs(end - states[:, 0]).max():.0e}")
