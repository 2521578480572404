# SPDX-License-Identifier: Apache-2.0
"""The methods that are compared: how plots draw them, what their knob is called, and the point that a row makes."""
import collections

Method = collections.namedtuple("Method", "name colour shape hollow dashed setting ours")

# Colours that differ for colour-blind eyes too (Okabe and Ito 2008), and shapes; hollow: a variant of what is filled.
# `ours`: the visibility cache takes part.
METHODS = {
    "estimate": Method("estimate from the cache", "#0072b2", "square", False, False, "K = {}", True),
    "cached-selection": Method("selection by the cache", "#0072b2", "square", True, True, "K = {}", True),
    "cache": Method("cache", "#d55e00", "circle", False, False, "C_E = {}", True),
    "cache-unrefined": Method("cache, not refined", "#d55e00", "circle", True, True, "C_E = {}", True),
    "cache-words": Method("cache, pair by pair", "#d55e00", "up", True, True, "C_E = {}", True),
    "selection": Method("stochastic selection, no cache", "#333333", "cross", False, False, "K = {}", False),
    "fewer": Method("fewer lights", "#777777", "down", False, True, "{} lights", False),
    "adaptive": Method("adaptive testing", "#009e73", "diamond", False, False, "T = {}", False),
    "adaptive-cache": Method("adaptive + cache", "#009e73", "diamond", True, True, "T = {}", True),
    "grid": Method("grid coherence", "#b0508a", "up", False, False, "{}", False),
    "bdpt": Method("bidirectional, cache", "#a87000", "down", True, True, "C_E = {}", True),
    "exact": Method("exact, all lights", "#9a9a9a", "diamond", False, True, "", False),
    "limit": Method("exact", "#333333", "cross", False, False, "", False),
    "reference": Method("converged", "#333333", "cross", False, False, "{} paths", False),
}


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


def of_fewer_lights(figures, exact, whole_over_lit):
    """The point of a frame alone, against the image and the times of `exact`. What is seen directly is the same in
    both, so that errors over the lit part are to those of the whole image in any frame as they are in all."""
    mode, error = figures["mode_run"], figures["reference"]["mode_run"]
    return {"error": error["l_inf"] * whole_over_lit, "flip": error["flip"],
            "frame": exact["frame_s"] / mode["frame_s"], "shade": exact["shade_s"] / mode["shade_s"],
            "share": mode["rays_traced"] / max(1, exact["rays"])}


def of_limit(figures):
    """What a frame would gain if visibility cost nothing and all else stayed as it is."""
    exact = figures["exact"]
    seen = exact["visibility_s"]
    return {"error": 0.0, "frame": exact["frame_s"] / max(1e-9, exact["frame_s"] - seen),
            "shade": exact["shade_s"] / max(1e-9, exact["shade_s"] - seen), "share": 0.0,
            "noise": figures["speedup"]["frame"]}


def of_converged(figures):
    """The point of a frame alone against a converged image."""
    error = figures["reference"]["mode_run"]
    return {"time": figures["mode_run"]["frame_s"], **{k: error[k] for k in ("rel_mse", "l_inf", "flip")}}


def derived(rows, id, figures, parents):
    """A row of what was computed from others, so that the page can show it."""
    rows[id] = {"id": id, "command": "computed from " + ", ".join(parents), "labels": {"section": "derived"},
                "figures": figures}
    return rows[id]


def add_points(rows):
    """Gives each row its `point`, from its own figures and those of its base."""
    ratio = {}
    for row in rows.values():
        error = row["figures"].get("error", {})
        if row["labels"].get("base") and error.get("l_inf_whole"):
            ratio.setdefault(row["labels"]["base"], error["l_inf"] / error["l_inf_whole"])
    for row in rows.values():
        figures, labels = row["figures"], row["labels"]
        if labels.get("method") == "limit":
            row["point"] = of_limit(figures)
        elif labels["section"] == "converged":
            if "reference" in figures:
                row["point"] = of_converged(figures)
        elif "error" in figures:
            row["point"] = compared(figures)
            if labels["method"] == "bdpt":
                row["point"]["shade"] = None  # its shading is not apart
        elif labels.get("method") == "fewer" and labels["base"] in rows and labels["base"] in ratio:
            base = rows[labels["base"]]["figures"]
            row["point"] = of_fewer_lights(figures, base["exact"], ratio[labels["base"]])
