# SPDX-License-Identifier: Apache-2.0
"""The plain cache over C_E by kind of light, with anti-aliasing and without (Popov et al. 2013, Fig. 7)."""
from report.page import FORMATS, attributes, figure, given, name, number, save_plot, setting, table
from report.svg import Plot, Series

TITLE = "By kind of light, over C_E"
SPEED = [("ray_reduction", "rays", "#0072b2", "square"), ("shade", "shading", "#009e73", "diamond"),
         ("frame", "whole frame", "#d55e00", "circle")]
ERROR = [("error", "l_inf", "#d55e00", "circle"), ("mispredicted", "mispredicted", "#777777", "down"),
         ("flip", "FLIP", "#b0508a", "up")]


def plot(rows, what, title, form, y_label):
    p = Plot("C_E: eye samples a cell side", title, 560, 400, 12, y_label=y_label)
    for field, words, colour, shape in what:
        for smooth in (True, False):
            own = sorted((r for r in rows if r["labels"]["anti_aliased"] == smooth and r["point"].get(field)),
                         key=lambda r: r["labels"]["value"])
            points = [(r["labels"]["value"], r["point"][field], attributes(r, x="labels.value", y=f"point.{field}"),
                       f'{words}, C_E = {r["labels"]["value"]:g}: {FORMATS[form](r["point"][field])}') for r in own]
            if points:
                p.series.append(Series(words + ("" if smooth else ", one path"), points, colour, shape, not smooth, not smooth))
    if form == "times":
        p.horizontal.append((1.0, "exact"))
    return p.svg()


def kind_section(a, rows, kind, scene):
    own = [r for r in rows.values() if r["labels"]["section"] == "lights" and r["labels"]["kind"] == kind and
           r["labels"]["scene"] == scene]
    file_name = f"lights-{kind.replace(' ', '-')}-{scene}"
    plots = [save_plot(a, f"{file_name}-speed.svg", plot(own, SPEED, "times less, times faster than exact", "times", lambda v: f"{v:g}x")),
             save_plot(a, f"{file_name}-error.svg", plot(own, ERROR, "error", "percent", lambda v: f"{100 * v:g} %"))]
    figures = table([("paths a pixel", lambda r: number(r, "figures.spp", "plain")), ("C_E", lambda r: number(r, "labels.value", "plain")),
                     ("rays", lambda r: number(r, "point.ray_reduction", "times")), ("frame", lambda r: number(r, "point.frame", "times")),
                     ("shading", lambda r: number(r, "point.shade", "times")), ("l_inf", lambda r: number(r, "point.error", "percent")),
                     ("mispredicted", lambda r: number(r, "point.mispredicted", "percent")),
                     ("FLIP", lambda r: number(r, "point.flip", "flip"))], own)
    caption = f"{name(scene)}, {name(kind)}: {setting(own[0])}; filled: with anti-aliasing, hollow: one path a pixel."
    best = max(own, key=lambda r: r["point"]["frame"])
    if best["point"]["frame"] < 1.0:
        caption += f' <span class="loses">The cache never pays here: at best a frame is {number(best, "point.frame", "times")} as fast.</span>'
    else:
        caption += f' At best a frame is {number(best, "point.frame", "times")} as fast, with an l_inf of {number(best, "point.error", "percent")}.'
    inside = f'<div class="row">{plots[0]}{plots[1]}</div><details><summary>figures</summary>{figures}</details>'
    return f"<h3>{name(kind)}: {name(scene)}</h3>" + figure(inside, caption, own)


def section(a, rows):
    places = dict.fromkeys((r["labels"]["kind"], r["labels"]["scene"]) for r in rows.values() if r["labels"]["section"] == "lights")
    head = f"<p>The plain cache, which answers every pair. Ranges of C_E are those of Popov et al. {given('(2013)')}: hard shadows of points and suns " \
           "show cells first, soft ones later. Rays: those of exact over those that were traced.</p>"
    return head + "\n".join(kind_section(a, rows, *p) for p in places)
