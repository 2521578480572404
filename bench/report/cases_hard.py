# SPDX-License-Identifier: Apache-2.0
"""Cases of the sections on hard shadows: maps beside the cache, flicker, edges. Their programs lie in bench/."""
import dataclasses

from report.cases import cost, kinds, sky, word
from report.runner import Case
from scenes import scene_words


def hard(a, level):
    """Of the hard lights of `lights` the first: kind, scene, the scene's words."""
    return next((kind, scene, [words[1]]) for kind, scene, words, _, range_of in kinds(a, level) if range_of == "hard")


def maps(a, level):
    """Beside the frames of `lights` by the cache."""
    kind, scene, words = hard(a, level)
    for size in level.maps:
        yield Case(f"maps/{scene}/{size}", ["shadow_maps", *words, "--size", level.size, "--spp", str(level.spp),
                                            "--map", word(size)],
                   {"section": "maps", "kind": kind, "scene": scene, "method": "maps", "value": size},
                   cost=0.5 + 3.5e-6 * size * size)


def moving(a, level):
    """Scenes that move: what moves, scene, kind of light, the scene's words, whether the cache can keep something."""
    with_sky = ["--env-lights", str(level.sequence["env_lights"])]
    kind, scene, words = hard(a, level)
    yield "camera", scene, kind, words, True
    if kind == "points and a sun":
        yield "light", scene, kind, words, True
    for scene in a.present(["shapes"]):
        yield "light", scene, "sky", scene_words(a, scene) + sky(a, scene) + with_sky, False
    for scene in a.present(["conference"]) or ["cornell"] if level.sequence["vpls"] else []:
        with_vpls = ["--vpls", str(level.sequence["vpls"])]
        yield "camera", scene, "virtual lights", scene_words(a, scene) + with_vpls, True


def flicker(a, level):
    s = level.sequence
    for motion, scene, kind, words, keeps in moving(a, level):
        plain = ("cache", "kept", "unrefined") if keeps else ("cache", "unrefined")
        ways = [f"{way}:{word(ce)}" for way in plain for ce in s["ce"]]
        many = kind in ("sky", "virtual lights")  # enough to draw some
        ways += [f"{way}:{k}" for way in ("estimate", "selection") for k in s["estimate"] if many]
        ways += [f"grid:{mode}" for mode in s["grid"] if kind == "sky"]
        yield Case(f"flicker/{motion}/{scene}/{kind.replace(' ', '-')}",
                   ["sequence", *words, "--size", s["size"], "--spp", str(s["spp"]), "--motion", motion, "--frames",
                    str(s["frames"]), "--ways", ",".join(ways)],
                   {"section": "flicker", "scene": scene, "method": "sequence", "kind": kind, "value": motion},
                   cost=cost(dataclasses.replace(level, size=s["size"]), s["spp"], s["vpls"] or s["env_lights"],
                             s["frames"] * (1 + 0.7 * len(ways))))


EDGE_WAYS = [order + plain for plain in ("", "-plain") for order in ("halton", "scanline", "random")]


def edges(a, level):
    e = level.edges
    _, of_points, words = hard(a, level)
    places = [(of_points, words)]
    places += [(s, scene_words(a, s) + sky(a, s) + ["--env-lights", "16"]) for s in a.present(["shapes"])]
    for scene, words in places:
        for ce in e["ce"]:
            case = Case(f"edges/{scene}/{ce}", ["edges", *words, "--size", e["size"], "--ce", str(ce)],
                        {"section": "edges", "scene": scene, "method": "edges", "value": ce},
                        cost=1 + 25 * cost(level, 1, 24, 1))
            if ce == e["shown"]:
                prefix = f"pictures/edges-{scene}"
                case.words += ["--picture", prefix]
                case.makes = tuple(f"{prefix}{zoom}-{way}.png" for zoom in ("", "-zoom")
                                   for way in ["exact", *EDGE_WAYS])
            yield case


HARD = [maps, edges, flicker]
