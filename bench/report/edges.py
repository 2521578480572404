# SPDX-License-Identifier: Apache-2.0
"""Edges of hard shadows by order of eye samples, with refinement and without (Popov et al. 2013, Fig. 3, 4, 8)."""
import math

from report.axes import label
from report.page import FORMATS, attributes, figure, given, name, number, picture, save_plot, setting, table
from report.svg import Plot, Series, head, marker, place_labels, text, told

TITLE = "Edges of shadows"
ORDERS = {"halton": ("Halton order", "#d55e00", "circle"), "scanline": ("scanlines", "#0072b2", "square"),
          "random": ("random", "#333333", "diamond")}
LEAST = 500  # edges (or pairs of rows) for a mean: of fewer it says more about these places than about the order
# mean: the count that it was taken over
COUNTED = {"right": "rows", "down": "columns", "off": "edges", "ragged": "pairs"}
STYLE = """<style>
.crops figure, .whole figure { margin: 0; }
.crops figcaption, .whole figcaption { font-size: 0.82em; line-height: 1.35; }
.crops img { image-rendering: pixelated; vertical-align: bottom; margin-right: 4px; } .crops img.large { width: 192px; }
.whole img { width: 320px; }
</style>"""


def words(way):
    order, _, plain = way.partition("-")
    return ORDERS[order][0] + (", not refined" if plain else "")


def looks(way):
    order, _, plain = way.partition("-")
    return ORDERS[order][1], ORDERS[order][2], bool(plain)


def enough(a, row, field):
    """Whether a mean was taken over enough."""
    return (row["figures"]["ways"][0].get(COUNTED[field]) or 0) >= a.level.edges.get("least", LEAST)


def where_edges_go(row):
    """Mean shift of all edges as a point, right and down as in the image, from exact's; in pixels."""
    ways = row["figures"]["ways"]
    ends = [f(0.0, *(w[k] for w in ways)) for k in ("right", "down") for f in (min, max)]
    room = 0.12 * max(ends[1] - ends[0], ends[3] - ends[2])
    x0, x1, y0, y1 = (e + room * sign for e, sign in zip(ends, (-1, 1, -1, 1)))
    left, top, side = 60, 40, 340
    scale = side / max(x1 - x0, y1 - y0)
    right, bottom, width = left + (x1 - x0) * scale, top + (y1 - y0) * scale, 560
    step = next(s for s in (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50) if s * scale >= 40)

    def at(u, v):
        return left + (u - x0) * scale, top + (v - y0) * scale

    parts = [head(width, int(bottom) + 50, 12), text(10, 20, "mean shift of edges, pixels, as on the screen", "start",
                                                     ' class="axis" font-weight="bold"')]
    for low, high, down in ((x0, x1, False), (y0, y1, True)):
        for i in range(math.ceil(low / step), math.floor(high / step) + 1):
            across, along = at(i * step, i * step)
            line = f"M{left} {along:.1f}H{right:.1f}" if down else f"M{across:.1f} {top}V{bottom:.1f}"
            parts.append(f'<path d="{line}" stroke="{"#ddd" if i else "#444"}"/>')
            place = (left - 6, along + 4) if down else (across, bottom + 16)
            parts.append(text(*place, label(float(f"{i * step:.9g}")), "end" if down else "middle", ' class="axis"'))
    parts.append(text((left + right) / 2, bottom + 36, "to the right; downwards is down", more=' class="axis"'))
    drawn = []
    for i, w in enumerate(ways):
        colour, shape, hollow = looks(w["name"])
        x, y = at(w["right"], w["down"])
        tip = f'{words(w["name"])}: {FORMATS["pixels"](w["right"])} right, {FORMATS["pixels"](w["down"])} down'
        of = attributes(row, x=f"figures.ways.{i}.right", y=f"figures.ways.{i}.down")
        parts.append(told(of, tip, marker(x, y, shape, colour, False, hollow)))
        drawn.append(Series(words(w["name"]), [(x, y)], colour, shape))
    for said, x, y, colour in place_labels(drawn, (left, width - 8, 30, bottom), 12, []):
        parts.append(text(x, y, said, "start", f' fill="{colour}" class="name" font-weight="bold" stroke="#fff" '
                                               'stroke-width="3" paint-order="stroke"'))
    return "\n".join(parts + ["</svg>", ""])


def over_ce(own, field, title):
    p = Plot("C_E: pixels a cell side", title, 560, 380, 12)
    for i, way in enumerate(w["name"] for w in own[0]["figures"]["ways"]):
        colour, shape, hollow = looks(way)
        points = [(r["figures"]["ce"], r["figures"]["ways"][i][field],
                   attributes(r, x="figures.ce", y=f"figures.ways.{i}.{field}"),
                   f'{words(way)}: {FORMATS["pixels"](r["figures"]["ways"][i][field])}')
                  for r in own if r["figures"]["ways"][i][field] > 0]
        p.series.append(Series(words(way), points, colour, shape, hollow, hollow))
    return p.svg()


