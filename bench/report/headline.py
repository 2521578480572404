# SPDX-License-Identifier: Apache-2.0
"""The table at the top: how fast at which error, and where the cache loses."""
from report import converged, glance
from report.curves import of_scene, scenes_of
from report.methods import METHODS, setting_of, stepped_aside
from report.page import figure, given, name, number, table

TITLE = "In ten seconds"
TARGETS = [0.01, 0.02]
LOOSE = 0.05  # where few rays are enough, what a cache costs is most of the frame
COLUMNS = ["estimate", "cached-selection", "cache", "selection", "fewer", "adaptive", "adaptive-cache", "grid"]
# variants that stand with the method that they belong to
ALSO = {"cache": ["cache", "cache-once", "cache-unrefined", "cache-words"]}


def speed(row):
    return row["point"]["frame"]


def fastest(points, method, target):
    """The fastest measured setting whose error is within the target; None where there is none."""
    good = [r for r in points if r["labels"]["method"] in ALSO.get(method, [method]) and
            r["point"]["error"] <= target and not stepped_aside(r)]
    return max(good, key=speed, default=None)


def said(row):
    faster, error = number(row, "point.frame", "times"), number(row, "point.error", "percent")
    return f"{METHODS[row['labels']['method']].name} ({name(setting_of(row))}: {faster} at {error})"


class Entry:
    """A row of the table: a scene and a target, and by method the fastest setting within it."""

    def __init__(self, rows, scene, target):
        self.points = of_scene(rows, scene)
        found = {m: fastest(self.points, m, target) for m in COLUMNS}
        self.base, self.others = (next((r for r in self.points if r["labels"]["method"] == m), None)
                                  for m in ("limit", "others"))
        self.scene, self.target, self.error = scene, f"{100 * target:g} %", target
        self.found = {m: r for m, r in found.items() if r}
        self.winner = max(self.found, key=lambda m: speed(self.found[m]), default=None)
        if self.winner and speed(self.found[self.winner]) <= self.clock():
            self.winner = None  # than exact's own frames differ

    def clock(self):
        return self.base["point"]["noise"] if self.base else 1.0

    def wins(self, method):
        """The fastest, and what is slower by no more than exact's own frames differ: the clock does not tell."""
        return bool(self.winner) and speed(self.found[method]) * self.clock() >= speed(self.found[self.winner])

    def cell(self, method):
        row = self.found.get(method)
        if row is None:
            return "–"
        bold = self.wins(method)
        variant = METHODS[row["labels"]["method"]].name.partition(", ")[2] if row["labels"]["method"] != method else ""
        setting = ", ".join(t for t in (setting_of(row), variant) if t)
        return f'{number(row, "point.frame", "times", bold=bold)} <small>{name(setting)}</small>'

    def best_of(self, ours):
        return max((r for m, r in self.found.items() if METHODS[m].ours == ours), key=speed, default=None)

    def nearest(self):
        """Of what uses the cache, that with the least error among what is worth its time; None where nothing is."""
        good = [r for r in self.points if r["labels"]["method"] in COLUMNS and not stepped_aside(r) and
                METHODS[r["labels"]["method"]].ours and speed(r) > self.clock()]
        return min(good, key=lambda r: r["point"]["error"], default=None)

    def sentence(self):
        """Where the cache loses, and to what; None where it does not."""
        ours, rival, near = self.best_of(True), self.best_of(False), self.nearest()
        where = f"In {name(self.scene)} at {given(self.target)}"
        if self.winner and METHODS[self.winner].ours or not any(r["labels"]["method"] in COLUMNS for r in self.points):
            return None
        if self.winner:
            if ours and speed(ours) * self.clock() >= speed(rival):
                return f"{where} the cache does not win: {said(rival)} and {said(ours)} differ by less than exact's " \
                       "own frames."
            behind = f"before {said(ours)}" if ours else "no setting of the cache that was tried gets there"
            return f"{where} <b>the cache loses</b>: fastest is {said(rival)}, {behind}."
        nearest = f"; nearest with the cache is {said(near)}" if near else ""
        return f"{where} nothing that was tried is faster than exact by more than exact's own frames differ{nearest}."


def span(rows):
    """Speeds of rows, the least to the largest."""
    own = sorted(rows, key=speed)
    return f'{number(own[0], "point.frame", "times")} to {number(own[-1], "point.frame", "times")}'


