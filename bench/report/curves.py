# SPDX-License-Identifier: Apache-2.0
"""Speed against error of every method, a plot for each scene."""
import math
import statistics

from convergence import front
from report.methods import METHODS, derived, name_of, stepped_aside
from report.page import FORMATS, attributes, counted, figure, given, lookup, name, number, save_plot, setting, table
from report.svg import Plot, Series

TITLE = "Speed against error"
FLOOR = 2e-4  # errors below stand at the border
PANELS = [("frame", "whole frame: times faster than exact", "times"),
          ("shade", "shading alone: times faster", "times"),
          ("share", "shadow rays traced, of those of exact", "share")]
USEFUL = 0.1  # the largest error for which a setting may stand among those that nothing beats
APART = ("limit", "bdpt", "others")  # no rival of the others: bidirectional path tracing makes another picture


def percents(value):
    return f"{100 * value:g} %"


def scenes_of(rows, section):
    return list(dict.fromkeys(r["labels"]["scene"] for r in rows.values()
                              if r["labels"]["section"] == section and "point" in r))


def of_scene(rows, scene):
    return [r for r in rows.values() if r["labels"]["section"] == "curves" and r["labels"]["scene"] == scene and
            "point" in r and "draw" not in r["labels"]]


def best(points):
    """What no other beats in speed and error, exact included."""
    kept = [dict(row=r, time=1.0 / r["point"]["frame"], error=r["point"]["error"]) for r in points
            if r["labels"]["method"] not in APART and not stepped_aside(r) and r["point"]["frame"] > 1.0 and
            r["point"]["error"] <= USEFUL]
    return [k["row"] for k in front(kept, "time", "error")]


def series_of(points, method, what, form):
    """A method's points, joined from the least error to the largest; grid modes by their speed."""
    m = METHODS[method]

    def said(r):
        aside = " (all lights traced)" if stepped_aside(r) else ""
        return f'{name_of(r)}{aside}: {FORMATS[form](r["point"][what])} at {FORMATS["percent"](r["point"]["error"])}'

    own = [r for r in points if r["labels"]["method"] == method and r["point"].get(what)]
    own.sort(key=lambda r: r["point"][what] if method == "grid" else (r["point"]["error"], r["point"][what]))
    places = [(r["point"]["error"], r["point"][what], attributes(r, x="point.error", y=f"point.{what}"), said(r))
              for r in own]
    return Series(m.name, places, m.colour, m.shape, m.hollow, m.dashed)


def plot(points, what, title, form, large):
    size = (860, 520, 13) if large else (560, 400, 12)
    p = Plot("error: l_inf, of the light that is shadow-tested", title, *size, x_label=percents,
             y_label=percents if form == "share" else lambda v: f"{v:g}x", floor=FLOOR)
    p.series = [s for s in (series_of(points, m, what, form) for m in METHODS if m != "limit") if s.points]
    if form != "share":
        p.horizontal.append((1.0, "as fast as exact"))
        p.horizontal += [(r["point"][what], "limit: every light shaded, no visibility") for r in points
                         if r["labels"]["method"] == "limit"]
    if what == "frame":
        p.front = [(r["point"]["error"], r["point"][what]) for r in best(points)]
    p.vertical = [(0.01, percents(0.01)), (0.02, percents(0.02))]
    p.vertical += [(r["point"]["error"], "other lights") for r in points if r["labels"]["method"] == "others"]
    return p.svg()


def step_in_rays(points):
    """Punctual lights of which at least half as many rays as there are lights are wanted are traced, not drawn."""
    drawn = [r for r in points if r["labels"]["method"] in ("estimate", "selection") and not stepped_aside(r)]
    count = max((lookup(r, "figures.punctual_lights") or 0 for r in drawn), default=0)
    traced = sorted((r for r in drawn if r["labels"]["value"] >= 2 * count), key=lambda r: r["labels"]["value"])
    if count <= 8 or not traced or len(traced) == len(drawn):
        return ""
    return f" From K = {number(traced[0], 'labels.value', 'plain')} on the " \
           f"{number(traced[0], 'figures.punctual_lights', 'count')} punctual lights are not drawn but all traced, " \
           "as they are no more than half of K; the rays drawn go to the virtual lights alone: a step in rays."


def rays_cost(rows, points, scene):
    """What a shadow ray takes."""
    cached = min((r for r in points if r["labels"]["method"] == "cache"), key=lambda r: r["labels"]["value"],
                 default=None)
    base = next((r for r in points if r["labels"]["method"] == "limit"), None)
    if not cached or not base:
        return ""
    of_exact, of_cache = base["figures"]["mode_run"], cached["figures"]["mode_run"]
    figures = {"exact": 1e6 * of_exact["visibility_s"] / max(1, of_exact["rays_traced"]),
               "cache": 1e6 * of_cache["visibility_s"] / max(1, of_cache["rays_traced"])}
    row = derived(rows, f"curves/{scene}/per-ray", figures, [base["id"], cached["id"]])
    alone = " Here packets share nothing: a ray of theirs takes as long as one traced for itself, and saved rays are " \
            "saved time." if figures["exact"] > 0.8 * figures["cache"] else ""
    return f" A shadow ray takes {number(row, 'figures.exact', 'error')} microseconds in the packets of exact, " \
           f"{number(row, 'figures.cache', 'error')} in those that the cache gathers (C_E = " \
           f"{number(cached, 'labels.value', 'plain')}, look-ups included).{alone}"


