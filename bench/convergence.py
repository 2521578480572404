#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Error against a converged image over the seconds of a frame, by method: prints a Markdown table per scene.

    python3 bench/convergence.py [--scenes FOLDER] [--filter REGEX] [--references FOLDER] [--plots FOLDER] [--csv FILE]

Cases are SCENE/METHOD (--list shows all). Methods:
  selection         --visibility exact --select K      K lights an eye path by unoccluded contribution, no cache
  cache             --visibility cache --ce X          every light, plain cache: no noise of its own, but bias
  estimate          --visibility estimate --select K   the cache as control variate
  cached-selection  --visibility cache --select K      K lights by contribution times cached visibility
  exact             --visibility exact                 every light traced

Each is rendered with more and more paths a pixel and several K or X; its curve is what no other of its points beats in
both time and error. At equal time, curves are read off by log-log interpolation and divided by --base's.

The converged image has the same seed, for the seed makes the virtual point lights: those of another seed are another
picture. It is rendered once per scene, kept in --references and taken again where all settings are the same and one
exact path per pixel has the error against it that was noted down with it.

FOLDER holds NAME/NAME.glb and hdri/. Build first: meson setup build && ninja -C build.
"""
import csv
import json
import math
import os
import re
import shlex
import statistics
import sys
import tempfile

sys.dont_write_bytecode = True
from convergence_plot import plot
from scenes import ROOT, Failure, Parser, missing_file, public, run, run_main, scene_words, table

SCENES = ["kitchen", "conference", "living-room", "san-miguel", "cornell"]
DOUBLING = [1, 2, 4, 8, 16, 32, 64, 128, 256]
FINER = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128]
KS = [2, 4, 8, 16, 32]
# name: options, the option of the knob, its values, paths per pixel
METHODS = {"selection": (["--visibility", "exact"], "--select", KS, DOUBLING),
           "cache": (["--visibility", "cache"], "--ce", [8, 16, 32], FINER),
           "estimate": (["--visibility", "estimate"], "--select", KS, DOUBLING),
           "cached-selection": (["--visibility", "cache"], "--select", KS, DOUBLING),
           "exact": (["--visibility", "exact"], None, [None], FINER)}
ALL_KNOBS = 8         # paths per pixel up to which all values of a knob are tried; then the best two
FEWEST = 6            # numbers of paths that are measured however long they take: a curve needs points
SHARED = 16           # paths of the reference for each of a test: its first ones are the test's
REPEATED = 4.0        # seconds spent on a point after which it is not repeated
TIMES = 8             # points of the table

COLUMNS = ["scene", "method", "knob", "value", "width", "height", "spp", "vpls", "lights", "samples", "eye_samples",
           "threads", "seeds", "runs", "frame_s", "frame_min", "frame_max", "lights_s", "rel_mse", "rel_mse_min",
           "rel_mse_max", "l_inf", "p999", "max", "rays_traced", "served", "front", "reference_error", "command",
           "reference"]


def base_command(a, scene, spp, seed):
    return [a.whitted, *scene_words(a, scene), "--size", a.size, "--spp", str(spp), "--vpls", str(a.vpls), "--seed",
            str(seed), "--threads", "1", *a.options]


# --------------------------------------------------------------------------------------------------------- references

def against(command, reference):
    return run(command + ["--reference", reference, "--quiet", "--json", "-"])


class Reference:
    """A converged image of one scene and seed, `image`, with its figures beside it."""

    def __init__(self, a, scene, seed):
        select = ["--select", str(a.reference_select)] if a.reference_select else []
        how = f"select{a.reference_select}" if select else "all"
        name = f"{scene}-{a.size}-{a.vpls}vpls-seed{seed}-exact-{how}-{a.reference_spp}spp"
        name += re.sub("[^A-Za-z0-9.]+", "-", " ".join([""] + a.options))
        self.image, self.figures = (os.path.join(a.references, name + end) for end in (".exr", ".json"))
        self.command = base_command(a, scene, a.reference_spp, seed) + ["--visibility", "exact"] + select
        self.text = public(a, self.command)
        probe = base_command(a, scene, 1, seed) + ["--visibility", "exact"]
        if not self.kept(probe):
            figures = run(self.command + ["-o", self.image, "--quiet", "--json", "-"])
            error = against(probe, self.image)["reference"]["mode_run"]["rel_mse"]
            with open(self.figures, "w") as f:
                json.dump({"command": self.text, "samples": figures["samples"], "probe": error}, f, indent=1)
        with open(self.figures) as f:
            self.samples = json.load(f)["samples"]

    def kept(self, probe):
        """Whether there is one, and of this renderer: lights or paths of another would have another error."""
        try:
            with open(self.figures) as f:
                noted = json.load(f)
            if noted["command"] != self.text or not os.path.exists(self.image):
                return False
            error = against(probe, self.image)["reference"]["mode_run"]["rel_mse"]
            same = math.isclose(error, noted["probe"], rel_tol=1e-3)
        except (OSError, ValueError, KeyError, Failure):
            return False
        if not same:
            print(f"convergence.py: {self.image}: not of this renderer or scene, rendered again", file=sys.stderr)
        return same


# ------------------------------------------------------------------------------------------------------------- points

def measure(a, scene, references, method, value, spp):
    """One point: medians of all seeds and runs."""
    options, knob, _, _ = METHODS[method]
    options = options + ([knob, f"{value:g}"] if knob else [])
    times, errors, last, spent = [], [], None, 0.0
    for reference, seed in zip(references, range(a.seeds)):
        command = base_command(a, scene, spp, seed) + options
        for _ in range(a.runs):
            last = against(command, reference.image)
            times.append(last["mode_run"]["frame_s"])
            errors.append(last["reference"]["mode_run"])
            spent += times[-1]
            if spent > REPEATED * (seed + 1):
                break
    row = {key: last[key] for key in COLUMNS if key in last and key not in ("runs", "reference")}
    row.update({key: statistics.median(e[key] for e in errors) for key in ("l_inf", "rel_mse", "p999", "max")})
    row.update(method=method, knob=knob, value=value, seeds=a.seeds, runs=len(times), frame_s=statistics.median(times),
               frame_min=min(times), frame_max=max(times), lights_s=last["mode_run"]["lights_s"],
               rel_mse_min=min(e["rel_mse"] for e in errors), rel_mse_max=max(e["rel_mse"] for e in errors),
               rays_traced=last["mode_run"]["rays_traced"], command=public(a, command), reference=references[0].text)
    return row


def front(points, time="frame_s", error="rel_mse"):
    """Those that no other beats in time and error, fastest first."""
    kept = []
    for p in sorted(points, key=lambda p: (p[time], p[error])):
        if not kept or p[error] < kept[-1][error]:
            kept.append(p)
    return kept


def steps(a, scene, method, references):
    """Points of one method, a list for each number of paths."""
    _, _, values, paths = METHODS[method]
    last = {}
    if a.quick:
        values, paths = values[:2], paths[:3]
    for step, spp in enumerate(paths):
        if spp > ALL_KNOBS and len(values) > 2:
            values = sorted(values, key=lambda v: last[v]["frame_s"] * last[v]["rel_mse"])[:2]
        affordable = [v for v in values if step < FEWEST or last[v]["frame_s"] * spp / last[v]["spp"] <= a.longest]
        if affordable and spp * SHARED > a.reference_spp:
            print(f"convergence.py: {scene}/{method}: {spp} and more paths left out, the reference has too few",
                  file=sys.stderr)
            return
        for value in affordable:
            last[value] = measure(a, scene, references, method, value, spp)
            last[value]["scene"] = scene
        yield [last[v] for v in affordable]


def finish(a, rows, references):
    """What is known of a method's points once all of them are there."""
    # its noise goes down with its paths, if at first more slowly where there are many light samples a path
    for row in rows:
        samples = max(1, row["samples"]) / max(1, references[0].samples)
        row["reference_error"] = row["rel_mse"] * row["spp"] / a.reference_spp * samples
    kept = front(rows)
    for row in rows:
        row["front"] = "yes" if any(row is k for k in kept) else "no"
    if len(kept) < FEWEST and not a.quick:
        print(f"convergence.py: {rows[0]['scene']}/{rows[0]['method']}: only {len(kept)} points on the curve",
              file=sys.stderr)


