# SPDX-License-Identifier: Apache-2.0
"""The one list of all cases: what is rendered for which section. How much of it: levels.py."""
import os

import convergence
from report import made, study_cases
from report.runner import Case
from scenes import is_builtin, missing_file, scene_words

# Environments as directional lights, which are what the grid decides: outdoors, and in rooms lit through windows.
BY_SKY = ["atrium", "shapes", "dominoes", "plant", "living-room", "san-miguel", "hair-straight"]
OWN_SKY = ["atrium"]

# --visibility and the knob of each method
HOW = {"cache": lambda v: ["--visibility", "cache", "--ce", v],
       "cache-once": lambda v: ["--visibility", "cache", "--ce", v, "--refine", "2"],
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


def cost(level, spp, lights, frames):
    """About how long frames take, in any unit: for the time that is left."""
    width, height = map(int, level.size.split("x"))
    return width * height * spp * (lights + 30) * frames / 1e8 + 0.3


def sky(a, scene):
    """An environment for what has none: the maps' folder, or one that the report makes."""
    if scene not in BY_SKY or scene in OWN_SKY or "--env" in scene_words(a, scene):
        return []
    path = os.path.join(a.scenes, "hdri", "kloppenheim_05_1k.hdr")
    return ["--env", path if os.path.exists(path) else "made/sun.hdr"]


def spp_of(level, scene):
    return level.slow.get(scene, level.spp)


def setting(a, level, scene, spp=None, one_in=1):
    """A scene and its lights: whole frames as they come, but for skies as lights. `one_in`: so many fewer of those
    that are drawn."""
    words = ["whitted", *scene_words(a, scene), *sky(a, scene), "--size", level.size, "--spp",
             str(spp or spp_of(level, scene)), "--vpls", str(level.vpls // one_in)]
    return words + (["--env-lights", str(level.env_lights // one_in)] if scene in BY_SKY else [])


def curve_image(scene, method):
    return f"images/curves-{scene}-{method}.exr"


CLOCK = "cache"  # of this method the first and the last frame stand beside an exact one of their own


def clocks_of(level):
    return (level.sweeps[CLOCK][0], level.sweeps[CLOCK][-1])


def spread(clocks, others):
    """The clocks among the others, at equal distances."""
    of = -(-len(others) // max(1, len(clocks)))
    return [c for i, clock in enumerate(clocks) for c in (clock, *others[i * of:(i + 1) * of])] or others


def curve_case(a, level, scene, method, value):
    """Beside an exact frame of its own if it is a clock or medians are asked for; else alone, against the exact image,
    whose time the scene's exact frames give (methods.of_alone)."""
    base, image = f"curves/{scene}/exact", curve_image(scene, "exact")
    full = cost(level, spp_of(level, scene), level.vpls, 1)
    labels = {"section": "curves", "scene": scene, "method": method, "value": value, "base": base}
    case = Case(f"curves/{scene}/{method}/{word(value)}", [], labels, (base,))
    clock = method == CLOCK and value in clocks_of(level)
    paired = clock or method == "grid" or level.runs > 1  # the grid's eye samples are others
    if method == "bdpt":
        spp, paired = str(level.bdpt_spp), True
        words = ["bdpt", *scene_words(a, scene), *sky(a, scene), "--size", level.size, "--spp", spp, "--epoch", spp]
        words += HOW["cache"](word(value))
    else:
        words = setting(a, level, scene) + HOW[method](word(value))
    if level.pictures.get(method) == value:
        case.makes = (curve_image(scene, method),)
        words += ["-o", *case.makes]
    if paired:
        case.words, case.needs = compare(a, words, 1 if method == "bdpt" else level.runs), ()
        case.cost = (1.0 + SHARE[method]) * full * (1 if method == "bdpt" else level.runs)
    else:
        case.words = alone(a, words + ["--reference", image])
        case.cost = full * SHARE[method]
    return case


def draws(a, level, scene):
    """Exact with other lights: as many, and fewer; each draw a row. That of the exact image is draw 0."""
    base, full = f"curves/{scene}/exact", cost(level, spp_of(level, scene), level.vpls, 1)
    for one_in in (1, *level.sweeps["fewer"]):
        method = "fewer" if one_in > 1 else "others"
        for draw in range(1, level.draws + 1):
            words = setting(a, level, scene, one_in=one_in) + ["--visibility", "exact", "--vpl-draw", str(draw),
                                                               "--reference", curve_image(scene, "exact")]
            labels = {"section": "curves", "scene": scene, "method": method, "value": one_in if one_in > 1 else "",
                      "base": base, "draw": draw}
            yield Case(f"curves/{scene}/{method}/{f'{one_in}/' if one_in > 1 else ''}{draw}", alone(a, words), labels,
                       (base,), cost=full / one_in)


# How long a frame takes, by method, as a share of exact's; for the time that is left.
SHARE = {"cache": 0.4, "cache-once": 0.4, "cache-unrefined": 0.4, "cache-words": 0.5, "estimate": 0.1,
         "cached-selection": 0.1, "selection": 0.15, "adaptive": 0.6, "adaptive-cache": 0.4, "grid": 0.8,
         "bdpt": -0.5}  # fewer paths


def curves(a, level):
    for scene in a.present(level.scenes):
        base, image = f"curves/{scene}/exact", curve_image(scene, "exact")
        yield Case(base, alone(a, setting(a, level, scene) + ["--visibility", "exact", "-o", image]),
                   {"section": "curves", "scene": scene, "method": "limit", "value": "", "base": base}, makes=(image,),
                   cost=cost(level, spp_of(level, scene), level.vpls, 1))
        made = [curve_case(a, level, scene, method, value) for method, values in level.sweeps.items()
                for value in values if method != "fewer" and (method != "grid" or scene in BY_SKY)]
        made += draws(a, level, scene)
        clocks = [c for c in made if c.labels["method"] == CLOCK and c.labels["value"] in clocks_of(level)]
        yield from spread(clocks, [c for c in made if c not in clocks])


def kinds(a, level):
    """Kinds of light: name, scene, whitted's words for it without C_E, the options that take C_E, hard or soft."""
    delta = [made.SOURCE] if level.real_lights else []
    if a.present(delta):
        yield ("points and a sun", made.SOURCE, ["whitted", "made/delta.glb", "--vpls", "0", "--light-samples", "0"],
               ["--ce-delta"], "hard")
    yield ("spots", "conference-lights", ["whitted", "conference-lights", "--vpls", "0"], ["--ce-delta"], "hard")
    for scene in a.present(["kitchen"] if level.real_lights else []) or ["cornell"]:
        yield ("area lights", scene, ["whitted", *scene_words(a, scene), "--vpls", "0", "--light-samples",
                                      str(level.light_samples)], ["--ce-samples"], "soft")
    for scene in a.present(["living-room", "san-miguel"] if level.real_lights else []) or ["shapes"]:
        words = ["whitted", *scene_words(a, scene), *sky(a, scene), "--vpls", str(level.vpls), "--env-lights",
                 str(level.env_lights)]
        yield ("sky and virtual lights", scene, words, ["--ce", "--ce-delta"], "soft")
    for scene in a.present(["hair-straight"] if level.real_lights else []):
        yield ("hair", scene, ["whitted", *scene_words(a, scene), "--vpls", str(level.vpls // 4), "--env-lights",
                               str(level.env_lights // 4)], ["--ce", "--ce-delta"], "soft")


def lights(a, level):
    for kind, scene, words, knobs, range_of in kinds(a, level):
        for aliased, spp in ((0, level.spp), (1, 1)):
            for value in level.ranges[range_of][aliased]:
                given = ["--size", level.size, "--spp", str(spp), "--visibility", "cache"]
                given += [w for k in knobs for w in (k, word(value))]
                short = aliased or "--light-samples" in words or range_of == "hard"  # frames, which are soon disturbed
                runs = max(level.runs, level.repeated if short else 1)
                yield Case(f"lights/{kind.replace(' ', '-')}/{scene}/{spp}spp/{word(value)}",
                           compare(a, words + given, runs),
                           {"section": "lights", "kind": kind, "scene": scene, "method": "cache", "value": value,
                            "anti_aliased": not aliased}, cost=cost(level, spp, level.vpls, 1.4 * runs))


def converged(a, level):
    for scene in a.present(level.converged):
        base, image = f"converged/{scene}/reference", f"images/converged-{scene}.exr"
        labels = {"section": "converged", "scene": scene, "method": "reference", "value": level.reference_spp}
        how = ["--visibility", "exact", "--select", "8", "-o", image]
        yield Case(base, alone(a, setting(a, level, scene, spp=level.reference_spp) + how), labels, makes=(image,),
                   cost=cost(level, level.reference_spp, 8, 1))
        for method, (options, knob, _, paths) in convergence.METHODS.items():
            for value in level.converged_knobs[method]:
                every = method in ("exact", "cache")  # with many paths they take longer than is of interest
                most = max(1, level.reference_spp // convergence.SHARED // {"exact": 8, "cache": 4}.get(method, 1))
                for spp in (p for p in paths if p <= most):
                    words = setting(a, level, scene, spp=spp) + options + ([knob, word(value)] if knob else [])
                    labels = {"section": "converged", "scene": scene, "method": method,
                              "value": "" if value is None else value, "spp": spp, "base": base}
                    yield Case(f"converged/{scene}/{method}/{word(value or 'all')}/{spp}spp",
                               alone(a, words + ["--reference", image]), labels, (base,),
                               cost=cost(level, spp, level.vpls if every else value, 1))


def pictures(a, level):
    for scene in a.present(level.scenes):
        exact = curve_image(scene, "exact")
        for method, value in level.pictures.items():
            prefix = f"pictures/{scene}-{method}"
            yield Case(f"pictures/{scene}/{method}", ["zoom", exact, curve_image(scene, method), prefix],
                       {"section": "pictures", "scene": scene, "method": method, "value": value},
                       (f"curves/{scene}/exact", f"curves/{scene}/{method}/{word(value)}"),
                       tuple(f"{prefix}-{what}.png" for what in ("exact", "other", "error", "flip")), 0.3)


# A section adds its generator here; each takes the options and the level and yields its cases.
ALL = [curves, lights, converged, pictures, *study_cases.ALL]


def present(a, scenes):
    """Of the scenes those that are there."""
    return [s for s in scenes if is_builtin(s) or not missing_file(a, s)]
