# SPDX-License-Identifier: Apache-2.0
"""What no folder of scenes has: files that the report makes for itself, in OUT/made."""
import os

import glb
from grid import made_map

SOURCE = "sponza-crytek"


def points_and_sun(source, out):
    """A copy of the arcade and its sun with 24 point lights along its nave, in two rows, together about as bright as what
    the sun leaves in the shade."""
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


def source_of(a, scene):
    return os.path.join(a.scenes, scene, scene + ".glb")


def make(a):
    for name, maker in (("sun.hdr", lambda path: made_map(path, "sun")), ("delta.glb", lambda path: make_delta(a, path))):
        path = os.path.join(a.out, "made", name)
        if not os.path.exists(path):
            maker(path)


def make_delta(a, path):
    if os.path.exists(source_of(a, SOURCE)):
        with open(path + ".part", "wb") as f:
            points_and_sun(source_of(a, SOURCE), f)
        os.replace(path + ".part", path)
