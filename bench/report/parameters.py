# SPDX-License-Identifier: Apache-2.0
"""The cache's parameters one at a time around the defaults: rays, time and error of each value."""
import math
import statistics

from report.axes import from_zero, logarithmic
from report.curves import at_equal_error
from report.methods import derived
from report.page import FORMATS, attributes, counted, figure, given, name, number, save_plot, setting, table
from report.svg import Plot, Series

TITLE = "Parameters: are the defaults right?"
SAME = 1.05  # within this of the best counts as the best
# option: what it is, field of whitted's figures, the default's value where the field does not hold it, the paper's
WHAT = {"cn": ("C_N, bins of the normal per axis", "cn", None, "8"),
        "cz": ("C_Z, layers per cell side", "cz", None, "8"),
        "cr": ("C_R, ratio of successive resolutions", "cr", None, "1.2"),
        "refine": ("C_MSR, levels of refinement", "refine", "log2 C_E", "log2 C_E"),
        "refine-above": ("contribution above which lights are refined, in means", "refine_above", None, "0"),
        "cache-mb": ("memory of a cache, MiB", "cache_mb", None, "4")}
DRAWN = [("rays", "rays", "#0072b2", "square"), ("time", "time", "#333333", "diamond"),
         ("error", "l_inf", "#d55e00", "circle")]


def of_scene(rows, scene, parameter):
    return [r for r in rows.values() if r["labels"]["section"] == "parameters" and r["labels"]["scene"] == scene and
            r["labels"]["parameter"] == parameter and "point" in r]


def slope(rows, scene, base, what):
    """How `what` goes with the error when C_E moves: d ln what / d ln error over all C_E there are."""
    points = [base, *of_scene(rows, scene, "ce")]
    points = [(math.log(p["point"]["error"]), math.log(what(p))) for p in points if p["point"]["error"] > 0]
    if len(points) < 2 or max(p[0] for p in points) == min(p[0] for p in points):
        return None
    found = statistics.linear_regression(*zip(*points)).slope
    return found if found < 0.0 else None  # too small an image: more error for more rays


def clock(rows, scenes):
    """A row of how much times spread, standard deviations as factors: `exact` of one and the same exact frame, `ray`
    of the time that a ray of the cache took, whatever the parameter; and the larger one. A single slow frame of the
    default would make every other value look fast."""
    own = {s: [r for p in ("default", "ce", *WHAT, "hash") for r in of_scene(rows, s, p)] for s in scenes}
    spreads = [statistics.stdev(math.log(r["figures"]["exact"]["frame_s"]) for r in of) for of in own.values()
               if len(of) > 1]
    rays = [[math.log(r["figures"]["mode_run"]["visibility_s"] / r["figures"]["mode_run"]["rays_traced"]) for r in of
             if r["labels"]["parameter"] != "hash"] for of in own.values()]
    rays = [statistics.stdev(of) for of in rays if len(of) > 1]
    figures = {k: math.exp(max(s)) if s else None for k, s in (("exact", spreads), ("ray", rays))}
    figures["spread"] = max((f for f in figures.values() if f), default=None)
    return derived(rows, "parameters/clock", figures, [r["id"] for of in own.values() for r in of])


def against(rows, scene, row, base):
    """A row of what this value makes of the default's rays, time and error; `equal_...`: were C_E moved until the error
    is that of the default."""
    def rays(r):
        return r["point"]["share"]

    def time(r):
        return 1.0 / r["point"]["frame"]

    figures = {"value": row["figures"][WHAT[row["labels"]["parameter"]][1]] if row is not base else None}
    figures.update(rays=rays(row) / rays(base), time=time(row) / time(base), l_inf=row["point"]["error"],
                   share=rays(row), faster=row["point"]["frame"], mispredicted=row["point"]["mispredicted"])
    if row["point"]["error"] > 0 and base["point"]["error"] > 0:
        figures["error"] = row["point"]["error"] / base["point"]["error"]
        for what, of in (("rays", rays), ("time", time)):
            # what moving C_E would do to it on the way from this error to the default's
            along = slope(rows, scene, base, of)
            figures[f"equal_{what}"] = figures[what] * figures["error"] ** -along if along else None
    out = derived(rows, f'parameters/{scene}/{row["labels"]["parameter"]}/{row["labels"]["value"]}/against', figures,
                  [row["id"], base["id"], *(r["id"] for r in of_scene(rows, scene, "ce"))])
    out["labels"].update(scene=scene, words=f'{row["labels"]["value"]:g}')
    return out


