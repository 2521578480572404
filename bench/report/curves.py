# SPDX-License-Identifier: Apache-2.0
"""Speed against error of every method, a plot for each scene."""
from convergence import front
from report.methods import METHODS, name_of, stepped_aside
from report.page import FORMATS, attributes, figure, name, number, save_plot, setting, table
from report.svg import Plot, Series

TITLE = "Speed against error"
FLOOR = 2e-4  # errors below stand at the border
PANELS = [("frame", "whole frame: times faster than exact", "times"), ("shade", "shading alone: times faster", "times"),
          ("share", "shadow rays traced, of those of exact", "share")]


def percents(value):
    return f"{100 * value:g} %"


def of_scene(rows, scene):
    return [r for r in rows.values() if r["labels"]["section"] == "curves" and r["labels"]["scene"] == scene and "point" in r]


def best(points):
    """What no other beats in speed and error; pairs of paths are another picture and have no part in it."""
    kept = [dict(row=r, time=1.0 / r["point"]["frame"], error=r["point"]["error"]) for r in points
            if r["labels"]["method"] not in ("limit", "bdpt") and not stepped_aside(r)]
    return [k["row"] for k in front(kept, "time", "error")]


def tooltip(row, what, form):
    aside = " (all lights traced)" if stepped_aside(row) else ""
    return f'{name_of(row)}{aside}: {FORMATS[form](row["point"][what])} at {FORMATS["percent"](row["point"]["error"])}'


def plot(points, what, title, form, large):
    size = (860, 520, 13) if large else (560, 400, 12)
    limit = next((r for r in points if r["labels"]["method"] == "limit"), None)
    p = Plot("error: l_inf, of the light that is shadow-tested", title, *size, x_label=percents,
             y_label=percents if form == "share" else lambda v: f"{v:g}x", floor=FLOOR)
    for key, m in METHODS.items():
        own = [r for r in points if r["labels"]["method"] == key and key != "limit" and r["point"].get(what)]
        own.sort(key=lambda r: (r["point"]["error"], r["point"][what]))
        if key == "grid":
            own.sort(key=lambda r: r["point"][what])
        if own:
            p.series.append(Series(m.name, [(r["point"]["error"], r["point"][what], attributes(
                r, x="point.error", y=f"point.{what}"), tooltip(r, what, form)) for r in own], m.colour, m.shape, m.hollow, m.dashed))
    if form != "share":
        p.horizontal.append((1.0, "as fast as exact"))
        if limit:
            p.horizontal.append((limit["point"][what], "limit: every light shaded, no visibility"))
        p.front = [(max(FLOOR, r["point"]["error"]), r["point"][what]) for r in best(points) if r["point"].get(what)] \
            if what == "frame" else []
    p.vertical = [(0.01, percents(0.01)), (0.02, percents(0.02))]
    return p.svg()


def scene_section(a, rows, scene):
    points = of_scene(rows, scene)
    base = next((r for r in points if r["labels"]["method"] == "limit"), points[0])
    plots = [save_plot(a, f"curves-{scene}-{what}.svg", plot(points, what, title, form, what == "frame"))
             for what, title, form in PANELS]
    front_rows = best(points)
    of_front = table([("nothing beats", lambda r: name(name_of(r))), ("faster", lambda r: number(r, "point.frame", "times")),
                      ("shading", lambda r: number(r, "point.shade", "times")),
                      ("rays", lambda r: number(r, "point.share", "share")), ("l_inf", lambda r: number(r, "point.error", "percent")),
                      ("FLIP", lambda r: number(r, "point.flip", "flip"))], front_rows)
    caption = f"{name(scene)}: {setting(base)}. Exact takes {number(base, 'figures.exact.frame_s', 'seconds')} a frame; with " \
              f"visibility for nothing it would be {number(base, 'point.frame', 'times')} as fast (measured: the time of its shadow rays taken " \
              "away). Methods that shade fewer lights or share shading between paths can be faster than that. " \
              f"Exact against itself came out as {number(base, 'point.noise', 'times')}: so far are times to be believed."
    if any(r["labels"]["method"] == "bdpt" for r in points):
        caption += " Bidirectional path tracing is compared with its own exact frame, which is another picture."
    inside = plots[0] + f'<div class="row">{plots[1]}{plots[2]}</div>' + of_front
    return f"<h3>{name(scene)}</h3>" + figure(inside, caption, points)


def section(a, rows):
    scenes = dict.fromkeys(r["labels"]["scene"] for r in rows.values() if r["labels"]["section"] == "curves" and "point" in r)
    return "\n".join(scene_section(a, rows, s) for s in scenes)