# ---------------------------------------------------------------------------------------------------- curves, tables

def at_time(curve, seconds):
    """Log-log interpolation; None off the curve's ends."""
    for p, q in zip(curve, curve[1:]):
        if p["frame_s"] <= seconds <= q["frame_s"]:
            if not (p["rel_mse"] > 0.0 and q["rel_mse"] > 0.0):
                return None
            t = math.log(seconds / p["frame_s"]) / math.log(q["frame_s"] / p["frame_s"])
            return p["rel_mse"] * (q["rel_mse"] / p["rel_mse"]) ** t
    return None


def equal_times(curves):
    """Log-spaced within what the curves have in common; `exact` may lie beyond it."""
    ends = [(c[0]["frame_s"], c[-1]["frame_s"]) for m, c in curves.items() if m != "exact" or len(curves) < 3]
    low, high = max(e[0] for e in ends), min(e[1] for e in ends)
    if low >= high:
        return []
    inside = [low * (high / low) ** (i / (TIMES - 1)) for i in range(TIMES)]
    return [low] + inside[1:-1] + [high]  # without the last bits lost on the way


def number(value, form):
    return "-" if value is None else format(value, form)


def table_of(curves, base):
    rows = []
    for t in equal_times(curves):
        row = {"time": t}
        row.update({m: at_time(c, t) for m, c in curves.items()})
        rows.append(row)
    others = [m for m in curves if m != base] if base in curves else []

    def ratio(row, m):
        return row[m] / row[base] if row[m] is not None and row[base] else None

    columns = [("seconds", "---:", lambda r: number(r["time"], ".3g"))]
    columns += [(m, "---:", lambda r, m=m: number(r[m], ".3g")) for m in curves]
    columns += [(f"{m} / {base}", "---:", lambda r, m=m: number(ratio(r, m), ".2f")) for m in others]
    if not rows:
        return "No time that all curves reach."
    means = []
    for m in others:
        ratios = [x for x in (ratio(r, m) for r in rows) if x]
        if ratios:
            means.append(f"{m} / {base} {statistics.geometric_mean(ratios):.2f} ({min(ratios):.2f} ... {max(ratios):.2f} at "
                         f"{len(ratios)} times)")
    return table(columns, rows) + ("\n\nGeometric means: " + "; ".join(means) + "." if means else "")


