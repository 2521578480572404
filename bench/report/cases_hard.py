# SPDX-License-Identifier: Apache-2.0
"""Cases of the sections on hard shadows: maps beside the cache, flicker, edges. Their programs lie in bench/."""
from report.cases import kinds, word
from report.runner import Case


def maps(a, level):
    """Of the hard lights of `lights`, whose frames by the cache are shown beside, the first."""
    kind, scene, words = next((k, s, w) for k, s, w, _, range_of in kinds(a, level) if range_of == "hard")
    for size in level.maps:
        yield Case(f"maps/{scene}/{size}", ["shadow_maps", words[1], "--size", level.size, "--spp", str(level.spp),
                                            "--map", word(size)],
                   {"section": "maps", "kind": kind, "scene": scene, "method": "maps", "value": size},
                   cost=0.5 + 8e-6 * size * size)


HARD = [maps]
