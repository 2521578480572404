#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Adaptive shadow testing (Ward 1991) by whitted: prints Markdown tables, writes plots and figures.

    python3 bench/adaptive.py [--scenes FOLDER] [--filter REGEX] [--plots FOLDER] [--csv FILE]

Groups of cases (--list shows all):
  figure/SCENE     tests and errors over tolerance and certainty, as Figures 3, 4, 6 and 7 of the paper
  lights/N/MODE    time and error of exact, adaptive, cached tests and both, N lights above floating furniture
  rates/SCENE      hit rates learnt before the first tile, and on the way (--shared)
  overhead/SCENE   t = 0, and a tolerance so low that all that counts is tested, against exact
SCENE is a built-in one, or conference-24 and -192: FOLDER/conference/conference.glb with that many lights.

Errors are of the luminance of pixels, relative to the exact one. Build first: meson setup build && ninja -C build.
"""
import csv
import os
import sys
import tempfile

sys.dont_write_bytecode = True
import glb
from adaptive_plot import plot
from scenes import ROOT, Failure, Parser, public, run, run_main, table

TOLERANCES = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5]
CERTAINTIES = [0, 0.25, 0.5, 0.75, 1]
# what the paper shows of it, and where
FIGURES = {"conference-lights": "3", "conference-lights-192": "4", "conference-lights-floating": "5",
           "conference-lights-192-floating": "6", "conference-lights-diffuse": "7", "conference-24": "-",
           "conference-192": "-"}
LIGHTS = [24, 192, 1000, 10000]
MODES = {"adaptive": ["--visibility", "adaptive", "--tolerance", "0.2", "--certainty", "0.5"],
         "adaptive-tight": ["--visibility", "adaptive", "--tolerance", "0.05", "--certainty", "0.5"],
         "cache": ["--visibility", "cache", "--ce-delta", "2"],
         "adaptive-cache": ["--visibility", "adaptive-cache", "--tolerance", "0.2", "--certainty", "0.5",
                            "--ce-delta", "2"]}
COLUMNS = ["case", "scene", "lights", "width", "height", "mode", "tolerance", "certainty", "asked", "traced", "tested",
           "exact_s", "exact_shade_s", "mode_s", "mode_shade_s", "faster", "faster_min", "faster_max", "mean_error",
           "max_error", "l_inf", "p999", "command"]


def divided(source, out):
    """A copy of a .glb in which 4 x 2 lights stand around each punctual one, as bright as it together."""
    scene, rest = glb.read(source)
    nodes, lights = scene["nodes"], scene["extensions"]["KHR_lights_punctual"]["lights"]
    for light in lights:
        light["intensity"] = light.get("intensity", 1) / 8
    lists = [s["nodes"] for s in scene["scenes"]] + [n["children"] for n in nodes if "children" in n]
    for i in [i for i, n in enumerate(nodes) if "KHR_lights_punctual" in n.get("extensions", {})]:
        owner = next(l for l in lists if i in l)
        middle = list(nodes[i]["matrix"])
        for k in range(8):  # fixtures of 1.2 x 0.6 m; a metre is 333 units
            at = list(middle)
            at[12] += 100 * (k % 4 - 1.5)
            at[14] += 100 * (k // 4 - 0.5)
            copy = dict(nodes[i], matrix=at)
            if k == 0:
                nodes[i] = copy
            else:
                owner.append(len(nodes))
                nodes.append(copy)
    glb.write(out, scene, rest)


def is_file(scene):
    return scene in ("conference-24", "conference-192")


class Stage:
    """A scene on the command line, for as long as its file is needed."""

    def __init__(self, a, scene):
        self.shown = self.word = scene
        self.copy = None
        if is_file(scene):
            self.shown = self.word = os.path.join(a.scenes, "conference", "conference.glb")
        if scene == "conference-192":
            self.copy = tempfile.NamedTemporaryFile(suffix=".glb")
            divided(self.word, self.copy)
            self.word = self.copy.name

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        if self.copy:
            self.copy.close()


def measure(a, stage, case, scene, words, size=None):
    options = ["--size", size or a.size, "--vpls", "0", "--threads", str(a.threads), *words]
    figures = run([a.whitted, stage.word, *options, "--compare", "--runs", str(a.runs), "--quiet", "--json", "-"])
    exact, chosen, error = figures["exact"], figures["mode_run"], figures["error"]
    return {"case": case, "scene": scene, "lights": figures["punctual_lights"], "width": figures["width"],
            "height": figures["height"], "mode": figures["mode"], "tolerance": figures.get("tolerance"),
            "certainty": figures.get("certainty"), "asked": chosen["rays_asked"], "traced": chosen["rays_traced"],
            "tested": chosen["rays_traced"] / max(1, chosen["rays_asked"]), "exact_s": exact["frame_s"],
            "exact_shade_s": exact["shade_s"], "mode_s": chosen["frame_s"], "mode_shade_s": chosen["shade_s"],
            "faster": figures["speedup"]["frame"], "faster_min": figures["speedup"]["frame_min"],
            "faster_max": figures["speedup"]["frame_max"], "mean_error": error["mean_relative"],
            "max_error": error["max_relative"], "l_inf": error["l_inf"], "p999": error["p999"],
            "command": public(a, [a.whitted, stage.shown if not stage.copy else "(its copy)", *options])}


def adaptive(t, c):
    return ["--visibility", "adaptive", "--tolerance", f"{t:g}", "--certainty", f"{c:g}"]


def percent(x):
    return f"{100 * x:.1f} %"


def figure(a, scene):
    rows, case = [], f"figure/{scene}"
    with Stage(a, scene) as stage:
        rows.append(measure(a, stage, case, scene, adaptive(0, 1)))
        for t in TOLERANCES[1:4:2] if a.quick else TOLERANCES:
            for c in CERTAINTIES:
                rows.append(measure(a, stage, case, scene, adaptive(t, c)))
    shown = [("tested", "tests"), ("mean_error", "mean error"), ("max_error", "largest error"), ("faster", "times faster")]
    print(f"**{scene}**, {rows[0]['lights']} lights, Figure {FIGURES[scene]} of the paper: tests of those that exact "
          "visibility takes, errors, how many times faster the frame is; columns are certainties.\n")
    for column, what in shown:
        columns = [(what, "---:", lambda r: f"{r:g}")]
        for c in CERTAINTIES:
            of = {r["tolerance"]: r[column] for r in rows if r["certainty"] == c or r["tolerance"] == 0}
            columns.append((f"c {c:g}", "---:", lambda t, of=of: f"{of[t]:.2f}x" if column == "faster" else percent(of[t])))
        print(table(columns, sorted({r["tolerance"] for r in rows})), end="\n\n", flush=True)
        if a.plots:
            with open(os.path.join(a.plots, f"{scene}-{column.replace('_', '-')}.svg"), "w") as f:
                f.write(plot(f"{scene}, {rows[0]['lights']} lights", what, rows, column, column.endswith("error")))
    return rows


def lights(a, count):
    rows, scene = [], f"conference-lights-{count}-floating"
    with Stage(a, scene) as stage:
        for mode, words in MODES.items():
            case = f"lights/{count}/{mode}"
            if a.filter.search(case):
                rows.append(measure(a, stage, case, scene, words))
    print(table([("lights", "---:", lambda r: f"{r['lights']:,}"), ("mode", "---", lambda r: r["case"].split("/")[2]),
                 ("rays traced", "---:", lambda r: percent(r["tested"])), ("`l_inf`", "---:", lambda r: percent(r["l_inf"])),
                 ("p99.9", "---:", lambda r: f"{r['p999']:.2f}"),
                 ("exact", "---:", lambda r: f"{r['exact_s']:.3f} s"), ("mode", "---:", lambda r: f"{r['mode_s']:.3f} s"),
                 ("faster", "---:", lambda r: f"{r['faster']:.2f}x ({r['faster_min']:.2f} ... {r['faster_max']:.2f})")], rows),
          end="\n\n", flush=True)
    return rows


def rates(a, scene):
    with Stage(a, scene) as stage:
        rows = [measure(a, stage, f"rates/{scene}/{how}", scene, adaptive(0.2, 0.5) + more)
                for how, more in (("before", []), ("on the way", ["--shared"]))]
    print(table([("scene", "---", lambda r: r["scene"]), ("hit rates learnt", "---", lambda r: r["case"].split("/")[2]),
                 ("tests", "---:", lambda r: percent(r["tested"])), ("mean error", "---:", lambda r: percent(r["mean_error"])),
                 ("largest", "---:", lambda r: percent(r["max_error"])), ("mode", "---:", lambda r: f"{r['mode_s']:.3f} s")],
                rows), end="\n\n", flush=True)
    return rows


def overhead(a, scene):
    with Stage(a, scene) as stage:
        rows = [measure(a, stage, f"overhead/{scene}/{t}", scene, adaptive(float(t), 1)) for t in ("0", "1e-30")]
    print(table([("scene", "---", lambda r: r["scene"]), ("tolerance", "---:", lambda r: r["case"].split("/")[2]),
                 ("tests", "---:", lambda r: percent(r["tested"])), ("largest error", "---:", lambda r: percent(r["max_error"])),
                 ("exact", "---:", lambda r: f"{r['exact_s']:.3f} s"), ("mode", "---:", lambda r: f"{r['mode_s']:.3f} s"),
                 ("mode / exact", "---:", lambda r: f"{1 / r['faster']:.2f}")], rows), end="\n\n", flush=True)
    return rows


def cases():
    yield from (("figure", s) for s in FIGURES)
    yield from (("lights", str(n), m) for n in LIGHTS for m in MODES)
    yield from (("rates", s) for s in ["conference-lights", "conference-lights-192-floating", "conference-lights-diffuse"])
    yield from (("overhead", s) for s in ["conference-lights", "conference-lights-192", "conference-lights-diffuse"])


def main():
    parser = Parser(__doc__)
    parser.add_argument("--plots", metavar="FOLDER", help="an SVG file for each scene and quantity")
    parser.add_argument("--size", default="320x180")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--runs", type=int, default=3, help="pairs of frames")
    a = parser.parse()
    if a.quick:
        a.size, a.runs = "32x18", 1
    chosen = parser.choose(a, cases())
    parser.check_whitted(a)
    if a.plots:
        os.makedirs(a.plots, exist_ok=True)
    kinds = {"figure": figure, "lights": lights, "rates": rates, "overhead": overhead}
    failed = done = 0
    with parser.open_csv(a) as out:
        writer = csv.DictWriter(out, COLUMNS, lineterminator="\n")
        writer.writeheader()
        for group, what in dict.fromkeys((c[0], c[1]) for c in chosen):
            path = os.path.join(a.scenes, "conference", "conference.glb")
            if is_file(what) and not os.path.exists(path):
                print(f"adaptive.py: {group}/{what}: left out, {path} is not there", file=sys.stderr)
                continue
            try:
                writer.writerows(kinds[group](a, what))
                out.flush()
                done += 1
            except Failure as e:
                failed += 1
                print(f"adaptive.py: {group}/{what}: {e}", file=sys.stderr)
    if failed or not done:
        parser.error(f"{failed} cases failed, {done} measured")


if __name__ == "__main__":
    run_main(main)
