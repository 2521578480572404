# SPDX-License-Identifier: Apache-2.0
"""The methods that are compared: how plots draw them, what their knob is called, and the point that a row makes."""
import collections
import statistics

Method = collections.namedtuple("Method", "name colour shape hollow dashed setting ours")

# Colours that differ for colour-blind eyes too (Okabe and Ito 2008), and shapes; hollow: a variant of what is filled.
# `ours`: the visibility cache takes part.
METHODS = {
    "estimate": Method("estimate from the cache", "#0072b2", "square", False, False, "K = {}", True),
    "cached-selection": Method("selection by the cache", "#0072b2", "square", True, True, "K = {}", True),
    "cache": Method("cache", "#d55e00", "circle", False, False, "C_E = {}", True),
    "cache-once": Method("cache, refined once", "#d55e00", "diamond", True, False, "C_E = {}", True),
    "cache-unrefined": Method("cache, not refined", "#d55e00", "circle", True, True, "C_E = {}", True),
    "cache-words": Method("cache, pair by pair", "#d55e00", "up", True, True, "C_E = {}", True),
    "selection": Method("stochastic selection, no cache", "#333333", "cross", False, False, "K = {}", False),
    "fewer": Method("fewer lights", "#777777", "down", False, True, "1 in {}", False),
    "others": Method("other lights, same number", "#777777", "cross", True, True, "", False),
    "adaptive": Method("adaptive testing", "#009e73", "diamond", False, False, "T = {}", False),
    "adaptive-cache": Method("adaptive + cache", "#009e73", "diamond", True, True, "T = {}", True),
    "grid": Method("grid coherence", "#b0508a", "up", False, False, "{}", False),
    "bdpt": Method("bidirectional, cache", "#a87000", "down", True, True, "C_E = {}", True),
    "exact": Method("exact, all lights", "#9a9a9a", "diamond", False, True, "", False),
    "limit": Method("exact", "#333333", "cross", False, False, "", False),
    "reference": Method("converged", "#333333", "cross", False, False, "{} paths", False),
}


# Compared with exact frames of their own, which are others: of other paths, of other eye samples.
OWN_EXACT = ("bdpt", "grid")


def setting_of(row):
    """"C_E = 16"."""
    value = row["labels"]["value"]
    return METHODS[row["labels"]["method"]].setting.format(f"{value:g}" if isinstance(value, (int, float)) else value)


def name_of(row):
    return ", ".join(t for t in (METHODS[row["labels"]["method"]].name, setting_of(row)) if t)


def stepped_aside(row):
    """Where a draw of lights saves nothing, all are traced: that is exact, whatever was asked for."""
    drawn = row["labels"]["method"] in ("estimate", "selection", "cached-selection")
    return drawn and row["figures"].get("served") == "exact"


def compared(figures):
    """The point of a frame beside the exact one, rendered in turn with it."""
    exact, mode, error, faster = (figures[k] for k in ("exact", "mode_run", "error", "speedup"))
    return {"error": error["l_inf"], "flip": error.get("flip"), "frame": faster["frame"], "shade": faster["shade"],
            "share": mode["rays_traced"] / max(1, exact["rays"]), "ray_reduction": faster["rays"],
            "mispredicted": error["mispredicted"]}


class Scene:
    """What the exact frames of a scene say together: their times, and errors over the lit part to those of the whole
    image, which are in any frame as in all, since what is seen directly is the same."""

    def __init__(self, base):
        self.rays, self.frames, self.whole_over_lit = base["mode_run"]["rays_traced"], [base["mode_run"]], None

    def beside(self, figures):
        self.frames.append(figures["exact"])
        if figures["error"]["l_inf_whole"]:
            self.whole_over_lit = figures["error"]["l_inf"] / figures["error"]["l_inf_whole"]

    def median(self, field):
        return statistics.median(f[field] for f in self.frames)


