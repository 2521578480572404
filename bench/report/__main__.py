#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Speed against error: renders scenes by every method and writes a page, plots and figures.

    ./report [--quick] [--scenes FOLDER] [--out FOLDER] [--only SECTION]

OUT/index.html is the page (all within one file), OUT/plots/*.svg and OUT/pictures/*.png its parts, OUT/figures.md its
words and tables, OUT/rows.csv and rows.json all figures. Cases run one after another; OUT/rows.jsonl keeps a row of
each, so that an interrupted report goes on where it was when it is started again, and what a changed program or command
made is rendered anew.

FOLDER of scenes holds NAME/NAME.glb and hdri/; where there is none, built-in scenes alone are rendered. Sections:
  curves     speed against error of all methods, by scene (and the table at the top)
  lights     speed and error over C_E by kind of light
  converged  error against the converged image over time
  pictures   where images are wrong, and how it looks; of the images of `curves`
  flicker    how errors change while camera or lights move
  edges      where the edges of hard shadows go, and how ragged they are
  maps       plain shadow maps beside the cache's frames of `lights`
  clusters   which answers of the cache are wrong, and how far from a shadow's edge (Sect. 5.1)
  parameters C_N, C_Z, C_R, refinement, memory, hashes: one at a time around the defaults
  seeing     what one sees where something is wrong, which option mends it, what that costs; also OUT/seeing.md
"""
import csv
import datetime
import json
import os
import platform
import re
import signal
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from report import (clusters, converged, curves, edges, flicker, headline, lights, made, parameters, pictures, seen,
                    shadow_maps)
from report.cases import ALL, present
from report.cases_hard import HARD
from report.levels import LEVELS
from report.markdown import document, fill
from report.methods import add_points
from report.page import page
from report.runner import Programs, Rows, run_all
from scenes import ROOT, Failure, Parser, is_builtin, missing_file, run_main

# Anchor; module with TITLE and section(a, rows), which gives HTML; whose rows it shows (labels["section"] of cases.py).
SECTIONS = [("headline", headline, "curves"), ("curves", curves, "curves"), ("lights", lights, "lights"),
            ("converged", converged, "converged"), ("pictures", pictures, "pictures"), ("maps", shadow_maps, "maps"),
            ("flicker", flicker, "flicker"), ("edges", edges, "edges"), ("clusters", clusters, "clusters"),
            ("parameters", parameters, "parameters"), ("seeing", seen, "seeing")]
# Programs of their own, which lie beside zoom.
BESIDE = ["shadow_maps", "sequence", "edges", "clusters"]


def parse():
    parser = Parser(__doc__, csv=False)
    parser.prog = "report"
    parser.add_argument("--bdpt", default=os.path.join(ROOT, "build", "renderers", "bdpt", "bdpt"))
    parser.add_argument("--zoom", default=os.path.join(ROOT, "build", "bench", "zoom"))
    parser.add_argument("--out", help="folder to write (default: out/report, out/report-quick)")
    parser.add_argument("--only", metavar="SECTION", help="cases of one section alone")
    parser.add_argument("--threads", type=int, default=1, help="of each renderer, which run one at a time (default 1)")
    parser.add_argument("--runs", type=int, help="pairs of frames, of which medians are taken (default 1)")
    parser.add_argument("--fill", action="append", default=[], metavar="FILE",
                        help="a document whose sections stand between <!-- report: NAME --> and <!-- end of report -->")
    parser.add_argument("--tiny", action="store_true", help="smaller still than --quick: does the report work?")
    a = parser.parse()
    if not 0 <= a.threads <= 1024:
        parser.error(f"--threads takes 0 ... 1024, not {a.threads}")
    if a.runs is not None and not 1 <= a.runs <= 99:
        parser.error(f"--runs takes 1 ... 99, not {a.runs}")
    sections = list(dict.fromkeys(s for _, _, s in SECTIONS))
    if a.only is not None and a.only not in sections:
        parser.error(f"--only takes {', '.join(sections)}, not {a.only or 'nothing'}")
    for path in a.fill:  # before hours of measuring
        if not os.access(path, os.R_OK | os.W_OK):
            parser.error(f"--fill {path}: cannot be read and written")
    a.level_name = "tiny" if a.tiny else "quick" if a.quick else "full"
    a.level = LEVELS[a.level_name]
    a.level.runs = a.runs or a.level.runs
    a.out = a.out or os.path.join(ROOT, "out", "report" if a.level_name == "full" else f"report-{a.level_name}")
    a.scenes, a.out = (os.path.abspath(f) for f in (a.scenes, a.out))
    a.quiet = False
    a.programs = {p: os.path.abspath(getattr(a, p)) for p in ("whitted", "bdpt", "zoom")}
    a.programs.update({p: os.path.join(os.path.dirname(a.programs["zoom"]), p) for p in BESIDE})
    for program in a.programs.values():
        if not os.access(program, os.X_OK):
            parser.error(f"{program}: not there; meson setup build && ninja -C build")
    return parser, a


def machine():
    """The processor, as it calls itself, and its widest vectors, as names may say little."""
    try:
        with open("/proc/cpuinfo") as f:
            lines = dict(line.split(":", 1) for line in f if ":" in line)
        model = next(v.strip() for k, v in lines.items() if k.strip() == "model name")
        flags = next((v.split() for k, v in lines.items() if k.strip() == "flags"), [])
        model += next((f", {words}" for flag, words in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags), "")
    except (OSError, StopIteration):
        model = platform.processor() or platform.machine()
    return f"{model}, {os.cpu_count()} CPUs"


def written(a, programs):
    """The day, and by which programs."""
    with open(os.path.join(ROOT, "meson.build")) as f:
        version = re.search(r"version: '([\d.]+)'", f.read()).group(1)
    return f"Written on {datetime.date.today()} by the report of vcache {version} from programs with SHA-256 " + \
        ", ".join(f"{programs.digest(p)[:8]}... ({p})" for p in ("whitted", "bdpt"))


def find_scenes(parser, a):
    usual = a.scenes == os.path.abspath(parser.get_default("scenes"))
    if not any(not missing_file(a, s) for s in LEVELS["full"].scenes if not is_builtin(s)):
        if not usual:
            parser.error(f"--scenes {a.scenes}: no scene NAME/NAME.glb in it")
        print("report: no folder of scenes (--scenes FOLDER): built-in scenes alone", file=sys.stderr)
    a.present = lambda scenes: present(a, scenes)


def open_folder(parser, a):
    """What is written into."""
    try:
        for folder in ("plots", "pictures", "images", "made"):
            os.makedirs(os.path.join(a.out, folder), exist_ok=True)
        with open(os.path.join(a.out, "rows.jsonl"), "ab"):
            pass
    except OSError as e:
        parser.error(f"--out {a.out}: {e.strerror}")
    a.machine = machine()
    made.make(a, a.level)


def flat(value, prefix=""):
    if isinstance(value, dict):
        return {k: v for key, inner in value.items() for k, v in flat(inner, f"{prefix}{key}.").items()}
    return {prefix[:-1]: " ".join(map(str, value)) if isinstance(value, list) else value}


def write(a, rows):
    """Page and figures from what rows there are."""
    add_points(rows)
    sections = [(anchor, module.TITLE, module.section(a, rows)) for anchor, module, of in SECTIONS
                if any(r["labels"]["section"] == of for r in rows.values())]
    with open(os.path.join(a.out, "rows.json"), "w") as f:
        json.dump(list(rows.values()), f, indent=1)
    lines = [flat(r) for r in rows.values()]
    with open(os.path.join(a.out, "rows.csv"), "w", newline="") as f:
        writer = csv.DictWriter(f, list(dict.fromkeys(k for line in lines for k in line)), lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)
    path = os.path.join(a.out, "index.html")
    with open(path + ".part", "w") as f:
        f.write(page(a, sections))
    os.replace(path + ".part", path)
    with open(os.path.join(a.out, "figures.md"), "w") as f:
        f.write(document(a, sections))
    for path_of in a.fill:
        fill(path_of, sections)
    return path


def main():
    parser, a = parse()
    find_scenes(parser, a)
    cases = [c for generate in ALL + HARD for c in generate(a, a.level)]
    chosen = [c for c in cases if a.filter.search(c.id) and a.only in (None, c.labels["section"])]
    if a.list:
        print("\n".join(c.id for c in chosen))
        return
    if not chosen:
        parser.error(f"--filter '{a.filter.pattern}' matches no case; --list shows them")
    open_folder(parser, a)
    programs = Programs(a.programs)
    a.written = written(a, programs)
    try:
        rows = Rows(a, programs, cases)
    except Failure as e:
        parser.error(str(e))
    interrupted, failed = False, []
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        failed = run_all(a, programs, chosen, rows)
    except KeyboardInterrupt:
        interrupted = True
    valid = {c.id: rows.get(c) for c in cases}
    valid = {i: r for i, r in valid.items() if r}
    try:
        print(write(a, valid))
    except (Failure, OSError) as e:
        parser.error(str(e))
    if interrupted:
        done = sum(c.id in valid for c in chosen)
        print(f"report: interrupted; {done} of {len(chosen)} cases are done and kept: the same command goes on",
              file=sys.stderr)
        sys.exit(130)
    if failed:
        parser.error(f"{len(failed)} cases failed; the same command tries them again")


if __name__ == "__main__":
    run_main(main)
