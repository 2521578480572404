# SPDX-License-Identifier: Apache-2.0
"""Plain shadow maps against the cache, where lights are points and suns (Popov et al. 2013, Sect. 5.4)."""
from report.curves import percents
from report.methods import clock
from report.page import FORMATS, attributes, figure, given, name, number, save_plot, setting, table
from report.svg import Plot, Series

TITLE = "Shadow maps"
# what is drawn of maps: words, field, colour, shape, hollow
MAPS = [("shadow maps", "faster", "#0072b2", "square", False),
        ("shadow maps that are there already", "without_building", "#0072b2", "square", True)]


def said(words, error, faster):
    return f'{words}: {FORMATS["times"](faster)} at {FORMATS["percent"](error)}'


def plot(maps, cached):
    p = Plot("error: l_inf", "whole frame: times faster than exact", 860, 480, 13, x_label=percents,
             y_label=lambda v: f"{v:g}x")
    for words, field, colour, shape, hollow in MAPS:
        points = [(r["figures"]["l_inf"], r["figures"][field],
                   attributes(r, x="figures.l_inf", y=f"figures.{field}"),
                   said(f'{r["labels"]["value"]} texels a side', r["figures"]["l_inf"], r["figures"][field]))
                  for r in maps]
        p.series.append(Series(words, points, colour, shape, hollow, hollow))
    points = [(r["point"]["error"], r["point"]["frame"], attributes(r, x="point.error", y="point.frame"),
               said(f'C_E = {r["labels"]["value"]:g}', r["point"]["error"], r["point"]["frame"])) for r in cached]
    if points:
        p.series.append(Series("cache", sorted(points, key=lambda q: q[0]), "#d55e00", "circle"))
    p.horizontal = [(1.0, "as fast as exact")]
    p.horizontal += [(maps[0]["figures"]["limit"], "limit: no visibility at all")]
    return p.svg()


def side(row):
    return f'{number(row, "labels.value", "plain")} texels a side'


def is_map(row):
    return row["labels"]["section"] == "maps"


def of(row, of_map, of_cache, form):
    """A figure of either kind of row."""
    return number(row, f"figures.{of_map}" if is_map(row) else f"point.{of_cache}", form)


def verdict(maps, cached):
    """Who is faster at the error of each map."""
    lines = []
    for m in maps:
        within = [r for r in cached if r["point"]["error"] <= m["figures"]["l_inf"]]
        best = max(within, key=lambda r: r["point"]["frame"], default=None)
        here = f'{side(m)} ({number(m, "figures.l_inf", "percent")}): maps {number(m, "figures.faster", "times")}, ' \
               f'{number(m, "figures.without_building", "times")} without making them; '
        if m["figures"]["without_building"] <= 1.0:
            lines.append(f"<li>{here}<b>exact wins</b>: as fast as maps that are there, and without error</li>")
            continue
        if not cached:  # `lights` was not measured
            lines.append(f'<li>{here.rstrip("; ")}</li>')
            continue
        if best is None:
            lines.append(f'<li class="loses">{here}<b>the cache loses</b>, no C_E that was tried gets there</li>')
            continue
        speed = best["point"]["frame"]
        wins = "wins" if speed > m["figures"]["without_building"] else "loses"
        lines.append(f'<li class="{wins}">{here}<b>the cache {wins}</b> beside maps that are there: '
                     f'{number(best, "point.frame", "times")} (C_E = {number(best, "labels.value", "plain")}, '
                     f'{number(best, "point.error", "percent")})</li>')
    return f'<ul class="plain">{"".join(lines)}</ul>'


def how_sure(rows, scene, maps):
    row = clock(rows, f"maps/{scene}/clock", [("", m["figures"]["exact_s"], m["id"]) for m in maps])
    return f" These exact frames differ by up to {number(row, 'figures.most', 'times')}, and so may times." \
        if row else ""


def scene_section(a, rows, scene, maps):
    kind = maps[0]["labels"]["kind"]
    cached = [r for r in rows.values() if r["labels"]["section"] == "lights" and r["labels"]["kind"] == kind and
              r["labels"]["scene"] == scene and r["labels"]["anti_aliased"] and "point" in r]
    both = [("visibility by", lambda r: f"maps, {side(r)}" if is_map(r) else
             f'cache, C_E = {number(r, "labels.value", "plain")}'),
            ("as fast as exact", lambda r: of(r, "faster", "frame", "times")),
            ("where maps are there", lambda r: number(r, "figures.without_building", "times") if is_map(r) else ""),
            ("l_inf", lambda r: of(r, "l_inf", "error", "percent")),
            ("mispredicted", lambda r: of(r, "mispredicted", "mispredicted", "percent")),
            ("FLIP", lambda r: of(r, "flip", "flip", "flip"))]
    figures = table(both, cached + maps, f"maps-{scene}")
    figures += table([("maps: texels a side", lambda r: number(r, "labels.value", "plain")),
                      ("how many", lambda r: number(r, "figures.maps", "count")),
                      ("bias, texels", lambda r: number(r, "figures.bias", "plain")),
                      ("made in", lambda r: number(r, "figures.build_s", "seconds")),
                      ("looked up in", lambda r: number(r, "figures.lookup_s", "seconds")),
                      ("exact: rays in", lambda r: number(r, "figures.visibility_s", "seconds"))], maps)
    caption = f"{name(scene)}, {name(kind)}: {setting(maps[0])}. Frames of maps are exact's with another visibility, " \
              "each over the exact frame of the same run; the bias is the one with the fewest mispredicted pairs." + \
              how_sure(rows, scene, maps)
    drawn = save_plot(a, f"maps-{scene}.svg", plot(maps, cached))
    return f"<h3>{name(kind)}: {name(scene)}</h3>" + figure(drawn + verdict(maps, cached) + figures, caption,
                                                             maps + cached)


def section(a, rows):
    places = {}
    for r in rows.values():
        if r["labels"]["section"] == "maps":
            places.setdefault(r["labels"]["scene"], []).append(r)
    head = "<p>What a renderer with few hard lights would do instead (Popov et al. " \
           f"{given('(2013), Sect. 5.4')}): a depth cube around each point or spot light, of which the faces that " \
           "are looked into are made, and one map over the scene for a sun; the nearest texel, a bias in proportion " \
           "to its width and the slope. Texels are found by packets of rays, which a rasteriser would do faster: " \
           "without making them, as for lights and scenes that stand still, is the fairer figure" \
           '<span class="plot"> (hollow marks)</span>.</p>'
    return head + "\n".join(scene_section(a, rows, scene, own) for scene, own in places.items())
