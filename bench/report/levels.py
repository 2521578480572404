# SPDX-License-Identifier: Apache-2.0
"""Three sizes of report: images, what is swept, which scenes."""
import dataclasses


@dataclasses.dataclass
class Level:
    size: str
    spp: int
    slow: dict          # fewer paths for scenes whose exact frames would take about a minute and more
    vpls: int
    env_lights: int
    light_samples: int  # of area lights, where they are all there is
    runs: int           # pairs of frames
    draws: int          # of virtual lights, where errors are means over these
    repeated: int       # frames alone that take a few seconds
    bdpt_spp: int
    scenes: list        # of the curves
    sweeps: dict        # values by method
    pictures: dict      # of these the one that is shown, by method
    real_lights: bool   # kinds of light in scenes of the folder
    ranges: dict        # C_E of hard and soft shadows, with anti-aliasing and without (Popov et al. 2013, Sect. 5)
    converged: list     # scenes
    reference_spp: int
    converged_knobs: dict
    maps: list          # texels a side of shadow maps
    sequence: dict      # of moving pictures: size, frames, paths a pixel, C_E, environment lights, virtual lights
    edges: dict         # of hard shadows: size, C_E, that of the pictures, edges for a mean (500)
    clusters: dict      # scenes; C_E at several paths a pixel, at one; those that are also rendered unrefined, shared
    studies: dict       # size and paths of the images, scenes; pairs of frames at least, as times
                        # decide; values of each of whitted's options besides the default
    seeing: dict        # size of the images, virtual and sky lights


LEVELS = {
    "full": Level(
        "256x144", 16, {"atrium": 4, "san-miguel": 4, "hair-straight": 4, "breakfast": 8}, 1024, 256, 64, 1, 3, 3, 4,
        ["atrium", "conference-lights", "shapes", "kitchen", "conference", "breakfast", "living-room", "san-miguel",
         "hair-straight"],
        {"cache": [4, 8, 16, 32], "cache-once": [6, 12, 24], "cache-unrefined": [8, 32], "cache-words": [],
         "estimate": [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 64, 128], "cached-selection": [2, 4, 8, 16],
         "selection": [2, 3, 4, 6, 8, 12, 16, 24, 32, 64, 128],
         "fewer": [4, 8, 16], "adaptive": [0.05, 0.2, 0.5], "adaptive-cache": [0.05, 0.2], "grid": ["NEAR", "OPT"],
         "bdpt": [4, 12, 48]},
        {"cache": 16, "estimate": 8, "selection": 8, "adaptive": 0.2}, True,
        {"hard": ([4, 8, 16, 36], [4, 8, 18]), "soft": ([10, 24, 64], [4, 24])},
        ["conference-lights", "shapes", "atrium", "kitchen", "living-room", "conference", "breakfast",
         "hair-straight"], 1024,
        {"selection": [4, 16], "cache": [16], "estimate": [4, 16], "cached-selection": [8], "exact": [None]},
        maps=[1024, 2048, 4096, 6000],
        sequence={"size": "160x90", "frames": 60, "spp": 4, "ce": [4, 8, 32], "env_lights": 64, "vpls": 128,
                  "grid": ["NEAR", "OPT"], "estimate": [4, 8]},
        edges={"size": "640x360", "ce": [4, 8, 16], "shown": 8},
        clusters={"scenes": ["conference-lights", "kitchen"], "ce": [8, 32], "one": [8], "also": [8]},
        studies={"size": "192x108", "spp": 4, "scenes": ["kitchen", "conference"], "ce": 8, "table_mb": 64, "runs": 3,
         "options": {"ce": [4, 16], "cn": [1, 2, 4, 16, 32], "cz": [2, 4, 16, 32], "cr": [1.1, 1.5, 2.5],
                     "refine": [1, 2, 4], "refine-above": [0, 1], "cache-mb": [1, 16, 64]}},
        seeing={"size": "320x180", "lights": 256}),
    "quick": Level(
        "128x72", 4, {}, 256, 64, 16, 1, 1, 1, 4, ["conference-lights", "shapes", "atrium", "conference"],
        {"cache": [8, 16, 32], "cache-once": [12], "cache-unrefined": [16], "cache-words": [],
         "estimate": [2, 6, 24, 48],
         "cached-selection": [6], "selection": [6, 24, 48], "fewer": [4], "adaptive": [0.05, 0.2],
         "adaptive-cache": [], "grid": ["NEAR", "OPT", "GNU"], "bdpt": [12]},
        {"cache": 16, "estimate": 6, "selection": 6}, False,
        {"hard": ([4, 16, 36], [4, 18]), "soft": ([10, 32, 64], [4, 24])},
        ["conference-lights", "shapes"], 256,
        {"selection": [8], "cache": [16], "estimate": [8], "cached-selection": [], "exact": [None]},
        maps=[128, 256, 512],
        sequence={"size": "128x72", "frames": 8, "spp": 4, "ce": [4, 16], "env_lights": 36, "vpls": 0,
                  "grid": ["NEAR", "OPT"], "estimate": [4]},
        edges={"size": "320x180", "ce": [4, 8], "shown": 8},
        clusters={"scenes": ["conference-lights"], "ce": [8, 32], "one": [8], "also": [8]},
        studies={"size": "96x54", "spp": 4, "scenes": ["cornell"], "ce": 8, "table_mb": 4, "runs": 1,
         "options": {"ce": [4, 16], "cn": [2, 32], "cz": [2, 32], "cr": [2.5], "refine": [1, 2],
                     "refine-above": [0, 2], "cache-mb": [1, 16]}},
        seeing={"size": "128x72", "lights": 64}),
    "tiny": Level(
        "48x27", 4, {}, 64, 16, 4, 1, 2, 2, 2, ["cornell", "shapes"],
        {"cache": [8, 32], "cache-once": [8], "cache-unrefined": [8], "cache-words": [8], "estimate": [2, 8],
         "cached-selection": [4],
         "selection": [4, 16], "fewer": [2], "adaptive": [0.1], "adaptive-cache": [0.1], "grid": ["NEAR"],
         "bdpt": [12]},
        {"cache": 8, "estimate": 8}, False, {"hard": ([4, 8], [4]), "soft": ([8, 16], [4])}, ["cornell"], 64,
        {"selection": [4], "cache": [8], "estimate": [4], "cached-selection": [], "exact": [None]},
        maps=[32, 64],
        sequence={"size": "48x27", "frames": 2, "spp": 4, "ce": [4], "env_lights": 36, "vpls": 16, "grid": ["NEAR"],
                  "estimate": [4]},
        edges={"size": "96x54", "ce": [4], "shown": 4, "least": 50},
        clusters={"scenes": ["cornell"], "ce": [8], "one": [4], "also": [8]},
        studies={"size": "32x18", "spp": 4, "scenes": ["cornell"], "ce": 8, "table_mb": 1, "runs": 1,
         "options": {"ce": [4, 16], "cn": [2], "cz": [2], "cr": [2.5], "refine": [1], "refine-above": [2],
                     "cache-mb": [1]}},
        seeing={"size": "48x27", "lights": 32})}