def reference_error(rows):
    """That of the reference itself, from the point of its own method with the most paths."""
    def like(r):
        return r["method"] == "exact" if "--select" not in r["reference"] else r["method"] == "selection"
    own = [r for r in rows if like(r)]
    asked = shlex.split(own[0]["reference"]) if own else []
    if "--select" in asked:
        k = float(asked[asked.index("--select") + 1])
        nearest = min(abs(math.log(r["value"] / k)) for r in own)
        own = [r for r in own if abs(math.log(r["value"] / k)) == nearest]
    return max(own, key=lambda r: r["spp"])["reference_error"] if own else None


def report(a, scene, rows):
    curves = {m: front([r for r in rows if r["method"] == m]) for m in METHODS}
    curves = {m: c for m, c in curves.items() if c}
    first, floor = rows[0], reference_error(rows)
    print(f"**{scene}**, {first['width']}x{first['height']}, {first['vpls']} virtual point lights, relMSE of the whole image"
          + (f"; the reference's own is at most about {floor:.2g}" if floor else "") + ":\n")
    print(table_of(curves, a.base), end="\n\n", flush=True)
    if a.plots:
        points = {m: [r for r in rows if r["method"] == m] for m in curves}
        with open(os.path.join(a.plots, scene + ".svg"), "w") as f:
            f.write(plot(f"{scene}: error over time", points, curves, floor))


# --------------------------------------------------------------------------------------------------------------- main