def crops(a, row):
    prefix = f'pictures/edges-{row["labels"]["scene"]}'
    ways = ["exact"] + [w["name"] for w in row["figures"]["ways"]]

    def said(way):
        return "exact" if way == "exact" else words(way)

    def titled(images, way):
        return f"<figure>{images}<figcaption>{name(said(way))}</figcaption></figure>"

    whole = "".join(titled(picture(a, f"{prefix}-{way}.png", way), way)
                    for way in ("exact", "halton", "scanline-plain"))

    def enlarged(way):
        one = picture(a, f"{prefix}-zoom-{way}.png", said(way))
        large = one.replace("<img ", '<img class="large" ', 1)
        return titled(one + large, way)

    refined = [way for way in ways if "-" not in way]
    parts = "".join(f'<div class="row crops">{"".join(map(enlarged, some))}</div>'
                    for some in (refined, [way for way in ways if way not in refined]))
    place = '<p class="plot">Where the shifts of the unrefined edges show most, pixel by pixel and enlarged: ' \
            f'{number(row, "figures.side", "plain")} pixels a side at ({number(row, "figures.x", "plain")}, ' \
            f'{number(row, "figures.y", "plain")}), C_E = ' \
            f'{number(row, "figures.ce", "plain")}.</p>'
    return f'<div class="row whole">{whole}</div>{place}{parts}'


def figures_of(a, own):
    """All orders at all C_E; means over too few are left out."""
    columns = [("C_E", lambda r, i: number(r, "figures.ce", "plain")),
               ("order", lambda r, i: name(words(r["figures"]["ways"][i]["name"])))]
    for field, head_of, counted in (("right", "right", "rows"), ("down", "down", "columns"), ("off", "off", None),
                                    ("ragged", "ragged", "pairs of rows")):
        columns.append((head_of, lambda r, i, f=field: number(r if enough(a, r, f) else None, f"figures.ways.{i}.{f}",
                                                              "pixels")))
        if counted:
            columns.append((f"of {counted}", lambda r, i, f=COUNTED[field]: number(r, f"figures.ways.{i}.{f}",
                                                                                   "count")))
    columns += [(f, lambda r, i, f=f, form=form: number(r, f"figures.ways.{i}.{f}", form))
                for f, form in (("rays", "share"), ("mispredicted", "percent"), ("l_inf", "percent"))]
    rows = [(r, i) for r in own for i in range(len(r["figures"]["ways"]))]
    return table([(head_of, lambda of, cell=cell: cell(*of)) for head_of, cell in columns], rows,
                 f'edges-{own[0]["labels"]["scene"]}')


def scene_section(a, scene, own):
    shown = next((r for r in own if "side" in r["figures"]), own[-1])
    drawn = []
    for field, title in (("off", "mean distance of an edge from exact's, pixels"),
                         ("ragged", "raggedness: jump from a row to the next, pixels")):
        rows = [r for r in own if enough(a, r, field)]
        drawn += [save_plot(a, f"edges-{scene}-{field}.svg", over_ce(rows, field, title))] if rows else []
    if enough(a, shown, "right") and enough(a, shown, "down"):
        drawn.append(save_plot(a, f"edges-{scene}-shift.svg", where_edges_go(shown)))
    caption = f"{name(scene)}: {setting(own[0])}. Shifts to the right are means over rows of pixels with an edge, " \
              "those down over columns, in pixels; off: their mean without sign; ragged: over pairs of neighbouring " \
              f"rows or columns. A dash: fewer than {given(str(a.level.edges.get('least', LEAST)))} to take the mean " \
              'of<span class="plot">, which are not drawn either; hollow: not refined; the plot of shifts is of ' \
              f"C_E = {number(shown, 'figures.ce', 'plain')}</span>."
    inside = f'<div class="row">{"".join(drawn)}</div>{crops(a, shown)}'
    inside += f"<details><summary>figures</summary>{figures_of(a, own)}</details>"
    return f"<h3>{name(scene)}</h3>" + figure(inside, caption, own)


def section(a, rows):
    places = {}
    for r in rows.values():
        if r["labels"]["section"] == "edges":
            places.setdefault(r["labels"]["scene"], []).append(r)
    top = "<p>Whoever asks first speaks for a cell. In scanline order that is its upper left corner, so shadows move " \
          f"right and down {given('(Popov et al. 2013, Fig. 4)')}, and refinement finds the neighbours on two sides " \
          "alone. The renderers light the pixels of a tile in Halton order. An edge is a row or column of pixels on " \
          "one plane of which exact sees one half lit and the other not; its shift is by how many pixels the cache " \
          f"moves it, its raggedness {given('(Fig. 3, 8)')} the root mean square of how much that changes from one " \
          "row to the next. One path a pixel, one cache for the image.</p>"
    return STYLE + top + "\n".join(scene_section(a, scene, own) for scene, own in places.items())