def where_little_is_asked(entries):
    """Where a larger error is allowed, and what is without the cache is faster by more than the clock may be wrong."""
    lost = [(e, e.best_of(True), e.best_of(False)) for e in entries if e.best_of(False)]
    lost = [(e, ours, rival) for e, ours, rival in lost if not ours or speed(rival) > speed(ours) * e.clock()]
    if not lost:
        return []
    said_of = [f'{name(e.scene)} ({METHODS[rival["labels"]["method"]].name} {number(rival, "point.frame", "times")}, '
               f'the cache {number(ours, "point.frame", "times")})' for e, ours, rival in lost]
    return [f"Where an l_inf of {given(lost[0][0].target)} is enough, <b>the cache loses</b> in {', '.join(said_of)}."]


def at_equal_time(rows):
    """Against the converged image: what other noise leaves of it."""
    lines = []
    for scene in scenes_of(rows, "converged"):
        _, means = converged.ratios(rows, scene, converged.curves_of(rows, scene))
        if means and means["figures"].get("estimate") and not converged.is_less(means["figures"]["estimate"]):
            lines.append(f'{name(scene)} ({number(means, "figures.estimate", "times")})')
    return ["Against the converged image, noise of lamps, skies and pixels included, the estimate has no less error "
            f"than {METHODS['selection'].name} in the same seconds in {', '.join(lines)}."] if lines else []


def in_general(rows, entries):
    """Where the cache loses whatever the scene."""
    loose = [Entry(rows, scene, LOOSE) for scene in dict.fromkeys(e.scene for e in entries)]
    lines = where_little_is_asked(loose) + at_equal_time(rows)
    behind = [e for e in entries if "cache" in e.found and e.best_of(False) and
              speed(e.found["cache"]) < speed(e.best_of(False))]
    if behind:
        lines.append(f"The plain cache, which answers every pair, is slower than {METHODS['selection'].name} in " +
                     ", ".join(name(s) for s in dict.fromkeys(e.scene for e in behind)) +
                     " at the same targets; what it has for that is a picture without noise.")
    bdpt = [r for r in rows.values() if r["labels"].get("method") == "bdpt" and "point" in r]
    if bdpt and max(map(speed, bdpt)) < 1.0:
        lines.append(f"Bidirectional path tracing with the plain cache is never faster: {span(bdpt)}.")
    kinds = {}
    for r in rows.values():
        if r["labels"]["section"] == "lights" and "point" in r:
            kinds.setdefault((r["labels"]["kind"], r["labels"]["scene"]), []).append(r)
    lines += [f"{name(kind[0].upper() + kind[1:])} alone ({name(scene)}): {span(own)}, whatever C_E."
              for (kind, scene), own in kinds.items() if max(map(speed, own)) < 1.5]
    return lines


def section(a, rows):
    entries = [Entry(rows, scene, target) for scene in scenes_of(rows, "curves") for target in TARGETS]
    shown = [m for m in COLUMNS if any(m in e.found for e in entries)]
    columns = [("scene", lambda e: name(e.scene)), ("l_inf within", lambda e: given(e.target))]
    columns += [("exact", lambda e: number(e.base, "point.exact_s", "seconds") if e.base else "")]
    columns += [(METHODS[m].name, lambda e, m=m: e.cell(m)) for m in shown]
    if any(e.others for e in entries):
        columns += [(f"l_inf of {METHODS['others'].name}", lambda e: number(e.others, "point.error", "percent"))]
    lines = [s for s in (e.sentence() for e in entries) if s] + in_general(rows, entries)
    loses = '<div class="loses"><b>Where the cache loses</b><ul>' + "".join(f"<li>{s}</li>" for s in lines) + \
            "</ul></div>" if lines else ""
    caption = "How many times faster a whole frame is than exact, by the fastest setting that was measured and stays " \
              "within the error; the fastest is marked, and what is slower by no more than exact's own frames " \
              "differ. A dash: no setting stays within it. Errors are what a method " \
              "adds to one and the same set of lights; as many virtual lights of another draw are another picture, " \
              "off by what the last column says. What this report does not say: each scene is seen by one camera " \
              "with one seed, in small pictures, on the CPU; light trees, ReSTIR and denoisers were not compared."
    used = {r["id"]: r for e in entries for r in e.found.values()}
    return glance.section(a, rows, entries) + figure(table(columns, entries) + loses, caption, list(used.values()))
