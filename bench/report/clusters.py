# SPDX-License-Identifier: Apache-2.0
"""Which answers of the cache are wrong, and where: Sect. 5.1 and 3.4 of Popov et al. 2013, pair by pair."""
from report.axes import from_zero
from report.methods import derived
from report.page import FORMATS, attributes, figure, given, name, number, save_plot, setting, table
from report.svg import Plot, Series

TITLE = "Which answers are wrong, and where"
LOOKS = [("#0072b2", "square"), ("#d55e00", "circle"), ("#009e73", "diamond"), ("#b0508a", "up"), ("#a87000", "down"),
         ("#333333", "cross"), ("#777777", "up"), ("#0072b2", "down")]
NAMES = {"refined": "refined", "unrefined": "not refined", "shared": "lights of a light cell share"}


def percents(value):
    return f'{f"{100 * value:.6f}".rstrip("0").rstrip(".")} %'


def name_of(row):
    """"C_E = 8, 4 paths"."""
    labels = row["labels"]
    more = "" if labels["variant"] == "refined" else ", " + NAMES[labels["variant"]]
    return f'C_E = {labels["value"]:g}, {labels["spp"]} path{"" if labels["spp"] == 1 else "s"}{more}'


def of_list(row, list_name, x, y, form, words):
    """Points of a list within a row's figures."""
    points = []
    for i, entry in enumerate(row["figures"][list_name] if "." not in list_name else
                              row["figures"]["distance"]["bins"]):
        if entry[y] > 0:
            fields = {"x": f"figures.{list_name}.{i}.{x}", "y": f"figures.{list_name}.{i}.{y}"}
            points.append((entry[x], entry[y], attributes(row, **fields),
                           f"{name_of(row)}, {words} {entry[x]:.3g}: {FORMATS[form](entry[y])}"))
    return points


def visibility_plots(a, row):
    """Of one row: what speaks for a cluster, and how wrong it is."""
    scene = row["labels"]["scene"]
    speaks = Plot("average visibility V of a cluster", "share of clusters that answer: visible", 560, 400, 12,
                  x_axis=from_zero, y_axis=from_zero, y_label=percents)
    speaks.series = [Series("as the paper expects: V", of_list(row, "visibility", "v", "v", "percent", "V"), "#777777",
                            "down", True, True),
                     Series("measured", of_list(row, "visibility", "v", "visible", "percent", "V"), "#0072b2",
                            "square")]
    wrong = Plot("average visibility V of a cluster", "wrong answers", 560, 400, 12, x_axis=from_zero,
                 y_axis=from_zero, y_label=percents)
    wrong.series = [Series(words, of_list(row, "visibility", "v", field, "percent", "V"), colour, shape, dashed, dashed)
                    for field, words, colour, shape, dashed in (
                        ("expected", "expected: 2 V (1 - V)", "#777777", "down", True),
                        ("unrefined", "measured, not refined", "#0072b2", "square", False),
                        ("refined", "measured, refined", "#d55e00", "circle", False))]
    return [save_plot(a, f"clusters-{scene}-{what}.svg", p.svg()) for what, p in (("speaks", speaks), ("wrong", wrong))]


def distance_plot(a, own):
    p = Plot("distance from the shadow's edge, in cell sides (C_E / sqrt(paths) pixels); bins begin here, the " \
             "last is open",
             "share of the wrong answers", 860, 460, x_axis=from_zero, y_label=percents)
    for row, (colour, shape) in zip(own, LOOKS):
        other = row["labels"]["variant"] != "refined"
        p.series.append(Series(name_of(row), of_list(row, "distance.bins", "from", "share", "percent", "from"), colour,
                               shape, other, other))
    p.vertical = [(1.0, "one side")]
    return save_plot(a, f'clusters-{own[0]["labels"]["scene"]}-distance.svg', p.svg())


def of_paper(rows, scene, row):
    """A row of how far Eq. 12 and what follows from it are from what was measured; weighed by pairs."""
    bins, figures = row["figures"]["visibility"], {}
    mixed = [b for b in bins if b["expected"] > 0]
    pairs = sum(b["pairs"] for b in mixed)
    figures["off_visible"] = sum(abs(b["visible"] - b["v"]) * b["pairs"] for b in mixed) / max(1.0, pairs)
    wrong, expected, refined = (sum(b[k] * b["pairs"] for b in mixed) for k in ("unrefined", "expected", "refined"))
    figures["off_wrong"] = wrong / expected if expected else None
    figures["left_by_refining"] = refined / wrong if wrong else None
    return derived(rows, f"clusters/{scene}/of-paper", figures, [row["id"]])