def default_row(rows, scene, parameter, base):
    """The default among the values of a parameter."""
    field = WHAT[parameter][1]
    figures = {"value": base["figures"][field], "rays": 1.0, "time": 1.0, "error": 1.0, "equal_rays": 1.0,
               "equal_time": 1.0, "share": base["point"]["share"], "faster": base["point"]["frame"],
               "l_inf": base["point"]["error"], "mispredicted": base["point"]["mispredicted"]}
    if parameter == "refine":
        figures["value"] = max(1, int(math.log2(base["figures"]["ce"])))
    out = derived(rows, f"parameters/{scene}/{parameter}/default", figures, [base["id"]])
    out["labels"].update(scene=scene, words="default")
    return out


def plot(a, scene, parameter, own):
    own = sorted(own, key=lambda r: r["figures"]["value"])
    p = Plot(WHAT[parameter][0], f"{scene}: times the default's", 480, 320, 12, y_label=lambda v: f"{v:g}x",
             x_axis=logarithmic if own[0]["figures"]["value"] > 0 else from_zero)
    for field, words, colour, shape in DRAWN:
        points = [(r["figures"]["value"], r["figures"][field], attributes(r, x="figures.value", y=f"figures.{field}"),
                   f'{words}, {r["figures"]["value"]:g}: {FORMATS["times"](r["figures"][field])}')
                  for r in own if r["figures"].get(field)]
        p.series.append(Series(words, points, colour, shape))
    p.horizontal = [(1.0, "")]
    return save_plot(a, f"parameters-{scene}-{parameter}.svg", p.svg())


def verdict(rows, parameter, of, spread):
    """Best value over all scenes by rays and by time at equal error; a row of its figures, and what it says."""
    means = {}
    for scene_rows in of.values():
        for r in scene_rows:
            if r["figures"].get("equal_rays") and r["figures"].get("equal_time"):
                means.setdefault((r["figures"]["value"], r["labels"]["words"] == "default"), []).append(r["figures"])
    means_of = {v: figures for v, figures in means.items() if len(figures) == len(of)}
    means = {v: {k: statistics.geometric_mean(f[k] for f in figures) for k in ("equal_rays", "equal_time")}
             for v, figures in means_of.items()}
    if len(means) < 2:
        return None
    best = {k: min(means, key=lambda v, k=k: means[v][k]) for k in ("equal_rays", "equal_time")}
    ours = next(v for v in means if v[1])[0]
    figures = {"ours": ours, **{f"{k}_at": v[0] for k, v in best.items()}, **{k: means[v][k] for k, v in best.items()}}
    row = derived(rows, f"parameters/verdict/{parameter}", figures, [r["id"] for own in of.values() for r in own])
    _, _, words, paper = WHAT[parameter]
    said = f'Default {given(words) if words else number(row, "figures.ours", "plain")}, the paper\'s {given(paper)}. ' \
           "C_E moved so that the error is the default's, the fewest rays come with " \
           f'{number(row, "figures.equal_rays_at", "plain")} ({number(row, "figures.equal_rays", "times")} the ' \
           f'default\'s), the least time with {number(row, "figures.equal_time_at", "plain")} ' \
           f'({number(row, "figures.equal_time", "times")}): '
    same = {"equal_rays": SAME, "equal_time": max(SAME, (spread or 1.0) ** 2)}
    # better in the mean; and in each scene
    better = {k for k in best if same[k] * figures[k] < 1.0}
    sure = {k for k in better if all(same[k] * f[k] < 1.0 for f in means_of[best[k]])}
    if sure and parameter == "cache-mb":
        return said + "more memory always saves rays: a trade, no correction."
    if sure:
        lacking = " and ".join({"equal_rays": "rays", "equal_time": "time"}[k] for k in best if k in sure)
        return said + f"<b>the default is corrected</b> as to {lacking}, in each scene."
    if better:
        return said + "not in each scene by more than what counts as the same: <b>the default stands</b>."
    return said + "<b>the default is confirmed</b>, nothing is better by more than what counts as the same."


