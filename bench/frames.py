#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whole frames, exact against a chosen mode: prints a Markdown table per group and keeps the figures as CSV.

    python3 bench/frames.py [--scenes FOLDER] [--filter REGEX] [--runs N] [--csv FILE] [--readme README.md]

Groups of cases (--list shows all):
  targets/SCENE/ERROR  --visibility estimate with as many rays as keep l_inf at 0.5, 1, 2 %
  plain/SCENE/...      --visibility cache at several C_E
  builtin/NAME/...     every built-in scene in default settings, both modes: is any slower than exact?
  large/NAME           scenes of leaves and hair under an environment map
  lights/N, pixels/WxH, spp/N, triangles/NAME, threads/N   how the time of a pair grows; mode: --visibility

FOLDER holds NAME/NAME.glb and hdri/. Build first: meson setup build && ninja -C build.
"""
import csv
import math
import re
import sys

sys.dont_write_bytecode = True
from scenes import BUILTIN, Failure, Parser, missing_file, public, run, run_main, scene_words, table

REAL = ["kitchen", "conference", "breakfast", "living-room"]
BY_TRIANGLES = ["dominoes", "shapes", "lost-empire", "conference", "breakfast", "kitchen", "san-miguel"]
TARGETS = [0.005, 0.01, 0.02]
# where the search for the number of rays begins, for 1 % (it ends where it ends)
START = {"kitchen": 6.0, "conference": 5.8, "breakfast": 4.2, "living-room": 4.6}
NOT_SLOWER = 0.95  # of exact

COLUMNS = ["case", "scene", "triangles", "width", "height", "spp", "vpls", "lights", "samples", "eye_samples", "threads",
           "seed", "mode", "select", "ce", "runs", "rays_asked", "rays_traced", "traced_share", "exact_frame_s",
           "exact_shade_s", "mode_frame_s", "mode_shade_s", "lights_s", "exact_ns", "mode_ns", "cache_bytes", "frame",
           "frame_min", "frame_max", "frame_low95", "frame_high95", "verdict", "shade", "exact_scaling", "mode_scaling",
           "l_inf", "l_inf_whole", "rel_mse", "p999", "max", "mispredicted", "target", "command"]


def median_interval(values):
    """The 95 % confidence interval of the median: order statistics k and n + 1 - k with P(Bin(n, 1/2) < k) <= 2.5 %."""
    n, k, below = len(values), 0, 0.0
    while k < n and below + math.comb(n, k) / 2 ** n <= 0.025:
        below += math.comb(n, k) / 2 ** n
        k += 1
    if k == 0:
        return None, None  # fewer than 6
    ordered = sorted(values)
    return ordered[k - 1], ordered[n - k]


class Case:
    def __init__(self, name, scene, size, spp, mode, runs, options=(), vpls=1024, threads=1, target=None):
        self.name, self.scene, self.size, self.spp, self.mode = name, scene, size, spp, list(mode)
        self.runs, self.options, self.vpls, self.threads, self.target = runs, list(options), vpls, threads, target

    def command(self, a, mode, runs):
        size, spp, vpls = self.size, self.spp, self.vpls
        if a.quick:
            size, spp, vpls, runs = "48x32", min(spp, 4), min(vpls, 64), min(runs, 1 if self.runs < 9 else 9)
        return [a.whitted, *scene_words(a, self.scene), "--size", size, "--spp", str(spp), "--vpls", str(vpls),
                *self.options, "--threads", str(self.threads), *mode, "--compare", "--runs", str(runs), "--quiet", "--json", "-"]


def all_cases(a):
    mode = ["--visibility", a.visibility]
    cases = []
    for s in REAL:
        cases += [Case(f"targets/{s}/{t:g}", s, "320x180", 16, ["--visibility", "estimate"], 5, target=t)
                  for t in TARGETS]
    for s in REAL:
        cases.append(Case(f"plain/{s}/1spp-ce8", s, "640x360", 1, ["--visibility", "cache", "--ce", "8"], 5))
        cases += [Case(f"plain/{s}/ce{ce}", s, "320x180", 16, ["--visibility", "cache", "--ce", str(ce)], 5)
                  for ce in (8, 16, 32)]
    for s in BUILTIN:
        cases += [Case(f"builtin/{s}/{size}-{spp}spp/{m}", s, size, spp, ["--visibility", m], 9)
                  for size, spp in (("160x90", 16), ("320x180", 1)) for m in ("cache", "estimate")]
    cases += [Case(f"large/{s}", s, "320x180", 4, mode, 5, ["--env-lights", "256"])
              for s in ("san-miguel", "hair-straight")]
    cases += [Case(f"lights/{n}", "conference", "160x90", 16, mode, 3, vpls=n) for n in (64, 256, 1024, 4096, 16384)]
    cases += [Case(f"pixels/{size}", "conference", size, 1, mode, 3)
              for size in ("160x90", "320x180", "640x360", "1280x720")]
    cases += [Case(f"spp/{n}", "conference", "160x90", n, mode, 3) for n in (1, 4, 16, 64)]
    cases += [Case(f"triangles/{s}", s, "160x90", 16, mode, 3) for s in BY_TRIANGLES]
    cases += [Case(f"threads/{n}", "conference", "320x180", 16, mode, 5, threads=n) for n in (1, 2)]
    return cases


def rays_for(a, case, known):
    """Fewest rays per eye sample (two digits) that keep the error at its target; `known`: errors by number of rays.
    Errors fall about as 1 / sqrt(rays) at first and faster later, for rows fill."""
    steps = 1 if a.quick else 6

    def error(k):
        if k not in known:
            known[k] = run(case.command(a, case.mode + ["--select", f"{k:g}"], 1))["error"]["l_inf"]
        return known[k]

    def rounded(k):
        return float(f"{min(1000.0, max(0.1, k)):.2g}")

    k = rounded(START.get(case.scene, 6.0) * (0.01 / case.target) ** 1.4)
    for _ in range(steps):
        if error(k) > 0.0:
            # the nearest known value leads fastest
            start = min(known, key=lambda x: abs(math.log(max(known[x], 1e-9) / case.target)))
            k = rounded(start * (max(known[start], 1e-9) / (0.97 * case.target)) ** 2)
        good = [x for x in known if known[x] <= case.target]
        if k in known or (good and 0.93 * case.target <= known[min(good)]):
            break
    good = [x for x in known if known[x] <= case.target]
    if not good and error(k) <= case.target:
        good = [k]
    return min(good) if good else max(known)


def per_pair(seconds, pairs, threads):
    return 1e9 * seconds * threads / pairs if pairs else None


def measure(a, case, known, rows):
    mode, select = case.mode, None
    if case.target:
        select = rays_for(a, case, known.setdefault(case.scene, {}))
        mode = mode + ["--select", f"{select:g}"]
    command = case.command(a, mode, a.runs or case.runs)
    j = run(command)
    exact, chosen = j["exact"], j["mode_run"]
    row = {key: j[key] for key in COLUMNS if key in j and key not in ("mode", "ce")}
    row.update(j["error"])
    row.update({key: j["speedup"][key] for key in ("frame", "frame_min", "frame_max", "shade")})
    row.update({key: chosen[key] for key in ("rays_asked", "rays_traced", "lights_s", "cache_bytes")})
    row.update(case=case.name, mode=j["mode"], ce=j["ce"], target=case.target, exact_frame_s=exact["frame_s"],
               exact_shade_s=exact["shade_s"], mode_frame_s=chosen["frame_s"], mode_shade_s=chosen["shade_s"])
    row["select"] = j.get("select", select)
    asked = chosen["rays_asked"]
    row["traced_share"] = chosen["rays_traced"] / asked if asked else None
    row["exact_ns"] = per_pair(exact["shade_s"], asked, case.threads)
    row["mode_ns"] = per_pair(chosen["shade_s"], asked, case.threads)
    low, high = median_interval(j["speedup"].get("frames", []))
    row["frame_low95"], row["frame_high95"] = low, high
    if low is not None:
        row["verdict"] = "yes" if low >= NOT_SLOWER else "no" if high < NOT_SLOWER else "unclear"
    one = row if case.threads == 1 else next((r for r in rows if r["case"] == "threads/1"), None)
    if case.name.startswith("threads/") and one:
        row["exact_scaling"] = one["exact_frame_s"] / row["exact_frame_s"]
        row["mode_scaling"] = one["mode_frame_s"] / row["mode_frame_s"]
    row["command"] = public(a, command)
    return row


# ------------------------------------------------------------------------------------------------------------- tables

def percent(r, key, digits=2):
    return "-" if r.get(key) is None else f"{100 * r[key]:.{digits}f} %"


def number(r, key, form):
    return "-" if r.get(key) is None else format(r[key], form)


def setting(r):
    how = f"C_E {r['ce']:g}" if r["mode"] == "cache" else "estimate"
    if r.get("select") is not None and r["mode"] == "estimate":
        how += f", {r['select']:g} rays"
    if r.get("target"):
        how += f" for {100 * r['target']:g} %"
    return f"{r['width']}x{r['height']}, {r['spp']} spp, {how}"


def faster(r):
    return f"{r['frame']:.2f}x ({r['frame_min']:.2f} ... {r['frame_max']:.2f})"


NAME = [("case", "---", lambda r: r["case"].split("/", 1)[1])]
SCENE = [("scene", "---", lambda r: r["scene"]), ("triangles", "---:", lambda r: f"{r['triangles']:,}"),
         ("setting", "---", setting)]
ERRORS = [("rays traced", "---:", lambda r: percent(r, "traced_share", 1)), ("`l_inf`", "---:", lambda r: percent(r, "l_inf")),
          ("p99.9", "---:", lambda r: number(r, "p999", ".2f")),
          ("mispredicted", "---:", lambda r: percent(r, "mispredicted", 1))]
TIMES = [("exact", "---:", lambda r: f"{r['exact_frame_s']:.2f} s"), ("mode", "---:", lambda r: f"{r['mode_frame_s']:.2f} s"),
         ("faster", "---:", faster)]
GROWTH = [("triangles", "---:", lambda r: f"{r['triangles']:,}"), ("pairs", "---:", lambda r: f"{r['rays_asked']:,}"),
          ("`l_inf`", "---:", lambda r: percent(r, "l_inf")), ("exact, ns a pair", "---:", lambda r: number(r, "exact_ns", ".1f")),
          ("mode, ns a pair", "---:", lambda r: number(r, "mode_ns", ".1f")), ("faster", "---:", faster),
          ("memory", "---:", lambda r: f"{r['cache_bytes'] / 2 ** 20:.1f} MiB")]
VERDICT = [("95 % interval", "---:", lambda r: f"{number(r, 'frame_low95', '.2f')} ... {number(r, 'frame_high95', '.2f')}"),
           ("at most 5 % slower", "---", lambda r: r.get("verdict") or "-")]
SCALING = [("exact, times one thread", "---:", lambda r: number(r, "exact_scaling", ".2f")),
           ("mode, times one thread", "---:", lambda r: number(r, "mode_scaling", ".2f"))]
TABLES = {"targets": SCENE + ERRORS + TIMES, "plain": SCENE + ERRORS + TIMES, "large": SCENE + ERRORS + TIMES,
          "builtin": NAME + ERRORS + TIMES + VERDICT, "threads": NAME + TIMES + SCALING}


def table_of(group, rows):
    return table(TABLES.get(group, NAME + GROWTH), rows)


def group_of(name):
    return name.split("/", 1)[0]


def replace_table(path, text):
    with open(path) as f:
        page = f.read()
    parts = re.match(r"(.*<!-- table: python3 bench/frames.py[^\n]*-->\n).*(<!-- end of table -->.*)", page, re.DOTALL)
    if not parts:
        raise Failure(f"{path}: no '<!-- table: python3 bench/frames.py ... -->' and '<!-- end of table -->' in it")
    with open(path, "w") as f:
        f.write(parts[1] + text + "\n" + parts[2])


def parse():
    parser = Parser(__doc__)
    parser.add_argument("--visibility", choices=("cache", "estimate"), default="estimate",
                        help="mode of the groups that do not name one")
    parser.add_argument("--runs", type=int, help="pairs of frames (default: 9 for builtin, 5 or 3 else)")
    parser.add_argument("--readme", metavar="FILE", help="replace the table in this file as well")
    a = parser.parse()
    if a.runs is not None and not 1 <= a.runs <= 99:
        parser.error(f"--runs takes 1 ... 99, not {a.runs}")
    return parser, a


def main():
    parser, a = parse()
    cases = [c for c in all_cases(a) if a.filter.search(c.name)]
    if not cases:
        sys.exit(f"frames.py: --filter '{a.filter.pattern}' matches no case; --list shows them")
    if a.list:
        print("\n".join(c.name for c in cases))
        return
    parser.check_whitted(a)
    rows, known, failed = [], {}, 0
    with parser.open_csv(a) as out:
        writer = csv.DictWriter(out, COLUMNS, extrasaction="ignore")
        writer.writeheader()
        for case in cases:
            lacking = missing_file(a, case.scene)
            if lacking:
                print(f"frames.py: {case.name}: left out, {lacking} is not there", file=sys.stderr)
                continue
            try:
                rows.append(measure(a, case, known, rows))
            except Failure as e:
                failed += 1
                print(f"frames.py: {case.name}: {e}", file=sys.stderr)
                continue
            writer.writerow(rows[-1])
            out.flush()  # hours of frames must not be lost
    tables = [table_of(g, [r for r in rows if group_of(r["case"]) == g])
              for g in dict.fromkeys(group_of(r["case"]) for r in rows)]
    print("\n\n".join(tables))
    if a.readme and tables:
        try:
            replace_table(a.readme, "\n\n".join(tables))
        except (Failure, OSError) as e:
            sys.exit(f"frames.py: {e}")
    if failed or not rows:
        sys.exit(f"frames.py: {failed} cases failed, {len(rows)} measured")


if __name__ == "__main__":
    run_main(main)