def parse():
    parser = Parser(__doc__)
    parser.add_argument("--references", metavar="FOLDER",
                        help="where converged images are kept (default: out/references; none kept with --quick)")
    parser.add_argument("--reference-spp", type=int, help="paths per pixel of a reference (default 4096)")
    parser.add_argument("--reference-select", type=int, default=8, metavar="K",
                        help="lights drawn per path of a reference; 0: all of them (default 8)")
    parser.add_argument("--size", default="320x180")
    parser.add_argument("--vpls", type=int, default=1024)
    parser.add_argument("--options", default="", help="more options of whitted, for references and tests, in one word: "
                        "--options='--light-samples 16'")
    parser.add_argument("--seeds", type=int, default=1, help="seeds 0, 1 ..., each with its own lights and reference")
    parser.add_argument("--runs", type=int, default=3, help="frames a point and seed, fewer where they take long")
    parser.add_argument("--longest", type=float, default=16.0, help="seconds a frame may be expected to take")
    parser.add_argument("--base", choices=METHODS, default="selection", help="what the others are divided by")
    parser.add_argument("--plots", metavar="FOLDER", help="an SVG file per scene")
    parser.add_argument("--again", metavar="CSV", help="tables and plots from earlier figures; renders nothing")
    a = parser.parse()
    try:
        a.options = shlex.split(a.options)
    except ValueError as e:
        parser.error(f"--options: {e}")
    if a.quick:
        a.size, a.vpls, a.runs, a.reference_spp = "48x32", min(a.vpls, 64), 1, a.reference_spp or 64
    elif not a.references:
        a.references = os.path.join(ROOT, "out", "references")
    a.reference_spp = a.reference_spp or 4096
    for option, value, low, high in (("--reference-spp", a.reference_spp, SHARED, 4096), ("--runs", a.runs, 1, 99),
                                     ("--reference-select", a.reference_select, 0, 1000), ("--seeds", a.seeds, 1, 99)):
        if not low <= value <= high:
            parser.error(f"{option} takes {low} ... {high}, not {value}")
    return parser, a


def read_again(parser, path):
    try:
        with open(path, newline="") as f:
            rows = list(csv.DictReader(f))
        for r in rows:
            for key in ("frame_s", "rel_mse", "reference_error", "spp"):
                r[key] = float(r[key])
            r["value"] = float(r["value"]) if r["value"] else None
            r["method"], r["reference"]
    except OSError as e:
        parser.error(f"{path}: {e.strerror}")
    except (KeyError, TypeError, ValueError, csv.Error):
        parser.error(f"{path}: not a file of this program's figures")
    return rows


def measure_scene(a, scene, methods, writer):
    """Rows of all methods, how many of them failed."""
    rows, failed = [], 0
    try:
        references = [Reference(a, scene, seed) for seed in range(a.seeds)]
    except Failure as e:
        print(f"convergence.py: {scene}: no reference: {e}", file=sys.stderr)
        return [], len(methods)
    # By turns: machines have slow minutes, which must not meet one method alone.
    running, found = {m: steps(a, scene, m, references) for m in methods}, {m: [] for m in methods}
    while running:
        for m in list(running):
            try:
                found[m] += next(running[m])
                continue
            except StopIteration:
                finish(a, found[m], references)
            except Failure as e:
                failed += 1
                found[m] = []
                print(f"convergence.py: {scene}/{m}: {e}", file=sys.stderr)
            del running[m]
    for m in methods:
        writer(found[m])
        rows += found[m]
    return rows, failed


def measure_all(parser, a, cases):
    measured, failed = 0, 0
    with parser.open_csv(a) as out:
        writer = csv.DictWriter(out, COLUMNS, extrasaction="ignore")
        writer.writeheader()

        def write(rows):
            writer.writerows(rows)
            out.flush()  # hours of frames must not be lost

        for scene in dict.fromkeys(s for s, _ in cases):
            lacking = missing_file(a, scene)
            if lacking:
                print(f"convergence.py: {scene}: left out, {lacking} is not there", file=sys.stderr)
                continue
            rows, bad = measure_scene(a, scene, [m for s, m in cases if s == scene], write)
            failed += bad
            measured += len(rows)
            if rows:
                report(a, scene, rows)
    if failed or not measured:
        parser.error(f"{failed} cases failed, {measured} points measured")


def main():
    parser, a = parse()
    cases = [(s, m) for s in SCENES for m in METHODS if a.filter.search(f"{s}/{m}")]
    if not cases:
        parser.error(f"--filter '{a.filter.pattern}' matches no case; --list shows them")
    if a.list:
        print("\n".join(f"{s}/{m}" for s, m in cases))
        return
    try:
        for folder in (a.plots, None if a.again else a.references):
            if folder:
                os.makedirs(folder, exist_ok=True)
    except OSError as e:
        parser.error(f"{e.filename}: {e.strerror}")
    if a.again:
        rows = [r for r in read_again(parser, a.again) if (r["scene"], r["method"]) in cases]
        for scene in dict.fromkeys(r["scene"] for r in rows):
            report(a, scene, [r for r in rows if r["scene"] == scene])
        return
    parser.check_whitted(a)
    if a.references:
        measure_all(parser, a, cases)
        return
    with tempfile.TemporaryDirectory() as a.references:
        measure_all(parser, a, cases)


if __name__ == "__main__":
    run_main(main)
