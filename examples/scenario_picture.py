"""The picture of docs/scenario.md: all families of limit cycles, as `scenario_picture.py
[FILE.png]`.
"""

import sys

import tippedisk_verify as tv
from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.figures.family_figures import scenario_exhibit

target = sys.argv[1] if len(sys.argv) > 1 else "scenario.png"
drawing = scenario_exhibit.draw(Audit(tv.PRINTED, tv.Taylor()), ())
drawing.figure(2).savefig(target, dpi=120)
print(drawing.caption)
