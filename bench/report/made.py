# SPDX-License-Identifier: Apache-2.0
"""What no folder of scenes has: files that the report makes for itself, in OUT/made."""
import os

import glb
from grid import made_map

SOURCE = "sponza-crytek"


def points_and_sun(source, out):
    """A copy of the arcade and its sun with 24 point lights along its nave, in two rows."""
    scene, rest = glb.read(source)
    lights = scene["extensions"]["KHR_lights_punctual"]["lights"]
    top = scene["scenes"][0]["nodes"]
    for i in range(12):
        for z in (-150.0, 70.0):
            lights.append({"type": "point", "color": [1, 0.85, 0.7], "intensity": 150000.0})
            top.append(len(scene["nodes"]))
            scene["nodes"].append({"translation": [-1000.0 + 180.0 * i, 300.0, z],
                                   "extensions": {"KHR_lights_punctual": {"light": len(lights) - 1}}})
    glb.write(out, scene, rest)


def make(a, level):
    sun, delta = (os.path.join(a.out, "made", n) for n in ("sun.hdr", "delta.glb"))
    if not os.path.exists(sun):
        made_map(sun, "sun")
    source = os.path.join(a.scenes, SOURCE, SOURCE + ".glb")
    if level.real_lights and os.path.exists(source) and not os.path.exists(delta):
        with open(delta + ".part", "wb") as f:
            points_and_sun(source, f)
        os.replace(delta + ".part", delta)