def scene_section(a, rows, scene):
    own = [r for r in rows.values() if r["labels"]["section"] == "clusters" and r["labels"]["scene"] == scene]
    first = next((r for r in own if r["labels"]["variant"] == "refined" and r["labels"]["spp"] > 1), own[0])
    paper = of_paper(rows, scene, first)
    places = "" .join(visibility_plots(a, first))
    said = f"{name(scene)}, {name(name_of(first))}: {setting(first)}. In {number(first, 'figures.pure', 'share')} " \
           "of the pairs the whole cluster is of one mind and nothing can go wrong. Over the bins the share of " \
           f"clusters that answer visible is off V by {number(paper, 'figures.off_visible', 'percent')} (mean); " \
           f"without refinement {number(paper, 'figures.off_wrong', 'times')} as many pairs are wrong as expected, " \
           f"with it {number(paper, 'figures.left_by_refining', 'share')} of these remain."
    setting_of = ("setting", lambda r: name(name_of(r)))
    columns = [setting_of, ("a side, pixels", lambda r: number(r, "figures.distance.unit", "plain")),
               ("rays", lambda r: number(r, "figures.share", "share")),
               ("mispredicted", lambda r: number(r, "figures.mispredicted", "percent")),
               ("l_inf", lambda r: number(r, "figures.l_inf", "percent")),
               ("beyond a side", lambda r: number(r, "figures.distance.beyond", "percent")),
               ("beyond a diagonal", lambda r: number(r, "figures.distance.diagonal", "percent"))]
    sides = [setting_of, *((head, lambda r, field=field: number(r, f"figures.distance.{field}", "error"))
                           for head, field in (("mean distance, sides", "mean"), ("largest", "largest"),
                                               ("mean of what is near", "quarters.0.mean"),
                                               ("of what is far", "quarters.3.mean"),
                                               ("seen steeply", "slants.0.mean"), ("grazing", "slants.1.mean")))]
    where = f"{name(scene)}: distance of each wrong answer from the nearest place in the image that sees the light " \
            "as was answered, in sides of a cell. Near and far: the quarters of the eye samples that are nearest to " \
            "the eye and farthest from it."
    return f"<h3>{name(scene)}</h3>" + figure(f'<div class="row">{places}</div>', said, [first]) + \
        figure(distance_plot(a, own) + table(columns, own, f"clusters-{scene}") + table(sides, own), where, own)


def verdict(rows, own):
    """The claim of Sect. 3.4 against all rows in which lights do not share cells."""
    apart = [r for r in own if r["labels"]["variant"] != "shared"]
    figures = {"settings": len(apart),
               "held": sum(r["figures"]["distance"]["beyond"] < 0.01 for r in apart),
               "beyond": max(r["figures"]["distance"]["beyond"] for r in apart),
               "diagonal": max(r["figures"]["distance"]["diagonal"] for r in apart),
               "largest": max(r["figures"]["distance"]["largest"] for r in apart)}
    row = derived(rows, "clusters/verdict", figures, [r["id"] for r in apart])
    words = f"In {number(row, 'figures.held', 'count')} of {number(row, 'figures.settings', 'count')} settings less " \
            f"than {given('1 %')} of the wrong answers lie farther than one side from a true edge; at most " \
            f"{number(row, 'figures.beyond', 'percent')} do, {number(row, 'figures.diagonal', 'percent')} farther " \
            f"than a diagonal, none farther than {number(row, 'figures.largest', 'error')} sides. (A cell is a " \
            "square on its surface: seen at a grazing angle it is up to twice as long in the image as it should be.)"
    shared = [r for r in own if r["labels"]["variant"] == "shared"]
    if shared:
        worst = max(shared, key=lambda r: r["figures"]["distance"]["beyond"])
        words += f" Where lights of one light cell share answers, as in the paper, up to " \
                 f"{number(worst, 'figures.distance.beyond', 'percent')} are beyond, and the farthest is at " \
                 f"{number(worst, 'figures.distance.largest', 'error')} sides: another light's shadow is elsewhere."
    return f'<p class="lead">{words}</p>'


def section(a, rows):
    own = [r for r in rows.values() if r["labels"]["section"] == "clusters"]
    head = "<p>Each pair of an eye sample and a virtual point light, with no limit of memory, against exact " \
           f"visibility. Popov et al. {given('(2013)')} argue that the first pair speaks for a cluster (all pairs of " \
           "an eye cell and a light), which is therefore visible with a probability of V, its average visibility " \
           f"{given('(Eq. 12)')}, so that {given('2 V (1 - V)')} of the pairs of all such clusters are wrong; and " \
           f"that errors stay within C_E x C_E eye samples {given('(Sect. 3.4)')}, wherever in the image.</p>"
    scenes = list(dict.fromkeys(r["labels"]["scene"] for r in own))
    return head + verdict(rows, own) + "\n".join(scene_section(a, rows, s) for s in scenes)
