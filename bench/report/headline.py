# SPDX-License-Identifier: Apache-2.0
"""The table at the top: how fast at which error, and where the cache loses."""
from report.curves import of_scene, scenes_of
from report.methods import METHODS, setting_of, stepped_aside
from report.page import figure, given, name, number, table

TITLE = "In ten seconds"
TARGETS = [0.01, 0.02]
COLUMNS = ["estimate", "cached-selection", "cache", "selection", "fewer", "adaptive", "adaptive-cache", "grid"]
# variants that stand with the method that they belong to
ALSO = {"cache": ["cache", "cache-unrefined", "cache-words"]}


def speed(row):
    return row["point"]["frame"]


def fastest(points, method, target):
    """The fastest measured setting whose error is within the target; None where there is none."""
    good = [r for r in points if r["labels"]["method"] in ALSO.get(method, [method]) and
            r["point"]["error"] <= target and not stepped_aside(r)]
    return max(good, key=speed, default=None)


class Entry:
    """A row of the table: a scene and a target, and by method the fastest setting within it."""

    def __init__(self, rows, scene, target):
        points = of_scene(rows, scene)
        found = {m: fastest(points, m, target) for m in COLUMNS}
        self.base = next((r for r in points if r["labels"]["method"] == "limit"), None)
        self.scene, self.target = scene, f"l_inf <= {100 * target:g} %"
        self.found = {m: r for m, r in found.items() if r}
        self.winner = max(self.found, key=lambda m: speed(self.found[m]), default=None)

    def cell(self, method):
        row = self.found.get(method)
        if row is None:
            return "–"
        wins = method == self.winner and speed(row) > 1.0
        return f'{number(row, "point.frame", "times", bold=wins)} <small>{name(setting_of(row))}</small>'

    def said(self, method):
        row = self.found[method]
        faster, error = number(row, "point.frame", "times"), number(row, "point.error", "percent")
        return f"{METHODS[method].name} ({faster} at {error})"

    def best_of(self, ours):
        return max((m for m in self.found if METHODS[m].ours == ours), key=lambda m: speed(self.found[m]), default=None)

    def sentence(self):
        """Where the cache loses, and to what; None where it does not."""
        where = f"In {name(self.scene)} at {given(self.target)}"
        ours, rival, cache = self.best_of(True), self.best_of(False), self.found.get("cache")
        if not self.winner:
            return f"{where} nothing that was tried gets there."
        if speed(self.found[self.winner]) <= 1.0:
            return f"{where} nothing is faster than exact: at best {self.said(self.winner)}."
        if self.winner == rival:
            behind = f"before {self.said(ours)}" if ours else "nothing that uses the cache gets there"
            return f"{where} <b>the cache loses</b>: fastest is {self.said(rival)}, {behind}."
        if cache is None:
            return f"{where} the plain cache does not get there."
        if rival and speed(cache) < speed(self.found[rival]):
            return f"{where} the plain cache loses to {self.said(rival)}: {self.said('cache')}."
        if speed(cache) < 1.0:
            return f"{where} the plain cache is slower than exact: {self.said('cache')}."
        return None


def section(a, rows):
    entries = [Entry(rows, scene, target) for scene in scenes_of(rows, "curves") for target in TARGETS]
    shown = [m for m in COLUMNS if any(m in e.found for e in entries)]
    columns = [("scene", lambda e: name(e.scene)), ("error", lambda e: given(e.target))]
    columns += [("exact", lambda e: number(e.base, "point.exact_s", "seconds") if e.base else "")]
    columns += [(METHODS[m].name, lambda e, m=m: e.cell(m)) for m in shown]
    lines = "".join(f"<li>{s}</li>" for s in (e.sentence() for e in entries) if s)
    loses = f'<div class="loses"><b>Where the cache loses</b><ul>{lines}</ul></div>' if lines else ""
    caption = "How many times faster a whole frame is than exact, by the fastest setting that was measured and stays " \
              "within the error; the winner is marked. A dash: no setting stays within it."
    used = {r["id"]: r for e in entries for r in e.found.values()}
    return figure(table(columns, entries) + loses, caption, list(used.values()))
