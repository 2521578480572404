# SPDX-License-Identifier: Apache-2.0
"""Cases of the sections that look at one thing at a time; as those of cases.py, which lists them."""
import dataclasses

from report import cases, seen
from report.runner import Case
from scenes import scene_words


def replayed(a, level, scene, spp, options):
    """A view's pairs recorded and one policy replayed against them."""
    return ["clusters", *scene_words(a, scene), "--size", level.size, "--spp", str(spp), "--vpls", str(level.vpls),
            "--threads", str(a.threads), *options]


def clusters(a, level):
    of = level.clusters
    level = dataclasses.replace(level, size=level.studies["size"])
    variants = {"refined": [], "unrefined": ["--refine", "1"], "shared": ["--share"]}
    for scene in a.present(of["scenes"]):
        for spp, values in ((level.spp, of["ce"]), (1, of["one"])):
            for value in values:
                for variant, options in variants.items():
                    if variant != "refined" and (spp == 1 or value not in of["also"]):
                        continue
                    words = replayed(a, level, scene, spp, ["--ce", cases.word(value), *options])
                    labels = {"section": "clusters", "scene": scene, "variant": variant, "value": value, "spp": spp}
                    yield Case(f"clusters/{scene}/{spp}spp/{variant}/{value}", words, labels,
                               cost=cases.cost(level, spp, level.vpls, 4))


HASHES = ("split", "lcg-pair", "lcg-xorshift")
REPLAYED = {"default": [], "orientation": ["--cn", "1"], "around-8": ["--around", "8"], "around-64": ["--around", "64"],
            "around-72": ["--around", "72"]}


def parameters(a, level):
    of = level.studies
    level = dataclasses.replace(level, size=of["size"], spp=of["spp"], runs=max(level.runs, of["runs"]))
    cost = cases.cost(level, level.spp, level.vpls, 2)
    for scene in a.present(of["scenes"]):
        def timed(parameter, value, options):
            words = cases.setting(a, level, scene) + ["--visibility", "cache", "--ce", cases.word(of["ce"]), *options]
            labels = {"section": "parameters", "scene": scene, "method": "cache", "parameter": parameter,
                      "value": value}
            return Case(f"parameters/{scene}/{parameter}/{cases.word(value)}", cases.compare(a, words, level.runs),
                        labels, cost=level.runs * cost)

        yield timed("default", "", [])
        for option, values in of["options"].items():
            for value in values:
                yield timed(option, value, [f"--{option}", cases.word(value)])
        for value in HASHES:
            yield timed("hash", value, ["--store", "words", "--hash", value])
        for parameter, options in (*REPLAYED.items(), *((f"keys-{h}", ["--hash", h, "--cache-mb", str(of["table_mb"])])
                                                         for h in HASHES)):
            words = replayed(a, level, scene, level.spp, ["--ce", cases.word(of["ce"]), *options])
            labels = {"section": "parameters", "scene": scene, "parameter": parameter, "value": "replayed"}
            yield Case(f"parameters/{scene}/replayed/{parameter}", words, labels, cost=2 * cost)


def seeing(a, level):
    """Of each thing that is to be seen: how it should be, how it looks, how it looks with another option."""
    of = level.seeing
    for thing in seen.things(of["lights"]):
        base = ["whitted", *scene_words(a, thing.scene), "--size", of["size"], *thing.setting]
        id = f"seeing/{thing.id}"
        images = {w: f"images/seeing-{thing.id}-{w}.exr" for w in ("exact", "before", "after")}
        labels = {"section": "seeing", "thing": thing.id, "method": "", "value": ""}
        cost = cases.cost(dataclasses.replace(level, size=of["size"]), 4, of["lights"], 2)
        exact = [*base, *thing.exact, "--visibility", "exact"]
        yield Case(f"{id}/exact", cases.alone(a, exact + ["-o", images["exact"]]), {**labels, "which": "exact"},
                   makes=(images["exact"],), cost=cost)
        for which, options in (("before", thing.before), ("after", thing.after)):
            words = [*base, *options, "-o", images[which]]
            if thing.exact:  # another set of lights: against their image
                words = cases.alone(a, words + ["--visibility", "exact", "--reference", images["exact"]])
            else:
                words = cases.compare(a, words, level.runs)
            yield Case(f"{id}/{which}", words, {**labels, "which": which}, (f"{id}/exact",), (images[which],), cost)
        prefix = f"pictures/seeing-{thing.id}"
        yield Case(f"{id}/zoom", ["zoom", images["exact"], images["before"], prefix, images["after"]],
                   {**labels, "which": "zoom"}, tuple(f"{id}/{w}" for w in images), (f"{prefix}-strip.png",), 0.3)


ALL = [clusters, parameters, seeing]
