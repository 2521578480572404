# SPDX-License-Identifier: Apache-2.0
"""The first plot: how fast a whole frame is in each scene within 1 and within 2 % of error."""
from report.axes import logarithmic
from report.methods import METHODS, derived, name_of
from report.page import FORMATS, attributes, given, lookup, number, save_plot
from report.svg import head, marker, text, told, width_of

# method: how the sentence calls it
SHOWN = {"estimate": "the estimate from the cache", "cache": "the plain cache, which answers every pair",
         "selection": "stochastic selection of lights without a cache"}
METHODS_SAID = [
    ("estimate", "K rays a path, drawn by what a light brings and how little the cache is sure of it; what the cache "
     "expects of all lights is added, and the rays correct it. Noise, no bias."),
    ("cached-selection", "K rays a path, drawn by what a light brings times what the cache expects of it; nothing is "
     "added. Noise, no bias."),
    ("cache", "each light at each path is answered by the cache, a ray is traced where it does not know. An error that "
     "stays, no noise. Not refined: one size of cells. Pair by pair: not by rows of lights."),
    ("selection", "K rays a path, drawn by what a light would bring if it were seen: without a cache. Noise, no bias."),
    ("fewer", "all rays, to fewer virtual lights."),
    ("adaptive", "rays to lights from the brightest on, until the next ones would bring less than T of what was seen; "
     "the rest is added by how often lights were seen so far. With the cache: it answers what is tested."),
    ("grid", "of lights that stand for a sky, those on which neighbours in the image disagree."),
    ("bdpt", "bidirectional path tracing whose connections the cache answers, beside the exact one.")]
LITTLE = 1.5  # times as fast as exact: kinds of light in which the cache never reaches it are shown
WIDTH, TOP, LANE, GAP, SIZE = 1130, 62, 12, 7, 13


def within(rows, target):
    """The fastest of what stays within the error; None where nothing does."""
    return max((r for r in rows if r["point"]["error"] <= target), key=lambda r: r["point"]["frame"], default=None)


def scenes(entries):
    """(words, [(method, fastest within each target)]) of each scene."""
    out = {e.scene: {m: [] for m in SHOWN} for e in entries}
    for e in entries:
        for m in SHOWN:
            out[e.scene][m].append(e.found.get(m))
    return [(scene, list(of.items())) for scene, of in out.items()]


def hard_lights(rows, targets):
    """The same of kinds of light alone in which the plain cache never makes much of a difference."""
    kinds = {}
    for r in rows.values():
        if r["labels"]["section"] == "lights" and "point" in r:
            kinds.setdefault((r["labels"]["kind"], r["labels"]["scene"]), []).append(r)
    return [(f"{kind} alone ({scene})", [("cache", [within(own, t) for t in targets])])
            for (kind, scene), own in kinds.items() if max(r["point"]["frame"] for r in own) < LITTLE]


def lane(x, y, method, found):
    """Marks of both targets, joined: filled within the lesser one."""
    m, parts = METHODS[method], []
    there = [r for r in found if r]
    if len(there) == 2:
        a, b = (x(r["point"]["frame"]) for r in there)
        parts.append(f'<path d="M{a:.1f} {y}H{b:.1f}" stroke="{m.colour}" stroke-width="2" stroke-opacity="0.5"/>')
    for row in {r["id"]: r for r in there[::-1]}.values():  # one that is both is filled
        said = f'{name_of(row)}: {FORMATS["times"](row["point"]["frame"])} at ' \
               f'{FORMATS["percent"](row["point"]["error"])}'
        drawn = marker(x(row["point"]["frame"]), y, m.shape, m.colour, False,
                       found[0] is None or row["id"] != found[0]["id"])
        parts.append(told(attributes(row, x="point.error", y="point.frame"), said, drawn))
    return parts


