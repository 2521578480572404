# SPDX-License-Identifier: Apache-2.0
"""Error against the converged image over the seconds of a frame: what a picture costs, whatever the method."""
import statistics

from convergence import at_time, equal_times, front
from report.curves import scenes_of
from report.methods import METHODS, derived, name_of
from report.page import FORMATS, attributes, counted, figure, given, name, number, save_plot, setting, table
from report.svg import Plot, Series

TITLE = "Against the converged image, at equal time"
BASE = "selection"


def curves_of(rows, scene):
    """By method what no other of its points beats, fastest first, as convergence.py has it."""
    curves = {}
    for method in METHODS:
        points = [{"frame_s": r["point"]["time"], "rel_mse": r["point"]["rel_mse"], "row": r} for r in rows.values()
                  if r["labels"]["section"] == "converged" and r["labels"]["scene"] == scene and
                  r["labels"]["method"] == method and "point" in r]
        if points:
            curves[method] = front(points)
    return curves


def plot(curves):
    p = Plot("seconds a frame", "relMSE against the converged image", 860, 480)
    for method, curve in curves.items():
        m = METHODS[method]
        points = [(c["frame_s"], c["rel_mse"], attributes(c["row"], x="point.time", y="point.rel_mse"),
                   f'{name_of(c["row"])}, {c["row"]["labels"]["spp"]} paths: {FORMATS["error"](c["rel_mse"])} in '
                   f'{FORMATS["seconds"](c["frame_s"])}') for c in curve]
        p.series.append(Series(m.name, points, m.colour, m.shape, m.hollow, m.dashed))
    return p.svg()


def ratios(rows, scene, curves):
    """Rows of the methods' errors at equal times, and a row of the means of these over the base's."""
    at, means = [], {}
    for i, seconds in enumerate(equal_times(curves)):
        figures = {"seconds": seconds, **{m: at_time(c, seconds) for m, c in curves.items()}}
        if all(figures[m] for m in curves if m != "exact"):
            parents = [c["row"]["id"] for curve in curves.values() for c in curve]
            at.append(derived(rows, f"converged/{scene}/at/{i}", figures, parents))
    for m in curves:
        shares = [r["figures"][m] / r["figures"][BASE] for r in at if r["figures"][m] and r["figures"].get(BASE)]
        if shares and m != BASE:
            means[m] = statistics.geometric_mean(shares)
    return at, derived(rows, f"converged/{scene}/means", means, [r["id"] for r in at]) if means else None


def is_less(ratio):
    """By more than what the clock, by which errors go down, may be wrong."""
    return ratio < 0.9


def verdict(means):
    if means is None:
        return "<p>The curves have no time in common: nothing is said of who is better.</p>"
    lines = []
    for m, ratio in means["figures"].items():
        how = "less" if is_less(ratio) else "more" if is_less(1 / ratio) else "about the same"
        colour = "wins" if is_less(ratio) else ""
        if METHODS[m].ours and is_less(1 / ratio):
            how, colour = "more: <b>it loses</b>", "loses"
        lines.append(f'<li class="{colour}">{METHODS[m].name}: {number(means, f"figures.{m}", "times")} the relMSE of '
                     f"{METHODS[BASE].name} in the same seconds ({how})</li>")
    return f'<ul class="plain">{"".join(lines)}</ul>'


def shared_noise(rows, scene):
    """What no way of drawing lights takes away: exact, which draws none, over the base at the same paths."""
    of = {m: [r for r in rows.values() if r["labels"]["section"] == "converged" and r["labels"]["scene"] == scene and
              r["labels"]["method"] == m and "point" in r] for m in ("exact", BASE)}
    pairs = [(e, b) for e in of["exact"] for b in of[BASE] if e["labels"]["spp"] == b["labels"]["spp"]]
    if not pairs:
        return ""
    exact, base = max(pairs, key=lambda p: (p[0]["labels"]["spp"], -p[1]["labels"]["value"]))
    row = derived(rows, f"converged/{scene}/shared", {"share": exact["point"]["rel_mse"] / base["point"]["rel_mse"]},
                  [exact["id"], base["id"]])
    return f" With {counted(exact, 'labels.spp', 'path')} a pixel exact, which draws no lights, has " \
           f"{number(row, 'figures.share', 'share')} of the relMSE of {METHODS[BASE].name} " \
           f"({name(name_of(base).rsplit(', ', 1)[1])}): that much is noise of samples of lamps and skies and of " \
           "places in the pixel, which all methods share."


def scene_section(a, rows, scene):
    curves = curves_of(rows, scene)
    own = [c["row"] for curve in curves.values() for c in curve]
    reference = rows.get(own[0]["labels"]["base"])
    at, means = ratios(rows, scene, curves)
    columns = [("seconds", lambda r: number(r, "figures.seconds", "seconds"))]
    columns += [(METHODS[m].name, lambda r, m=m: number(r, f"figures.{m}", "error")) for m in curves]
    figures = f"<details><summary>errors at equal times</summary>{table(columns, at)}</details>" if at else ""
    caption = f"{name(scene)}: {setting(own[0])}, and more; the converged image has " \
              f"{number(reference, 'figures.spp', 'plain')} paths a pixel, exact visibility and the same lights. " \
              "Lower and further left is better. Only what no other point of its method beats is drawn; ratios are " \
              "geometric means over equal times, read off the curves; within a tenth counts as the same." + \
              shared_noise(rows, scene)
    drawn = save_plot(a, f"converged-{scene}.svg", plot(curves))
    return f"<h3>{name(scene)}</h3>" + figure(drawn + verdict(means) + figures, caption, own)


def section(a, rows):
    head = "<p>All other errors here are the cache's alone, against the exact image of the same samples. This asks " \
           "how far a picture is from the converged one after so many seconds, noise included: a method that is fast " \
           f"can afford more paths. Stochastic selection draws K lights a path by their unoccluded contribution " \
           f"{given('(no cache)')}.</p>"
    return head + "\n".join(scene_section(a, rows, s) for s in scenes_of(rows, "converged"))
