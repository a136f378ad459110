"""What half-widths cost: one motion, cycle and connection with them and without, in
milliseconds of processor time.
"""

from collections.abc import Callable
from statistics import median
from time import process_time

import tippedisk_verify as tv

disk = tv.Disk("table1")
START = ("pi/2", "pi/2 + 0.4", 0)
TASKS: dict[str, Callable[[str, bool], object]] = {
    "integrate, 10 s": lambda speed, wanted: disk.integrate(speed, START, 10, half_widths=wanted),
    "limit_cycle": lambda speed, wanted: disk.limit_cycle(speed, half_widths=wanted),
    "heteroclinic, 30 digits": lambda speed, wanted: tv.Disk("table1", g=speed).heteroclinic(
        digits=30, half_widths=wanted
    ),
}
SPEEDS = {"heteroclinic, 30 digits": ["9.80", "9.81", "9.82", "9.83"]}

for name, task in TASKS.items():
    taken: dict[bool, list[float]] = {True: [], False: []}
    for speed in SPEEDS.get(name, [f"30.4{n:02d}" for n in range(12)]):
        for wanted, times in taken.items():
            begin = process_time()
            task(speed, wanted)
            times.append(1000 * (process_time() - begin))
    # The first of each compiles.
    with_them, without = median(taken[True][1:]), median(taken[False][1:])
    ratio = with_them / without
    print(
        f"{name}: {with_them:.1f} ms with half-widths, {without:.1f} ms without, ratio {ratio:.1f}"
    )
