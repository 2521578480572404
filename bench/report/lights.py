# SPDX-License-Identifier: Apache-2.0
"""The plain cache over C_E by kind of light, with anti-aliasing and without (Popov et al. 2013, Fig. 7)."""
from report.methods import clock, derived
from report.page import FORMATS, attributes, counted, figure, given, name, number, save_plot, setting, table
from report.svg import Plot, Series

TITLE = "By kind of light, over C_E"
SPEED = [("ray_reduction", "rays: times fewer", "#0072b2", "square"), ("shade", "shading", "#009e73", "diamond"),
         ("frame", "whole frame", "#d55e00", "circle")]
ERROR = [("error", "l_inf", "#d55e00", "circle"), ("mispredicted", "mispredicted", "#777777", "down"),
         ("flip", "FLIP (of 1)", "#b0508a", "up")]
COLUMNS = [("paths a pixel", "figures.spp", "plain"), ("C_E", "labels.value", "plain"),
           ("times fewer rays", "point.ray_reduction", "times"), ("frame", "point.frame", "times"),
           ("shading", "point.shade", "times"), ("l_inf", "point.error", "percent"),
           ("mispredicted", "point.mispredicted", "percent"), ("FLIP", "point.flip", "flip")]


def plot(rows, what, title, form, y_label):
    p = Plot("C_E: eye samples a cell side", title, 560, 400, 12, y_label=y_label)
    for field, words, colour, shape in what:
        for smooth in (True, False):
            own = sorted((r for r in rows if r["labels"]["anti_aliased"] == smooth and r["point"].get(field)),
                         key=lambda r: r["labels"]["value"])
            points = [(r["labels"]["value"], r["point"][field],
                       attributes(r, x="labels.value", y=f"point.{field}"),
                       f'{words}, C_E = {r["labels"]["value"]:g}: '
                       f'{FORMATS["flip" if field == "flip" else form](r["point"][field])}') for r in own]
            if points:
                words_of = words if smooth else f"{words}, one path"
                p.series.append(Series(words_of, points, colour, shape, not smooth, not smooth))
    if form == "times":
        p.horizontal.append((1.0, "exact"))
    return p.svg()


def within(own, error):
    best = max((r for r in own if r["point"]["error"] <= error), key=lambda r: r["point"]["frame"], default=None)
    found = f'{number(best, "point.frame", "times")} (C_E = {number(best, "labels.value", "plain")}, ' \
            f'{counted(best, "figures.spp", "path")})' if best else "none"
    return f"within {given(f'{100 * error:g} %')}: {found}"


def part_of_picture(rows, own):
    """What errors are relative to, where that is not all that is seen."""
    error = own[0]["figures"]["error"]
    if not error["l_inf"] or not error["l_inf_whole"] < 0.99 * error["l_inf"]:
        return ""
    row = derived(rows, own[0]["id"] + "/part", {"share": error["l_inf_whole"] / error["l_inf"]}, [own[0]["id"]])
    return f" These lights bring {number(row, 'figures.share', 'share')} of the picture's light, and l_inf is over " \
           "that alone; over the whole picture it is this share of it."


def how_sure(rows, file_name, own):
    """What to think of steps in the times."""
    row = clock(rows, f"lights/{file_name}/clock", [(r["figures"]["spp"], r["figures"]["exact"]["frame_s"], r["id"])
                                                    for r in own])
    return f" Exact frames of one setting differ by up to {number(row, 'figures.most', 'times')}, and so may times; " \
           "rays and errors are counted." if row else ""


def kind_section(a, rows, kind, scene, own):
    file_name = f"lights-{kind.replace(' ', '-')}-{scene}"
    plots = [save_plot(a, f"{file_name}-speed.svg",
                       plot(own, SPEED, "times fewer or faster than exact", "times", lambda v: f"{v:g}x")),
             save_plot(a, f"{file_name}-error.svg",
                       plot(own, ERROR, "error", "percent", lambda v: f"{100 * v:g} %"))]
    figures = table([(head, lambda r, f=f, form=form: number(r, f, form)) for head, f, form in COLUMNS], own)
    best = max(own, key=lambda r: r["point"]["frame"])
    if best["point"]["frame"] < 1.0:
        speed = number(best, "point.frame", "times")
        verdict = f"<b>The cache never pays here</b>: at best a frame is {speed} as fast."
    else:
        verdict = "Fastest with an l_inf " + "; ".join(within(own, e) for e in (0.01, 0.02, 0.05)) + "."
    marks = '<span class="plot">; filled: with anti-aliasing, hollow: one path a pixel</span>'
    caption = f"{name(scene)}, {name(kind)}: {setting(own[0])}{marks}. "
    inside = f'<div class="row">{plots[0]}{plots[1]}</div><details><summary>figures</summary>{figures}</details>'
    return f"<h3>{name(kind)}: {name(scene)}</h3>" + figure(inside, caption + verdict + part_of_picture(rows, own) +
                                                    how_sure(rows, file_name, own), own)


def section(a, rows):
    places = {}
    for r in rows.values():
        if r["labels"]["section"] == "lights":
            places.setdefault((r["labels"]["kind"], r["labels"]["scene"]), []).append(r)
    head = "<p>The plain cache, which answers every pair. Ranges of C_E are those of Popov et al. " \
           f"{given('(2013)')}: hard shadows of points and suns show cells first, soft ones later. Rays: those of " \
           "exact over those that were traced.</p>"
    return head + "\n".join(kind_section(a, rows, *place, own) for place, own in places.items())
