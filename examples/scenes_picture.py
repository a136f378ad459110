"""The picture of docs/index.md: two of the paper's scenes in state space, as
`scenes_picture.py [FILE.png]`.
"""

import sys

import tippedisk_verify as tv
from tippedisk_verify.figures.scene_figures import draw_scenes_3d
from tippedisk_verify.motion.scenes import compute_scene

target = sys.argv[1] if len(sys.argv) > 1 else "scenes.png"
panels = [compute_scene(tv.scene_named(name), tv.PRINTED, tv.Taylor()) for name in "df"]
draw_scenes_3d(panels).savefig(target, dpi=120)
print(", ".join(f"scene {panel.scene.name}: {panel.orbits[0].outcome.kind}" for panel in panels))
