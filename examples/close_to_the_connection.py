"""The law of the period close to Omega_h, from the reference values: each decade of the
distance adds the same.
"""

import math

import tippedisk_verify as tv

saddle = tv.reference("table1/linear/heteroclinic/point/lambda_u").measured()
decade = 2 * math.log(10) / float(saddle)
print(f"a decade should add {decade:.6f} s")

steps = []
for near, far in ((4, 3), (8, 6), (12, 10)):
    periods = [
        tv.reference(f"table1/linear/near-heteroclinic/het+1e-{zeros}/period").measured()
        for zeros in (near, far)
    ]
    step = float(periods[0].value - periods[1].value) / (near - far)
    steps.append(abs(step / decade - 1))
    print(f"from Omega_h + 1e-{far} to Omega_h + 1e-{near}: {step:.6f} s a decade")

assert steps[0] > steps[1] > steps[2]  # what the law leaves falls like a power of the distance
assert steps[2] < 1e-3
