# SPDX-License-Identifier: Apache-2.0
"""The one list of all cases: what is rendered for which section, at three sizes of report."""
import dataclasses
import os

from report.runner import Case
from scenes import is_builtin, missing_file, scene_words

# Environments as directional lights, which are what the grid decides: outdoors, and in rooms lit through windows.
BY_SKY = ["atrium", "shapes", "dominoes", "plant", "living-room", "san-miguel", "hair-straight"]
OWN_SKY = ["atrium"]
GRID_MODES = ["OPT", "RES", "FLO", "GNU", "GWU", "GNB", "GWB", "SWB"]


@dataclasses.dataclass
class Level:
    """How large a report is: images, what is swept, which scenes."""
    size: str
    spp: int
    vpls: int
    env_lights: int
    runs: int           # pairs of frames
    bdpt_spp: int
    scenes: list        # of the curves
    sweeps: dict        # values by method


FULL = Level("320x180", 16, 1024, 256, 3, 16,
             ["atrium", "conference-lights", "shapes", "kitchen", "conference", "breakfast", "living-room", "san-miguel",
              "hair-straight"],
             {"cache": [4, 8, 16, 32, 64], "cache-unrefined": [4, 8, 16, 32], "cache-words": [8, 16, 32],
              "estimate": [0.5, 1, 2, 4, 8, 16, 32], "cached-selection": [2, 4, 8, 16, 32],
              "selection": [2, 4, 8, 16, 32, 64], "fewer": [2, 4, 8, 16, 32, 64],
              "adaptive": [0.02, 0.05, 0.1, 0.2, 0.5], "adaptive-cache": [0.05, 0.2, 0.5],
              "grid": GRID_MODES, "bdpt": [6, 12, 24, 48]})
QUICK = Level("160x90", 4, 256, 64, 1, 4, ["atrium", "conference-lights", "shapes", "conference"],
              {"cache": [8, 16, 32], "cache-unrefined": [8, 32], "cache-words": [], "estimate": [2, 6, 24],
               "cached-selection": [6, 24], "selection": [6, 24, 64], "fewer": [2, 8], "adaptive": [0.05, 0.2],
               "adaptive-cache": [0.2], "grid": ["OPT", "GNU"], "bdpt": [12]})
TINY = Level("32x18", 4, 64, 16, 1, 2, ["cornell", "shapes"],
             {"cache": [8, 32], "cache-unrefined": [8], "cache-words": [8], "estimate": [2, 8], "cached-selection": [4],
              "selection": [4, 16], "fewer": [2], "adaptive": [0.1], "adaptive-cache": [0.1], "grid": ["OPT"],
              "bdpt": [12]})

# --visibility and the knob of each method
HOW = {"cache": lambda v: ["--visibility", "cache", "--ce", v],
       "cache-unrefined": lambda v: ["--visibility", "cache", "--ce", v, "--refine", "1"],
       "cache-words": lambda v: ["--visibility", "cache", "--ce", v, "--store", "words"],
       "estimate": lambda v: ["--visibility", "estimate", "--select", v],
       "cached-selection": lambda v: ["--visibility", "cache", "--select", v],
       "selection": lambda v: ["--visibility", "exact", "--select", v],
       "adaptive": lambda v: ["--visibility", "adaptive", "--tolerance", v],
       "adaptive-cache": lambda v: ["--visibility", "adaptive-cache", "--tolerance", v],
       "grid": lambda v: ["--visibility", f"grid={v}"]}


def word(value):
    return f"{value:g}" if isinstance(value, (int, float)) else value


def alone(a, words):
    return [*words, "--threads", str(a.threads), "--quiet", "--json", "-"]


def compare(a, words, runs):
    return [*words, "--threads", str(a.threads), "--compare", "--runs", str(runs), "--quiet", "--json", "-"]


def sky(a, scene):
    """An environment for what has none: the maps' folder, or one that the report makes."""
    if scene not in BY_SKY or scene in OWN_SKY or "--env" in scene_words(a, scene):
        return []
    path = os.path.join(a.scenes, "hdri", "kloppenheim_05_1k.hdr")
    return ["--env", path if os.path.exists(path) else "made/sun.hdr"]


def setting(a, level, scene, vpls=None):
    """A scene of the curves, and its lights: whole frames as they come, but for skies as lights."""
    words = ["whitted", *scene_words(a, scene), *sky(a, scene), "--size", level.size, "--spp", str(level.spp), "--vpls",
             str(level.vpls if vpls is None else vpls)]
    return words + (["--env-lights", str(level.env_lights)] if scene in BY_SKY else [])


def curves(a, level):
    for scene in a.present(level.scenes):
        base, image = f"curves/{scene}/exact", f"images/curves-{scene}.exr"
        yield Case(base, compare(a, setting(a, level, scene) + ["--visibility", "exact", "-o", image], level.runs),
                   {"section": "curves", "scene": scene, "method": "limit", "value": ""}, makes=(image,))
        for method, values in level.sweeps.items():
            if method == "grid" and scene not in BY_SKY:
                continue
            for value in values:
                labels = {"section": "curves", "scene": scene, "method": method, "value": value, "base": base}
                name, needs = f"curves/{scene}/{method}/{word(value)}", ()
                if method == "fewer":
                    labels["value"] = level.vpls // value
                    words = setting(a, level, scene, level.vpls // value)
                    words = alone(a, words + ["--visibility", "exact", "--reference", image])
                    needs = (base,)
                elif method == "bdpt":
                    words = ["bdpt", *scene_words(a, scene), *sky(a, scene), "--size", level.size, "--spp",
                             str(level.bdpt_spp), "--epoch", str(level.bdpt_spp), "--visibility", "cache", "--ce", word(value)]
                    words = compare(a, words, 1)
                else:
                    words = compare(a, setting(a, level, scene) + HOW[method](word(value)), level.runs)
                yield Case(name, words, labels, needs)


# A section adds its generator here; each takes the options and the level and yields its cases.
ALL = [curves]
LEVELS = {"full": FULL, "quick": QUICK, "tiny": TINY}


def all_cases(a, level):
    return [c for generate in ALL for c in generate(a, level)]


def present(a, scenes):
    """Of the scenes those that are there."""
    return [s for s in scenes if is_builtin(s) or not missing_file(a, s)]
