# SPDX-License-Identifier: Apache-2.0
"""The table at the top: how fast at which error, and where the cache loses."""
from report.curves import of_scene
from report.methods import METHODS, setting_of, stepped_aside
from report.page import figure, given, name, number, table

TITLE = "In ten seconds"
TARGETS = [0.01, 0.02]
COLUMNS = ["estimate", "cached-selection", "cache", "selection", "fewer", "adaptive", "adaptive-cache", "grid"]
# variants that stand with the method that they belong to
ALSO = {"cache": ["cache", "cache-unrefined", "cache-words"]}


def fastest(points, method, target):
    """The fastest measured setting whose error is within the target; None where there is none."""
    good = [r for r in points if r["labels"]["method"] in ALSO.get(method, [method]) and r["point"]["error"] <= target and
            not stepped_aside(r)]
    return max(good, key=lambda r: r["point"]["frame"], default=None)


def cell(entry, method):
    row = entry["best"][method]
    if row is None:
        return "–"
    winner = max((r for r in entry["best"].values() if r), key=lambda r: r["point"]["frame"])
    wins = row is winner and row["point"]["frame"] > 1.0
    return f'{number(row, "point.frame", "times", bold=wins)} <small>{name(setting_of(row))}</small>'


def sentences(entries):
    out = []
    for e in entries:
        found = {m: r for m, r in e["best"].items() if r}
        if not found:
            out.append(f'In {name(e["scene"])} nothing that was tried stays within {given(e["said"])}.')
            continue
        winner = max(found, key=lambda m: found[m]["point"]["frame"])
        cache = found.get("cache")
        rival = max((m for m in found if not METHODS[m].ours), key=lambda m: found[m]["point"]["frame"], default=None)
        where = f'In {name(e["scene"])} at {given(e["said"])}'

        def said(m):
            return f'{METHODS[m].name} ({number(found[m], "point.frame", "times")} at {number(found[m], "point.error", "percent")})'
        if found[winner]["point"]["frame"] <= 1.0:
            out.append(f"{where} nothing is faster than exact: at best {said(winner)}.")
        elif not METHODS[winner].ours:
            ours = [m for m in found if METHODS[m].ours]
            behind = f', before {said(max(ours, key=lambda m: found[m]["point"]["frame"]))}' if ours else "; nothing that uses the cache gets there"
            out.append(f"{where} the cache loses: fastest is {said(winner)}{behind}.")
        elif cache is None:
            out.append(f"{where} the plain cache does not get there.")
        elif rival and cache["point"]["frame"] < found[rival]["point"]["frame"]:
            out.append(f"{where} the plain cache loses to {said(rival)}: {said('cache')}.")
        elif cache["point"]["frame"] < 1.0:
            out.append(f"{where} the plain cache is slower than exact: {said('cache')}.")
    return out


def section(a, rows):
    scenes = dict.fromkeys(r["labels"]["scene"] for r in rows.values() if r["labels"]["section"] == "curves" and "point" in r)
    entries = []
    for scene in scenes:
        points = of_scene(rows, scene)
        for target in TARGETS:
            entries.append({"scene": scene, "said": f"l_inf <= {100 * target:g} %",
                            "best": {m: fastest(points, m, target) for m in COLUMNS}})
    shown = [m for m in COLUMNS if any(e["best"][m] for e in entries)]
    columns = [("scene", lambda e: name(e["scene"])), ("error", lambda e: given(e["said"]))]
    columns += [(METHODS[m].name, lambda e, m=m: cell(e, m)) for m in shown]
    used = [r for e in entries for r in e["best"].values() if r]
    caption = "How many times faster a whole frame is than exact, by the fastest setting that was measured and stays within the error; " \
              "the winner is marked. A dash: no setting stays within it."
    lines = "".join(f"<li>{s}</li>" for s in sentences(entries))
    loses = f'<div class="loses"><b>Where the cache loses</b><ul>{lines}</ul></div>' if lines else ""
    return figure(table(columns, entries) + loses, caption, list({r["id"]: r for r in used}.values()))
