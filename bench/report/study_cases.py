# SPDX-License-Identifier: Apache-2.0
"""Cases of the sections that look at one thing at a time; as those of cases.py, which lists them."""
from report import cases
from report.runner import Case
from scenes import scene_words


def replayed(a, level, scene, spp, options):
    """A view's pairs recorded and one policy replayed against them."""
    return ["clusters", *scene_words(a, scene), "--size", level.size, "--spp", str(spp), "--vpls", str(level.vpls),
            "--threads", str(a.threads), *options]


def clusters(a, level):
    of = level.clusters
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


ALL = [clusters]
