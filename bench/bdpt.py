#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Bidirectional path tracing, exact connections against cached and estimated ones: prints Markdown tables.

    python3 bench/bdpt.py [--scenes FOLDER] [--filter REGEX] [--references FOLDER] [--csv FILE]

Groups of cases (--list shows all):
  rays/SCENE/MODE     times, rays and difference to exact connections of the same paths; the noise of the exact image for
                      comparison (difference of two seeds)
  depth/SCENE/N       the plain cache's difference in paths of N edges alone
  gloss/SCENE/R       the same with every opaque material of the scene given roughness R
  partners/SCENE/M    exact and cached connections of each eye path to M light paths
  time/SCENE/MODE     error against a converged image of another seed over the seconds of a frame

FOLDER holds NAME/NAME.glb and hdri/. Build first: meson setup build && ninja -C build.
"""
import csv
import os
import sys
import tempfile

sys.dont_write_bytecode = True
import glb
from scenes import ROOT, Failure, Parser, missing_file, public, run, run_main, scene_words, table

SCENES = ["cornell", "kitchen", "living-room", "conference", "san-miguel"]
MODES = ["cache", "estimate"]
DEPTHS = [2, 3, 4, 5, 6]
GLOSS = ["1", "0.6", "0.4", "0.25", "0.15"]
PARTNERS = [1, 2, 4, 8, 16]
PATHS = [1, 2, 4, 8, 16, 32, 64, 128, 256]
COLUMNS = ["case", "scene", "mode", "spp", "epoch", "edges", "ce", "trace", "exact_s", "exact_visibility_s", "mode_s",
           "mode_visibility_s", "faster", "exact_rel_mse", "partners", "roughness", "asked", "traced", "share", "l_inf", "noise", "rel_mse", "command"]


def command(a, scene, spp, *more):
    return [a.bdpt, *scene_words(a, scene), "--size", a.size, "--spp", str(spp), "--threads", str(a.threads), *more]


def pair(a, scene, spp, *more):
    """Exact and chosen visibility of the same paths."""
    return run(command(a, scene, spp, "--compare", "--runs", str(a.runs), "--quiet", "--json", "-", *more))


def image(a, name):
    return os.path.join(a.references, name + ".exr")


def against(words, reference):
    figures = run(words + ["--reference", reference, "--quiet", "--json", "-"])
    return figures["mode_run"]["frame_s"], figures["reference"]["mode_run"]


def noise(a, scene, spp, known={}):
    """l_inf of two exact images of different seeds: what their difference is without any bias."""
    if scene in known:
        return known[scene]
    other = image(a, f"{scene}-{a.size}-{spp}spp-seed1")
    exact = command(a, scene, spp, "--visibility", "exact")
    run(exact + ["--seed", "1", "-o", other, "--quiet", "--json", "-"])
    known[scene] = against(exact + ["--seed", "2"], other)[1]["l_inf"]
    return known[scene]


def row_of(a, case, scene, mode, figures, words):
    exact, chosen, error = figures["exact"], figures["mode_run"], figures["error"]
    return {"case": case, "scene": scene, "mode": mode, "spp": figures["spp"], "epoch": figures["epoch"],
            "edges": figures["edges"], "partners": figures["partners"], "ce": figures["ce"], "trace": figures["trace"], "exact_s": exact["frame_s"],
            "exact_visibility_s": exact["shade_s"], "mode_s": chosen["frame_s"], "mode_visibility_s": chosen["shade_s"],
            "faster": figures["speedup"]["frame"], "asked": chosen["rays_asked"], "traced": chosen["rays_traced"],
            "share": chosen["rays_traced"] / max(1, chosen["rays_asked"]), "l_inf": error["l_inf"],
            "rel_mse": error["rel_mse"], "command": public(a, words).replace("whitted", "bdpt", 1)}


def rays(a, scene, mode):
    words = ["--visibility", mode, "--epoch", str(a.spp)]
    row = row_of(a, f"rays/{scene}/{mode}", scene, mode, pair(a, scene, a.spp, *words), command(a, scene, a.spp, *words))
    row["noise"] = noise(a, scene, a.spp)
    return [row]


def depth(a, scene, edges):
    words = ["--visibility", "cache", "--epoch", str(a.spp), "--edges", edges]
    row = row_of(a, f"depth/{scene}/{edges}", scene, "cache", pair(a, scene, a.spp, *words),
                 command(a, scene, a.spp, *words))
    return [row]


def with_roughness(source, roughness, out):
    """A copy of a .glb whose opaque materials all have this roughness."""
    scene, rest = glb.read(source)
    for m in scene.get("materials", []):
        if "KHR_materials_transmission" in m.get("extensions", {}):
            continue
        pbr = m.setdefault("pbrMetallicRoughness", {})
        pbr["roughnessFactor"] = roughness
        pbr.pop("metallicRoughnessTexture", None)
    glb.write(out, scene, rest)


def gloss(a, scene, roughness):
    words = ["--visibility", "cache", "--epoch", str(a.spp)]
    shown = command(a, scene, a.spp, *words)
    with tempfile.NamedTemporaryFile(suffix=".glb") as copy:
        source = shown[1]
        with_roughness(source, float(roughness), copy)
        row = row_of(a, f"gloss/{scene}/{roughness}", scene, "cache",
                     run([copy.name if w == source else w for w in shown] +
                         ["--compare", "--runs", str(a.runs), "--quiet", "--json", "-"]), shown)
    row["roughness"] = roughness
    row["command"] = ""  # of a copy of the scene
    return [row]


def reference(a, scene):
    path = image(a, f"{scene}-{a.size}-{a.reference_spp}spp-seed99")
    if not os.path.exists(path):
        run(command(a, scene, a.reference_spp, "--visibility", "exact", "--seed", "99", "-o", path, "--quiet", "--json", "-"))
    return path


def partners(a, scene, count):
    words = ["--visibility", "cache", "--epoch", str(a.spp), "--partners", count]
    row = row_of(a, f"partners/{scene}/{count}", scene, "cache", pair(a, scene, a.spp, *words),
                 command(a, scene, a.spp, *words))
    exact = command(a, scene, a.spp, "--visibility", "exact", "--partners", count)
    row["exact_rel_mse"] = against(exact, reference(a, scene))[1]["rel_mse"]
    return [row]


def over_time(a, scene, mode):
    rows, converged = [], reference(a, scene)
    for spp in PATHS[:2] if a.quick else PATHS:
        if spp * 16 > a.reference_spp:
            break
        words = command(a, scene, spp, "--visibility", mode)
        seconds, error = against(words, converged)
        rows.append({"case": f"time/{scene}/{mode}", "scene": scene, "mode": mode, "spp": spp, "mode_s": seconds,
                     "rel_mse": error["rel_mse"], "l_inf": error["l_inf"],
                     "command": public(a, words).replace("whitted", "bdpt", 1)})
    return rows


def percent(x):
    return f"{100 * x:.2f} %"


def report(group, rows):
    if group == "rays":
        columns = [("scene", "---", lambda r: r["scene"]), ("mode", "---", lambda r: r["mode"]),
                   ("connections", "---:", lambda r: f"{r['asked']:,.0f}"),
                   ("rays traced", "---:", lambda r: percent(r["share"])),
                   ("`l_inf`", "---:", lambda r: percent(r["l_inf"])), ("noise", "---:", lambda r: percent(r["noise"])),
                   ("exact", "---:", lambda r: f"{r['exact_s']:.2f} s"),
                   ("of it visibility", "---:", lambda r: f"{r['exact_visibility_s']:.2f} s"),
                   ("mode", "---:", lambda r: f"{r['mode_s']:.2f} s"),
                   ("of it visibility", "---:", lambda r: f"{r['mode_visibility_s']:.2f} s"),
                   ("faster", "---:", lambda r: f"{r['faster']:.2f}x"),
                   ("limit", "---:", lambda r: f"{r['exact_s'] / (r['exact_s'] - r['exact_visibility_s']):.2f}x")]
    elif group == "time":
        columns = [("scene", "---", lambda r: r["scene"]), ("mode", "---", lambda r: r["mode"]),
                   ("paths", "---:", lambda r: str(r["spp"])), ("seconds", "---:", lambda r: f"{r['mode_s']:.2f}"),
                   ("relMSE", "---:", lambda r: f"{r['rel_mse']:.3g}"), ("`l_inf`", "---:", lambda r: percent(r["l_inf"]))]
    else:
        what = {"depth": "edges", "gloss": "roughness", "partners": "partners"}[group]
        columns = [("scene", "---", lambda r: r["scene"]), (what, "---:", lambda r: str(r[what])),
                   ("rays traced", "---:", lambda r: percent(r["share"])), ("`l_inf`", "---:", lambda r: percent(r["l_inf"])),
                   ("relMSE", "---:", lambda r: f"{r['rel_mse']:.2g}")]
        if group == "partners":
            one = {r["scene"]: r["exact_s"] * r["exact_rel_mse"] for r in reversed(rows)}
            columns += [("exact's relMSE", "---:", lambda r: f"{r['exact_rel_mse']:.3g}"),
                        ("times seconds", "---:", lambda r: f"{r['exact_s'] * r['exact_rel_mse'] / one[r['scene']]:.2f}"),
                        ("exact", "---:", lambda r: f"{r['exact_s']:.2f} s"), ("cache", "---:", lambda r: f"{r['mode_s']:.2f} s"),
                        ("faster", "---:", lambda r: f"{r['faster']:.2f}x")]
    print(table(columns, rows), end="\n\n", flush=True)


def cases():
    for s in SCENES:
        yield from (("rays", s, m) for m in MODES)
    for s in SCENES:
        yield from (("depth", s, str(n)) for n in DEPTHS)
    for s in ["kitchen", "conference"]:
        yield from (("gloss", s, r) for r in GLOSS)
    for s in SCENES:
        yield from (("partners", s, str(m)) for m in PARTNERS)
    for s in SCENES:
        yield from (("time", s, m) for m in ["exact"] + MODES)


def main():
    parser = Parser(__doc__)
    parser.add_argument("--bdpt", default=os.path.join(ROOT, "build", "renderers", "bdpt", "bdpt"))
    parser.add_argument("--references", metavar="FOLDER", default=os.path.join(ROOT, "out", "references"),
                        help="where images to compare with are kept")
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--size", default="320x180")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--runs", type=int, default=3, help="pairs of frames")
    a = parser.parse()
    if a.quick:
        a.size, a.spp, a.runs, a.reference_spp = "48x32", 2, 1, 32
    chosen = parser.choose(a, cases())
    if not os.access(a.bdpt, os.X_OK):
        parser.error(f"{a.bdpt}: not there; meson setup build && ninja -C build")
    os.makedirs(a.references, exist_ok=True)
    kinds = {"rays": rays, "depth": depth, "gloss": gloss, "partners": partners, "time": over_time}
    failed = done = 0
    with parser.open_csv(a) as out:
        writer = csv.DictWriter(out, COLUMNS, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        for group in kinds:
            rows = []
            for _, scene, what in (c for c in chosen if c[0] == group):
                lacking = missing_file(a, scene)
                if lacking:
                    print(f"bdpt.py: {scene}: left out, {lacking} is not there", file=sys.stderr)
                    continue
                try:
                    found = kinds[group](a, scene, what)
                except Failure as e:
                    failed += 1
                    print(f"bdpt.py: {group}/{scene}/{what}: {e}", file=sys.stderr)
                    continue
                writer.writerows(found)
                out.flush()
                rows += found
                done += 1
            if rows:
                report(group, rows)
    if failed or not done:
        parser.error(f"{failed} cases failed, {done} measured")


if __name__ == "__main__":
    run_main(main)