def of_alone(figures, exact):
    """The point of a frame alone, against the image and the times of a Scene."""
    mode, error = figures["mode_run"], figures["reference"]["mode_run"]
    return {"error": error["l_inf"] * exact.whole_over_lit, "flip": error["flip"],
            "frame": exact.median("frame_s") / mode["frame_s"], "shade": exact.median("shade_s") / mode["shade_s"],
            "share": mode["rays_traced"] / max(1, exact.rays)}


def of_limit(exact):
    """What a frame would gain if visibility cost nothing and all else stayed as it is; the times of exact frames."""
    frames, seen = [f["frame_s"] for f in exact.frames], exact.median("visibility_s")
    frame, shade = statistics.median(frames), exact.median("shade_s")
    return {"error": 0.0, "frame": frame / max(1e-9, frame - seen), "shade": shade / max(1e-9, shade - seen),
            "share": 0.0, "exact_s": frame, "frames": len(frames), "noise": max(frames) / min(frames)}


def of_converged(figures):
    """The point of a frame alone against a converged image."""
    error = figures["reference"]["mode_run"]
    return {"time": figures["mode_run"]["frame_s"], **{k: error[k] for k in ("rel_mse", "l_inf", "flip")}}


def derived(rows, id, figures, parents, labels=None):
    """A row of what was computed from others, so that the page can show it."""
    rows[id] = {"id": id, "command": "computed from " + ", ".join(parents), "labels": labels or {"section": "derived"},
                "figures": figures}
    return rows[id]


def clock(rows, id, of):
    """A row of how much exact frames differ that should take the same: slowest over fastest, the most over groups of
    one setting. `of`: (setting, seconds, id). None where there is but one of each."""
    groups = {}
    for setting, seconds, _ in of:
        groups.setdefault(setting, []).append(seconds)
    spreads = [max(g) / min(g) for g in groups.values() if len(g) > 1]
    return derived(rows, id, {"most": max(spreads)}, [i for _, _, i in of]) if spreads else None


def add_means(rows):
    """Of several draws of lights one row: means of errors, medians of speeds. Those of as many lights as exact has are
    as slow as it."""
    of = {}
    for row in rows.values():
        if "draw" in row["labels"] and "point" in row:
            of.setdefault(row["id"].rsplit("/", 1)[0], []).append(row)
    for id, own in of.items():
        points, labels = [r["point"] for r in own], own[0]["labels"]
        row = derived(rows, id, {"draws": len(own), "least": min(p["error"] for p in points),
                                 "most": max(p["error"] for p in points)}, [r["id"] for r in own],
                      {k: v for k, v in labels.items() if k != "draw"})
        row["point"] = {k: statistics.fmean(p[k] for p in points) for k in ("error", "flip")}
        if labels["method"] != "others":
            row["point"].update({k: statistics.median(p[k] for p in points) for k in ("frame", "shade", "share")})


def add_points(rows):
    """Gives each row its `point`, from its own figures and those of its scene's exact frames."""
    scenes = {i: Scene(r["figures"]) for i, r in rows.items() if r["labels"].get("method") == "limit"}
    for row in rows.values():
        exact, figures = scenes.get(row["labels"].get("base")), row["figures"]
        if exact and "error" in figures and row["labels"]["method"] not in OWN_EXACT:
            exact.beside(figures)
    for row in rows.values():
        figures, labels, exact = row["figures"], row["labels"], scenes.get(row["labels"].get("base"))
        if labels.get("method") == "limit":
            row["point"] = of_limit(exact)
        elif labels["section"] == "converged":
            if "reference" in figures:
                row["point"] = of_converged(figures)
        elif "error" in figures:
            row["point"] = compared(figures)
            if labels["method"] == "bdpt":
                row["point"]["shade"] = None  # its shading is not apart
        elif exact and exact.whole_over_lit and "reference" in figures:
            row["point"] = of_alone(figures, exact)
    add_means(rows)