def in_curves(rows):
    """What whole frames of more scenes and paths say of refining once."""
    row = at_equal_error(rows, "cache-once", "cache")
    return " In the curves of speed against error, at the same error, two levels (refined once) are " \
           f"{number(row, 'figures.least', 'times')} to {number(row, 'figures.most', 'times')} as fast as " \
           f"{given('log2 C_E')} (means of scenes), and faster in {number(row, 'figures.faster', 'count')} of " \
           f"{number(row, 'figures.scenes', 'count')}." if row else ""


def parameter_section(a, rows, scenes, parameter, spread):
    of = {}
    for scene in scenes:
        base = of_scene(rows, scene, "default")
        own = of_scene(rows, scene, parameter)
        if base and own:
            of[scene] = [default_row(rows, scene, parameter, base[0]),
                         *(against(rows, scene, r, base[0]) for r in own)]
    if not of:
        return ""
    plots = "".join(plot(a, scene, parameter, own) for scene, own in of.items())
    columns = [("scene", lambda r: name(r["labels"]["scene"])),
               ("value", lambda r: number(r, "figures.value", "plain")),
               ("rays", lambda r: number(r, "figures.share", "share")),
               ("faster than exact", lambda r: number(r, "figures.faster", "times")),
               ("l_inf", lambda r: number(r, "figures.l_inf", "percent")),
               ("mispredicted", lambda r: number(r, "figures.mispredicted", "percent")),
               ("rays at equal error", lambda r: number(r, "figures.equal_rays", "times")),
               ("time at equal error", lambda r: number(r, "figures.equal_time", "times"))]
    flat = [r for own in of.values() for r in sorted(own, key=lambda r: r["figures"]["value"])]
    sources = [r for s in of for r in of_scene(rows, s, "default") + of_scene(rows, s, parameter)]
    inside = f'<div class="row">{plots}</div><details><summary>figures</summary>' \
             f'{table(columns, flat, f"parameters-{parameter}")}</details>'
    caption = verdict(rows, parameter, of, spread) or \
        "Nothing is said of the default: too few values, or the error does not fall as C_E does."
    if parameter == "refine":
        caption += in_curves(rows)
    return f"<h3>{name(WHAT[parameter][0])}</h3>" + figure(inside, caption, sources)


def hashes(rows, scenes):
    """All hash families: pairs in words of the table, timed; and their keys."""
    own = [r for s in scenes for r in of_scene(rows, s, "hash")]
    keys = [r for r in rows.values() if r["labels"]["section"] == "parameters" and "hash" in r["figures"] and
            isinstance(r["figures"]["hash"], dict)]
    columns = [("scene", lambda r: name(r["labels"]["scene"])), ("hash", lambda r: name(r["labels"]["value"])),
               ("rays", lambda r: number(r, "point.share", "share")),
               ("frame faster than exact", lambda r: number(r, "point.frame", "times")),
               ("seconds a frame", lambda r: number(r, "figures.mode_run.frame_s", "seconds")),
               ("l_inf", lambda r: number(r, "point.error", "percent")),
               ("mispredicted", lambda r: number(r, "point.mispredicted", "percent"))]
    of_keys = [("scene", lambda r: name(r["labels"]["scene"])),
               ("hash", lambda r: name(r["labels"]["parameter"][len("keys-"):])),
               ("pairs of cells", lambda r: number(r, "figures.hash.distinct", "count")),
               ("taken for another", lambda r: number(r, "figures.hash.merged", "count")),
               ("slots", lambda r: number(r, "figures.hash.words", "count")),
               ("used", lambda r: number(r, "figures.hash.slots", "count")),
               ("of what chance would use", lambda r: number(r, "figures.hash.slots_share", "share"))]
    caption = "Above: frames with single words for pairs, each hash in turn. Below: the pairs of cells that the " \
              "view asks " \
              "for; how many have another one's slot and digest and would get its answer, and how many slots they use."
    return f"<h3>Hashes {given('(Sect. 4.1)')}</h3>" + figure(table(columns, own) + table(of_keys, keys), caption,
                                                             own + keys)