def plot(groups, targets):
    found = [r for _, lanes in groups for _, rows in lanes for r in rows if r]
    bottom = TOP + sum(LANE * len(lanes) + GAP for _, lanes in groups)
    left = max(width_of(words, SIZE) for words, _ in groups) + 10
    x = logarithmic([r["point"]["frame"] for r in found] + [1.0], left, WIDTH - 30)
    parts = [head(WIDTH, bottom + 46, SIZE), text(8, 20, "whole frame: times faster than exact, within "
             f"{targets[0]} of error (filled, thick) and within {targets[1]} (hollow, thin)", "start",
             ' class="axis" font-weight="bold"')]
    at = left
    for m in SHOWN:
        parts += [marker(at, 43, METHODS[m].shape, METHODS[m].colour, False),
                  text(at + 12, 47, METHODS[m].name, "start", f' fill="{METHODS[m].colour}" font-weight="bold"')]
        at += width_of(METHODS[m].name, SIZE) + 45
    for value, labelled in x.ticks(lambda v: width_of(f"{v:g}x", SIZE) + SIZE):
        parts.append(f'<path d="M{x(value):.1f} {TOP}V{bottom}" stroke="{"#ccc" if labelled else "#eee"}"/>')
        if labelled:
            parts.append(text(x(value), bottom + 18, f"{value:g}x", more=' class="axis"'))
    parts.append(f'<path d="M{x(1.0):.1f} {TOP}V{bottom}" stroke="#222" stroke-dasharray="7 4"/>')
    parts.append(text(x(1.0), bottom + 36, "as fast as exact"))
    y = TOP
    for i, (words, lanes) in enumerate(groups):
        tall = LANE * len(lanes) + GAP
        if i % 2 == 0:
            parts.append(f'<path d="M0 {y}H{WIDTH - 30}v{tall}H0Z" fill="#000" fill-opacity="0.04"/>')
        parts.append(text(left - 14, y + tall / 2 + 4, words, "end", ' class="name"'))
        for k, (method, rows) in enumerate(lanes):
            parts += lane(x, y + (GAP + LANE) / 2 + LANE * k, method, rows)
        y += tall
    return "\n".join(parts + ["</svg>", ""])


def span(least, most):
    """Of two (row, field) that are times something: "4.00x to 9.00x", one where they are the same."""
    words = {FORMATS["times"](lookup(*of)): number(*of, "times") for of in (least, most)}
    return " to ".join(words.values())


def over_selection(rows, entries):
    """How much faster the estimate is than stochastic selection where both stay within the error."""
    both = [(e.found["estimate"], e.found["selection"]) for e in entries
            if "estimate" in e.found and "selection" in e.found]
    ratios = [ours["point"]["frame"] / other["point"]["frame"] for ours, other in both]
    return derived(rows, f"headline/ratios/{entries[0].error:g}", {"least": min(ratios), "most": max(ratios)},
                   [r["id"] for pair in both for r in pair]) if both else None


def sentence(rows, entries, larger):
    """What each method reaches within the lesser target."""
    of = {m: [e.found[m] for e in entries if m in e.found] for m in SHOWN}
    row = derived(rows, "headline/reached", {"scenes": len(entries), **{m: len(found) for m, found in of.items()}},
                  [r["id"] for found in of.values() for r in found])
    said, lacking = [], [words for m, words in SHOWN.items() if not of[m]]
    for m, found in of.items():
        found.sort(key=lambda r: r["point"]["frame"])
        if found:
            said.append(f'<b>{span((found[0], "point.frame"), (found[-1], "point.frame"))}</b>'
                        f'{"" if said else " as fast as exact"} with {SHOWN[m]} (in '
                        f'{number(row, f"figures.{m}", "count")} of {number(row, "figures.scenes", "count")} scenes)')
    more = [f"a whole frame is {', '.join(said)}"] if said else []
    more += [f"no setting of {' or of '.join(lacking)} that was measured gets there"] if lacking else []
    more = [f"Within an error (l_inf) of {given(entries[0].target)} " + "; ".join(more) + "."]
    if any(0 < len(found) < len(entries) for found in of.values()):
        more.append("In the other scenes no setting that was measured gets there.")
    ratios = over_selection(rows, entries)
    if ratios:
        wider = over_selection(rows, larger)
        also = f' (within {given(larger[0].target)}: {span((wider, "figures.least"), (wider, "figures.most"))})' \
            if wider else ""
        more.append(f'Where both get there the estimate is {span((ratios, "figures.least"), (ratios, "figures.most"))} '
                    f"as fast as stochastic selection{also}.")
    return f'<p class="lead">{" ".join(more)}</p>'


def section(a, rows, entries):
    """`entries`: of headline.py, two targets a scene."""
    entries = [e for e in entries if any(r["labels"]["method"] in SHOWN for r in e.points)]
    if not entries:
        return ""
    targets = list(dict.fromkeys(e.error for e in entries))
    drawn = plot(scenes(entries) + hard_lights(rows, targets), [e.target for e in entries[:2]])
    knobs = "K: rays a path; C_E: eye samples a cell side, of cells refined down to one where nothing else is said; " \
            "T: tolerance. No mark, or a dash: no setting within the " \
            f"error. Last: kinds of light alone in which no C_E makes a frame {given(f'{LITTLE:g}')} times as fast."
    items = "".join(f"<li><b>{METHODS[m].name}</b>: {words}</li>" for m, words in METHODS_SAID)
    said = sentence(rows, *([e for e in entries if e.error == t] for t in (targets[0], targets[-1])))
    return said + save_plot(a, "glance.svg", drawn) + \
        f"<p>{knobs}</p><details><summary>what the methods do</summary><ul>{items}</ul></details>"
