# SPDX-License-Identifier: Apache-2.0
"""How errors change from frame to frame while the camera or the lights move (Popov et al. 2013, Sect. 5.3)."""
import statistics

from report.curves import percents
from report.methods import METHODS, derived
from report.page import FORMATS, attributes, figure, given, name, number, save_plot, setting, table
from report.svg import Plot, Series

TITLE = "Flicker"
# how ways are drawn: words, knob, colour, shape, hollow
WAYS = {"cache": ("cache, emptied for each frame", "C_E = {}", "#d55e00", "circle", False),
        "kept": ("cache, kept", "C_E = {}", "#0072b2", "square", False),
        "unrefined": ("cache, not refined", "C_E = {}", "#d55e00", "circle", True),
        "estimate": ("estimate from the cache", "K = {}", METHODS["estimate"].colour, "square", True),
        "selection": (METHODS["selection"].name, "K = {}", METHODS["selection"].colour, "cross", True),
        "grid": ("grid coherence", "{}", METHODS["grid"].colour, "up", False)}


def ways_of(row, kind):
    """(index, way) of those that are drawn: what has an error."""
    return [(i, w) for i, w in enumerate(row["figures"]["ways"]) if w["name"] == kind and w["change"] > 0]


def series(row, kind, x, x_field):
    words, knob, colour, shape, hollow = WAYS[kind]
    points = [(x(w), w["change"], attributes(row, x=f"figures.ways.{i}.{x_field}", y=f"figures.ways.{i}.change"),
               f'{words}, {knob.format(w["value"])}: {FORMATS["percent"](w["change"])}') for i, w in ways_of(row, kind)]
    return Series(words, sorted(points, key=lambda p: p[0]), colour, shape, hollow, hollow)


def plots(a, row):
    sides = []
    for words, x_name, x, field, kinds, label in (
            ("ce", "C_E: eye samples a cell side", lambda w: float(w["value"]), "value", ("cache", "kept", "unrefined"),
             lambda v: f"{v:g}"),
            ("error", "error of a frame: l_inf", lambda w: w["error"], "error", tuple(WAYS), percents)):
        p = Plot(x_name, "change of the error from frame to frame", 560, 400, 12, x_label=label, y_label=percents)
        p.series = [s for s in (series(row, kind, x, field) for kind in kinds) if s.points]
        p.horizontal = [(row["figures"]["light"], "change of the light itself")]
        sides.append(save_plot(a, f'{row["id"].replace("/", "-")}-{words}.svg', p.svg()))
    return f'<div class="row">{"".join(sides)}</div>'


def means(rows, row):
    """Changes of the other ways over that of the emptied cache, at the same C_E."""
    base = {w["value"]: w["change"] for _, w in ways_of(row, "cache")}
    figures = {}
    for kind in ("kept", "unrefined"):
        shares = [w["change"] / base[w["value"]] for _, w in ways_of(row, kind) if w["value"] in base]
        if shares:
            figures[kind] = statistics.geometric_mean(shares)
    if base:
        figures["of_light"] = statistics.geometric_mean(base.values()) / row["figures"]["light"]
    return derived(rows, row["id"] + "/means", figures, [row["id"]])


def verdict(rows, row):
    m = means(rows, row)
    lines = []
    if "kept" in m["figures"]:
        lines.append(f'kept from frame to frame it changes {number(m, "figures.kept", "times")} as much as emptied')
    if "unrefined" in m["figures"]:
        lines.append(f'without refinement {number(m, "figures.unrefined", "times")} as much')
    lines.append(f'emptied, its error changes {number(m, "figures.of_light", "times")} as much as the light itself')
    noise = ""
    for kind, words in (("estimate", "The estimate\'s noise is new in each frame: it changes by"),
                        ("selection", "selection without a cache by")):
        noisy = [f'{number(row, f"figures.ways.{i}.change", "percent")} with '
                 f'{number(row, f"figures.ways.{i}.value", "plain")} lights a path' for i, _ in ways_of(row, kind)]
        noise += f'{"; " if noise else " "}{words} {", ".join(noisy)}' if noisy else ""
    noise += ". (With the same random numbers in each frame the latter would be a stain where the camera stands.)" \
        if "selection" in noise else "." if noise else ""
    return f'<p>The plain cache, means over C_E: {"; ".join(lines)}.{noise}</p>'


def one(a, rows, row):
    motion, scene, kind = row["labels"]["value"], row["labels"]["scene"], row["labels"]["kind"]
    columns = [("way", lambda i: name(f'{WAYS[way(i)["name"]][0]}, {WAYS[way(i)["name"]][1].format(way(i)["value"])}')),
               ("rays", lambda i: number(row, f"figures.ways.{i}.rays", "share")),
               ("l_inf", lambda i: number(row, f"figures.ways.{i}.error", "percent")),
               ("change", lambda i: number(row, f"figures.ways.{i}.change", "percent")),
               ("worst pixel in a thousand", lambda i: number(row, f"figures.ways.{i}.change_p999", "error")),
               ("worst pixel", lambda i: number(row, f"figures.ways.{i}.change_max", "error"))]

    def way(i):
        return row["figures"]["ways"][i]

    figures = table(columns, range(len(row["figures"]["ways"])))
    moves = {"camera": "the camera goes forward and turns", "light": "the sun or sky turns"}[motion]
    stand = " Virtual lights are those of the first frame." if kind == "virtual lights" else ""
    caption = f"{name(scene)}, {name(kind)}; {moves}: {number(row, 'figures.frames', 'plain')} frames, " \
              f"{setting(row)}.{stand} Changes of single pixels are in units of the mean pixel."
    inside = plots(a, row) + verdict(rows, row) + f"<details><summary>figures</summary>{figures}</details>"
    return f"<h3>{name(scene)}: the {name(motion)} moves</h3>" + figure(inside, caption, [row])


def section(a, rows):
    head = "<p>An error that stands still is a stain; one that comes and goes is seen at once. Of each frame the " \
           "signed difference to exact; its change to the next frame, summed over the pixels, over all light. Frames " \
           "are evenly spaced: a thousandth of the scene and a quarter of a degree a frame, or one degree of the " \
           "sky. A kept cache forgets what it knew of lights that moved: where all lights turn it is the emptied one " \
           f"{given('(Popov et al. 2013, Sect. 5.3)')}.</p>"
    return head + "\n".join(one(a, rows, r) for r in list(rows.values()) if r["labels"]["section"] == "flicker")