def replays(rows, scenes):
    """One orientation for all grids, and more neighbours."""
    words = {"default": "default: 4 neighbours", "orientation": "one orientation for all grids",
             "around-8": "8 neighbours", "around-64": "64 neighbours: 8 around X times 8 around Y",
             "around-72": "72: 8 around X times 9 around and at Y"}
    own = [r for r in rows.values() if r["labels"]["section"] == "parameters" and r["labels"]["value"] == "replayed" and
           r["labels"]["parameter"] in words]
    columns = [("scene", lambda r: name(r["labels"]["scene"])), ("", lambda r: name(words[r["labels"]["parameter"]])),
               ("rays", lambda r: number(r, "figures.share", "percent")),
               ("mispredicted", lambda r: number(r, "figures.mispredicted", "percent")),
               ("l_inf", lambda r: number(r, "figures.l_inf", "percent")),
               ("cells", lambda r: number(r, "figures.cells", "count")),
               ("wrong beyond a side", lambda r: number(r, "figures.distance.beyond", "percent")),
               ("farthest, sides", lambda r: number(r, "figures.distance.largest", "error"))]
    said = []
    for scene in scenes:
        of = {r["labels"]["parameter"]: r for r in own if r["labels"]["scene"] == scene}
        if len(of) < len(words):
            continue
        base = of["default"]["figures"]
        figures = {f'{p.replace("-", "_")}_{k}': r["figures"][k] / base[k] for p, r in of.items() if p != "default"
                   for k in ("share", "l_inf") if base[k]}
        row = derived(rows, f"parameters/{scene}/replayed/against", figures, [r["id"] for r in of.values()])

        def ratio(field, row=row):
            return number(row, f"figures.{field}", "times")

        said.append(f'{name(scene)}: one orientation takes {ratio("orientation_share")} the rays at '
                    f'{ratio("orientation_l_inf")} the error; {name("8 neighbours")} {ratio("around_8_share")} at '
                    f'{ratio("around_8_l_inf")}; {name("64")} {ratio("around_64_share")} at '
                    f'{ratio("around_64_l_inf")}; {name("72")} {ratio("around_72_share")} at '
                    f'{ratio("around_72_l_inf")}.')
    caption = "Replayed pair by pair, cells unlimited in number, all lights refined. " + " ".join(said) + \
              f" The paper saw light leaks with one orientation {given('(Sect. 3.3)')}. Its " \
              f"{given('64 neighbours (Sect. 3.6)')} have another cell at both ends: what the cells beside the eye's " \
              f"know of the same light is not among them; with it there are {given('72')}. Its algorithm asks " \
              f"{given('4')}, all of the light's own cell, for efficiency. Beside the light's cell there " \
              "may be no light, or one whose density puts it into cells of another size."
    return "<h3>One orientation, more neighbours</h3>" + figure(table(columns, own), caption, own)


def section(a, rows):
    scenes = list(dict.fromkeys(r["labels"]["scene"] for r in rows.values() if r["labels"]["section"] == "parameters"))
    base = [r for s in scenes for r in of_scene(rows, s, "default")]
    time = clock(rows, scenes)
    shown = "; ".join(f"{name(r['labels']['scene'])}: {setting(r)}" for r in base)
    pairs = f" Each stands on {counted(base[0], 'figures.runs', 'pair')} of frames, that of the default too, to " \
            "which all are compared: where it was a slow one, all others look fast." if base else ""
    head = f"<p>The plain cache, one parameter moved at a time. {shown}. Fewer rays with more error prove nothing, " \
           "for C_E buys that too: so each value is also given as rays and time at equal error, C_E being moved " \
           "along its own line of rays over error. Rays within a twentieth count as the same, times within twice the " \
           "larger of two spreads (standard deviations, as factors): " \
           f"{number(time, 'figures.exact', 'times')} of the same exact frame's time, " \
           f"{number(time, 'figures.ray', 'times')} of the time that a ray takes over all frames of the " \
           f"cache.{pairs}</p>"
    sections = "".join(parameter_section(a, rows, scenes, p, time["figures"]["spread"]) for p in WHAT)
    return head + sections + hashes(rows, scenes) + replays(rows, scenes)
