# SPDX-License-Identifier: Apache-2.0
"""Edges of hard shadows by order of eye samples, with refinement and without (Popov et al. 2013, Fig. 3, 4, 8)."""
from report.page import FORMATS, attributes, figure, given, name, number, picture, save_plot, setting, table
from report.svg import Plot, Series, head, marker, place_labels, text

TITLE = "Edges of shadows"
ORDERS = {"halton": ("Halton order", "#d55e00", "circle"), "scanline": ("scanlines", "#0072b2", "square"),
          "random": ("random", "#333333", "diamond")}
COLUMNS = [("right", "error"), ("down", "error"), ("off", "error"), ("ragged", "error"), ("rays", "share"),
           ("mispredicted", "percent"), ("l_inf", "percent")]
STYLE = """<style>
.crops figure, .whole figure { margin: 0; }
.crops figcaption, .whole figcaption { font-size: 0.82em; line-height: 1.35; }
.crops img { image-rendering: pixelated; vertical-align: bottom; margin-right: 4px; } .crops img.large { width: 160px; }
.whole img { width: 320px; }
</style>"""


def words(way):
    order, _, plain = way.partition("-")
    return ORDERS[order][0] + (", not refined" if plain else "")


def looks(way):
    order, _, plain = way.partition("-")
    return ORDERS[order][1], ORDERS[order][2], bool(plain)


def where_edges_go(row):
    """Mean shift of all edges as a point, right and down as in the image, exact's in the middle; in pixels."""
    ways = row["figures"]["ways"]
    size, middle, room = 420, 210, 160
    far = max(abs(w[k]) for w in ways for k in ("right", "down"))
    step = next(s for s in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20) if s * 4 >= far)
    scale = room / max(far, step)
    parts = [head(size, size, 12), text(10, 20, "mean shift of edges, pixels, as on the screen", "start",
                                        ' class="axis" font-weight="bold"')]
    for i in range(-int(room / scale / step), int(room / scale / step) + 1):
        at = middle + i * step * scale
        colour = "#444" if i == 0 else "#ddd"
        parts.append(f'<path d="M{at:.1f} {middle - room}V{middle + room}M{middle - room} {at:.1f}H{middle + room}" '
                     f'stroke="{colour}"/>')
        parts.append(text(at, middle + room + 16, f"{i * step:g}", more=' class="axis"'))
        if i != 0:
            parts.append(text(middle - room - 6, at + 4, f"{i * step:g}", "end", ' class="axis"'))
    parts.append(text(middle, size - 14, "to the right; downwards is down", more=' class="axis"'))
    drawn = []
    for i, w in enumerate(ways):
        colour, shape, hollow = looks(w["name"])
        x, y = middle + w["right"] * scale, middle + w["down"] * scale
        said = "".join(f" {k}={v!r}" if "'" not in v else f' {k}="{v}"' for k, v in attributes(
            row, x=f"figures.ways.{i}.right", y=f"figures.ways.{i}.down").items())
        tip = f'{words(w["name"])}: {FORMATS["error"](w["right"])} right, {FORMATS["error"](w["down"])} down'
        parts.append(f"<g{said}><title>{tip}</title>{marker(x, y, shape, colour, False, hollow)}</g>")
        drawn.append(Series(words(w["name"]), [(x, y)], colour, shape))
    for said, x, y, colour in place_labels(drawn, (8, size - 8, 30, size - 40), 12, []):
        parts.append(text(x, y, said, "start", f' fill="{colour}" class="name" font-weight="bold" stroke="#fff" '
                                               'stroke-width="3" paint-order="stroke"'))
    return "\n".join(parts + ["</svg>", ""])


def over_ce(own, field, title):
    p = Plot("C_E: pixels a cell side", title, 480, 400, 12)
    for i, way in enumerate(w["name"] for w in own[0]["figures"]["ways"]):
        colour, shape, hollow = looks(way)
        points = [(r["figures"]["ce"], r["figures"]["ways"][i][field],
                   attributes(r, x="figures.ce", y=f"figures.ways.{i}.{field}"),
                   f'{words(way)}: {FORMATS["error"](r["figures"]["ways"][i][field])}')
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
    place = '<p class="plot">Where they differ most, pixel by pixel and enlarged: ' \
            f'{number(row, "figures.side", "plain")} pixels a side at ({number(row, "figures.x", "plain")}, ' \
            f'{number(row, "figures.y", "plain")}), C_E = ' \
            f'{number(row, "figures.ce", "plain")}.</p>'
    return f'<div class="row whole">{whole}</div>{place}{parts}'


def scene_section(a, scene, own):
    shown = next((r for r in own if "side" in r["figures"]), own[-1])
    drawn = []
    if shown["figures"]["ways"][0]["edges"]:
        drawn.append(save_plot(a, f"edges-{scene}-shift.svg", where_edges_go(shown)))
    drawn += [save_plot(a, f"edges-{scene}-{field}.svg", over_ce(own, field, title))
              for field, title in (("off", "mean distance of an edge from exact's, pixels"),
                                   ("ragged", "raggedness: jump from a row to the next, pixels"))]
    figures = ""
    for r in own:
        ways = r["figures"]["ways"]
        columns = [("C_E", lambda i, r=r: number(r, "figures.ce", "plain")),
                   ("order", lambda i, w=ways: name(words(w[i]["name"])))]
        columns += [(f, lambda i, f=f, form=form, r=r: number(r, f"figures.ways.{i}.{f}", form)) for f, form in COLUMNS]
        figures += table(columns, range(len(ways)))
    caption = f"{name(scene)}: {setting(own[0])}; {number(shown, 'figures.ways.0.edges', 'count')} places on edges " \
              f"at C_E = {number(shown, 'figures.ce', 'plain')}" \
              '<span class="plot">, which are those of the first plot</span>. Shifts to the right and down are ' \
              'positive<span class="plot">; hollow: not refined</span>.'
    inside = f'<div class="row">{"".join(drawn)}</div>{crops(a, shown)}'
    inside += f"<details><summary>figures</summary>{figures}</details>"
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