def repeats(rows, points, scene):
    """By how much the frames differ of which medians were taken: more than exact's, as they are short."""
    own = [r for r in points if "frames_s" in r["figures"]]
    if len(own) < 2:
        return ""
    spreads = [max(r["figures"]["frames_s"]) / min(r["figures"]["frames_s"]) for r in own]
    row = derived(rows, f"curves/{scene}/repeats", {"frames": len(own), "middle": statistics.median(spreads),
                                                    "most": max(spreads)}, [r["id"] for r in own])
    return f" Of {number(row, 'figures.frames', 'count')} settings whose frames are medians, the slowest frame took " \
           f"{number(row, 'figures.middle', 'times')} as long as the fastest (the median of these; at most " \
           f"{number(row, 'figures.most', 'times')}): steps of a curve that are smaller mean nothing."


def caption_of(rows, points, scene):
    base = next((r for r in points if r["labels"]["method"] == "limit"), None)
    if not base:
        return f"{name(scene)}: {setting(points[0])}."
    others = next((r for r in points if r["labels"]["method"] == "others"), None)
    drawn = f" As many virtual lights of another draw make an image that is off by " \
            f"{number(others, 'point.error', 'percent')} (mean of {counted(others, 'figures.draws', 'draw')}, " \
            f"{number(others, 'figures.least', 'percent')} to {number(others, 'figures.most', 'percent')})." \
        if others else ""
    more = repeats(rows, points, scene) + drawn + rays_cost(rows, points, scene) + step_in_rays(points)
    return f"{name(scene)}: {setting(base)}. Exact takes {number(base, 'point.exact_s', 'seconds')} a frame, the " \
           f"median of {number(base, 'point.frames', 'plain')}, of which the slowest took " \
           f"{number(base, 'point.noise', 'times')} as long as the fastest. With visibility for nothing it would be " \
           f"{number(base, 'point.frame', 'times')} as fast (measured: the time of its shadow rays taken away).{more}"


def scene_section(a, rows, scene):
    points = of_scene(rows, scene)
    plots = [save_plot(a, f"curves-{scene}-{what}.svg", plot(points, what, title, form, what == "frame"))
             for what, title, form in PANELS]
    slow = {"others": " (as slow as exact)"}
    of_front = table([("what nothing beats", lambda r: name(name_of(r) + slow.get(r["labels"]["method"], ""))),
                      ("frame", lambda r: number(r, "point.frame", "times")),
                      ("shading", lambda r: number(r, "point.shade", "times")),
                      ("rays", lambda r: number(r, "point.share", "share")),
                      ("l_inf", lambda r: number(r, "point.error", "percent")),
                      ("FLIP", lambda r: number(r, "point.flip", "flip"))],
                     best(points) + [r for r in points if r["labels"]["method"] == "others"])
    inside = plots[0] + f'<div class="row">{plots[1]}{plots[2]}</div>' + of_front
    draws = [r for r in rows.values() if r["labels"].get("scene") == scene and "draw" in r["labels"]]
    return f"<h3>{name(scene)}</h3>" + figure(inside, caption_of(rows, points, scene), points + draws)


def speed_at(curve, error):
    """Of (error, speed) by error, between two points; None beyond them."""
    for (low, slow), (high, fast) in zip(curve, curve[1:]):
        if low <= error <= high and low < high:
            return slow * (fast / slow) ** (math.log(error / low) / math.log(high / low))
    return None


def at_equal_error(rows, method, base):
    """A row: by how much `method` is faster than `base` at its errors, least and most of the scenes' means, and in how
    many; None where their curves have no error in common."""
    means, used = {}, []
    for scene in scenes_of(rows, "curves"):
        ours, others = ([r for r in of_scene(rows, scene) if r["labels"]["method"] == m and r["point"]["error"] > 0]
                        for m in (method, base))
        curve = sorted((r["point"]["error"], r["point"]["frame"]) for r in others)
        found = [(r["point"]["frame"], speed_at(curve, r["point"]["error"])) for r in ours]
        ratios = [frame / other for frame, other in found if other]
        if ratios:
            means[scene] = statistics.geometric_mean(ratios)
            used += [r["id"] for r in (*ours, *others)]
    return derived(rows, f"curves/equal-error/{method}", {
        "scenes": len(means), "faster": sum(m > 1.0 for m in means.values()), "least": min(means.values()),
        "most": max(means.values())}, used) if means else None


HEAD = """<p>Exact frames stand at the beginning and among the others; by how much they differ, the clock may be wrong.
Frames of less than five seconds are medians of three; these differ more. Methods that shade fewer lights or
share shading between paths can be faster than exact with visibility for nothing. Where those that draw K lights have no
more than {} to draw from, all are traced instead. C_E is that of virtual lights; lights of the sky keep cells of one
pixel.
"Fewer lights" are other virtual lights (and fewer of the sky), "other lights" as many as exact has, both means over
draws: what lies left of their dotted line is less than the choice of lights changes anyway. Bidirectional path tracing
and the grid are compared with exact frames of their own.</p>"""


def section(a, rows):
    return HEAD.format(given("4 K + 16")) + "\n".join(scene_section(a, rows, s) for s in scenes_of(rows, "curves"))
