#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Shadows of sampled environment maps: the tables of Ben-Artzi et al. 2006, and the grid beside the cache.

    python3 bench/grid.py [--scenes FOLDER] [--filter REGEX] [--csv FILE]

Groups of cases (--list shows all), each for four scenes and three maps:
  rays/SCENE/MAP/LIGHTS/MODE   Table 1: shadow rays traced, and predictions that were wrong
  times/SCENE/MAP/MODE         Table 2: seconds of a frame with 200 lights
  bound/SCENE/MAP/LIGHTS       Table 3: OPT's time against that of tracing its rays and nothing else
  side/SCENE/MAP/METHOD        200 lights: exact, grid, cache and estimate
  paths/SCENE/MAP/METHOD       the same with 16 paths a pixel, on a quarter of the pixels along each axis
  turn/SCENE/MAP/METHOD        how the error changes while the environment turns

FOLDER holds bunny/bunny.glb and hdri/; made ones stand in for what it lacks.
Build first: meson setup build && ninja -C build.
"""
import csv
import json
import math
import os
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True
from scenes import BUILTIN, ROOT, Failure, Parser, public, run, run_main, scene_words, table

SCENES = ["shapes", "bunny", "plant", "dominoes"]
MAPS = {"clusters": "grace-small", "sun": "kloppenheim_05_1k", "uniform": "leadenhall_market_1k"}
LIGHTS = [50, 100, 200, 400]
MODES = ["SWB", "GWB", "GNB", "GWU", "GNU", "OPT", "NEAR"]
TIMED = ["EYE", "TRUE"] + MODES
METHODS = {"grid-OPT": ["--visibility", "grid=OPT"], "grid-NEAR": ["--visibility", "grid=NEAR"],
           "grid-GNU": ["--visibility", "grid=GNU"],
           # C_E of 1 at one path a pixel: next to nothing is shared
           **{f"cache-{x}": ["--visibility", "cache", "--ce-delta", x] for x in ("2", "4", "8")},
           **{f"estimate-{k}": ["--visibility", "estimate", "--select", k] for k in ("8", "24")}}
DENSE = {**{m: METHODS[m] for m in ("grid-OPT", "grid-NEAR", "cache-4", "cache-8")},
         "cache-16": ["--visibility", "cache", "--ce-delta", "16"]}
PATHS = 16  # on a 4 x 4 lattice
TURNED = ["grid-OPT", "grid-NEAR", "grid-GNU", "cache-2", "cache-4", "estimate-24"]
STEP, FRAMES = 3, 12  # degrees between frames
# Table 1, per cent at 50, 100, 200 and 400 lights; Table 2, times faster than TRUE at 200
PAPER_RAYS = {
    "shapes": {"SWB": (40.5, 34.3, 26.3, 22.4), "GWB": (22.0, 17.9, 15.1, 12.4), "GNB": (21.7, 17.1, 13.8, 10.6),
               "GWU": (10.4, 10.7, 11.0, 11.3), "GNU": (9.4, 8.8, 8.3, 7.5), "OPT": (4.8, 4.6, 4.5, 4.3)},
    "bunny": {"SWB": (52.4, 42.6, 33.6, 25.9), "GWB": (21.5, 16.6, 13.5, 11.6), "GNB": (21.2, 15.8, 12.0, 9.3),
              "GWU": (9.1, 9.4, 10.2, 11.5), "GNU": (8.1, 7.7, 7.2, 6.7), "OPT": (4.6, 4.4, 4.1, 3.9)},
    "plant": {"SWB": (63.2, 51.6, 44.3, 39.7), "GWB": (37.8, 34.5, 32.6, 30.5), "GNB": (37.7, 34.6, 32.7, 30.6),
              "GWU": (33.3, 32.4, 32.3, 31.1), "GNU": (35.3, 33.8, 33.4, 31.9), "OPT": (21.4, 20.9, 20.8, 20.2)},
    "dominoes": {"SWB": (54.5, 43.6, 36.0, 28.8), "GWB": (31.6, 28.2, 24.9, 21.8), "GNB": (30.3, 25.7, 21.9, 18.0),
                 "GWU": (20.4, 22.3, 22.2, 22.6), "GNU": (17.3, 16.9, 16.3, 15.3), "OPT": (9.4, 9.2, 9.1, 8.8)}}
PAPER_FASTER = {"shapes": {"SWB": 2.2, "GWB": 3.0, "GNB": 4.5, "GWU": 3.8, "GNU": 6.7, "OPT": 10.5},
                "bunny": {"SWB": 1.5, "GWB": 2.2, "GNB": 3.5, "GWU": 2.6, "GNU": 4.8, "OPT": 7.6},
                "plant": {"SWB": 1.3, "GWB": 1.3, "GNB": 1.6, "GWU": 1.3, "GNU": 1.6, "OPT": 2.6},
                "dominoes": {"SWB": 1.9, "GWB": 2.2, "GNB": 3.5, "GWU": 2.6, "GNU": 5.2, "OPT": 8.5}}
COLUMNS = ["case", "scene", "map", "lights", "mode", "width", "height", "threads", "runs", "asked", "traced", "share",
           "coarse", "silhouette", "uncertain", "flooded", "mispredicted", "l_inf", "p999", "max", "bytes", "exact_s",
           "mode_s", "faster", "faster_min", "faster_max", "exact_visibility_s", "mode_visibility_s", "rays_s", "exact_ns",
           "own_ns", "bound", "reached", "bound_frame", "change", "change_p999", "change_max", "light", "command"]


# ------------------------------------------------------------------------------------------------ what may be lacking

def made_bunny(path):
    """A ball with bumps, folded enough to shade itself, over a floor: two objects."""
    rows = 160

    def point(i, j):
        theta, phi = math.pi * i / rows, math.pi * (j % (2 * rows)) / rows
        x, y, z = math.sin(theta) * math.cos(phi), math.cos(theta), math.sin(theta) * math.sin(phi)
        r = 0.7 + 0.12 * math.sin(3 * x + 1) * math.cos(4 * z) + 0.1 * math.sin(6 * y + 4 * x) + \
            0.02 * math.sin(21 * x) * math.sin(19 * y) * math.sin(23 * z)
        return r * x, r * y + 0.75, r * z

    with open(path, "w") as f:
        f.write("o floor\nv -4 0 -4\nv -4 0 4\nv 4 0 4\nv 4 0 -4\nf 1 2 3 4\no blob\n")
        for i in range(rows + 1):
            for j in range(2 * rows):
                f.write("v %.6f %.6f %.6f\n" % point(i, j))
        for i in range(rows):
            for j in range(2 * rows):
                a, b = 5 + 2 * rows * i + j, 5 + 2 * rows * i + (j + 1) % (2 * rows)
                if i > 0:
                    f.write(f"f {a} {b} {b + 2 * rows}\n")
                if i < rows - 1:
                    f.write(f"f {a} {b + 2 * rows} {a + 2 * rows}\n")


def made_map(path, kind):
    """256 x 128 pixels, Radiance: a sky with clusters of lamps, with a sun, or with clouds alone."""
    lamps = {"clusters": [(0.2, 0.3, 60), (0.22, 0.32, 90), (0.24, 0.3, 60), (0.6, 0.2, 120), (0.62, 0.22, 80)],
             "sun": [(0.4, 0.25, 12000)], "uniform": []}[kind]
    size = 0.004 if kind == "sun" else 0.012

    def radiance(u, v):
        sky = (0.6 if v < 0.5 else 0.15) * (1 + 0.5 * math.sin(12 * u + 5 * v) * math.sin(9 * v))
        lit = sum(power for x, y, power in lamps if abs(u - x) < size and abs(v - y) < 2 * size)
        return sky * 0.9 + lit, sky + 0.95 * lit, sky * 1.2 + 0.8 * lit

    with open(path, "wb") as f:
        f.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 128 +X 256\n")
        for j in range(128):
            for i in range(256):
                c = radiance((i + 0.5) / 256, (j + 0.5) / 128)
                e = math.frexp(max(c))[1]
                f.write(bytes([*(min(255, int(x * 2.0 ** (8 - e))) for x in c), e + 128]))


def map_file(a, name):
    path = os.path.join(a.scenes, "hdri", MAPS[name] + ".hdr")
    if os.path.exists(path):
        return path
    path = os.path.join(a.scratch, name + ".hdr")
    if not os.path.exists(path):
        made_map(path, name)
        print(f"grid.py: {MAPS[name]}.hdr is not there, a made one stands in", file=sys.stderr)
    return path


def words_of(a, scene):
    if scene in BUILTIN:
        return scene_words(a, scene) + ["--camera", "2"]
    words = scene_words(a, scene)
    if os.path.exists(words[0]):
        return words
    path = os.path.join(a.scratch, scene + ".obj")
    if not os.path.exists(path):
        made_bunny(path)
        print(f"grid.py: {words[0]} is not there, a made blob stands in", file=sys.stderr)
    return [path, "--look", "1.6,1.7,2.4,0,0.65,0,44"]


# ----------------------------------------------------------------------------------------------------------- frames

def command(a, scene, name, lights, *more, size=None):
    return [a.whitted, *words_of(a, scene), "--env", map_file(a, name), "--size", size or a.size, "--vpls", "0",
            "--light-samples", "0", "--env-lights", str(lights), "--threads", str(a.threads), *more]


def seen(a, words):
    """The command as a reader would write it."""
    return public(a, [w.replace(os.path.join(a.scratch, ""), "MADE/") for w in words])


def compare(a, case, scene, name, lights, mode, more, runs=1, size=None):
    words = command(a, scene, name, lights, *more, size=size)
    j = run(words + ["--compare", "--runs", str(runs), "--quiet", "--json", "-"])
    exact, chosen, error, faster = j["exact"], j["mode_run"], j["error"], j["speedup"]
    asked = chosen["rays_asked"]
    row = {"case": case, "scene": scene, "map": name, "lights": lights, "mode": mode, "runs": j["runs"],
           "bytes": chosen["cache_bytes"], "asked": asked, "traced": chosen["rays_traced"],
           "share": chosen["rays_traced"] / max(1, asked), "exact_s": exact["frame_s"], "mode_s": chosen["frame_s"],
           "faster": faster["frame"], "faster_min": faster["frame_min"], "faster_max": faster["frame_max"],
           "exact_visibility_s": exact.get("visibility_s"), "mode_visibility_s": chosen.get("visibility_s"),
           "rays_s": chosen.get("rays_s"), "command": seen(a, words)}
    row.update({k: j[k] for k in ("width", "height", "threads")})
    row.update({k: error[k] for k in ("mispredicted", "l_inf", "p999", "max")})
    row.update({k: chosen.get("rays_" + k) for k in ("coarse", "silhouette", "uncertain", "flooded")})
    return row


def rays(a, scene, name, lights, mode):
    return compare(a, f"rays/{scene}/{name}/{lights}/{mode}", scene, name, int(lights), mode, ["--visibility", f"grid={mode}"])


def times(a, scene, name, mode):
    return compare(a, f"times/{scene}/{name}/{mode}", scene, name, a.lights, mode, ["--visibility", f"grid={mode}"], a.runs)


def bound(a, scene, name, lights):
    """The bound: OPT's rays and nothing else, at what they cost. Of several pairs that in the middle of them."""
    rows = []
    for _ in range(a.runs):
        row = compare(a, f"bound/{scene}/{name}/{lights}", scene, name, int(lights), "OPT", ["--visibility", "grid=OPT"])
        row["exact_ns"] = 1e9 * row["exact_visibility_s"] / max(1, row["asked"]) * a.threads
        row["own_ns"] = 1e9 * row["rays_s"] / max(1, row["traced"]) * a.threads
        row["bound"] = row["exact_visibility_s"] / row["rays_s"]
        row["reached"] = row["rays_s"] / row["mode_visibility_s"]
        row["bound_frame"] = row["exact_s"] / (row["mode_s"] - row["mode_visibility_s"] + row["rays_s"])
        rows.append(row)
    return sorted(rows, key=lambda r: r["reached"])[len(rows) // 2]


def side(a, scene, name, method):
    return compare(a, f"side/{scene}/{name}/{method}", scene, name, a.lights, method, METHODS[method], a.runs)


def paths(a, scene, name, method):
    size = "x".join(str((int(n) + 3) // 4) for n in a.size.split("x"))
    return compare(a, f"paths/{scene}/{name}/{method}", scene, name, a.lights, method, ["--spp", str(PATHS), *DENSE[method]],
                   a.runs, size)


def turn(a, scene, name, method):
    """Frames of a turning environment, exact and by the method, and how their difference changes."""
    exact = os.path.join(a.scratch, f"{scene}-{name}-")
    for old in os.listdir(a.scratch):  # a place's exact frames serve all its methods, and no other place
        if old.endswith(".exr") and not old.startswith(os.path.basename(exact)):
            os.remove(os.path.join(a.scratch, old))
    files = []
    for i in range(a.frames):
        files += [f"{exact}{i}.exr", os.path.join(a.scratch, f"mode-{i}.exr")]
        for path, how in zip(files[-2:], (["--visibility", "exact"], METHODS[method])):
            if not os.path.exists(path):
                run(command(a, scene, name, a.lights, "--env-rotate", f"{STEP * i}", *how, "-o", path, "--quiet", "--json", "-"))
    done = subprocess.run([a.flicker, *files], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise Failure(done.stderr.strip())
    j = json.loads(done.stdout)
    words = command(a, scene, name, a.lights, *METHODS[method], "--env-rotate", f"0 ... {STEP * (a.frames - 1)}")
    return {"case": f"turn/{scene}/{name}/{method}", "scene": scene, "map": name, "lights": a.lights, "mode": method,
            "l_inf": j["error"], "max": j["error_max"], **{k: j[k] for k in ("change", "change_p999", "change_max", "light")},
            "command": seen(a, words)}


# ----------------------------------------------------------------------------------------------------------- tables

def percent(x, digits=2):
    return "-" if x is None else f"{100 * x:.{digits}f} %"


def ms(x):
    return f"{1000 * x:.0f} ms" if x < 1 else f"{x:.2f} s"


WHERE = [("scene", "---", lambda r: r["scene"]), ("map", "---", lambda r: r["map"])]
ERRORS = [("mispredicted", "---:", lambda r: percent(r["mispredicted"], 4)), ("`l_inf`", "---:", lambda r: percent(r["l_inf"], 4)),
          ("p99.9", "---:", lambda r: f"{r['p999']:.3f}")]
FASTER = ("faster", "---:", lambda r: f"{r['faster']:.2f}x ({r['faster_min']:.2f} ... {r['faster_max']:.2f})")


def rays_report(rows):
    """A row for each scene, map and mode, side by side what belongs to each number of lights."""
    grouped = {}
    for r in rows:
        grouped.setdefault((r["scene"], r["map"], r["mode"]), {})[r["lights"]] = r
    lights = sorted({r["lights"] for r in rows})

    def several(key, digits):
        return lambda g: " / ".join(f"{100 * g[n][key]:.{digits}f}" if n in g and g[n][key] is not None else "-" for n in lights)

    def first(g):
        return next(iter(g.values()))

    def paper(g):
        known = PAPER_RAYS[first(g)["scene"]].get(first(g)["mode"])
        return " / ".join(str(known[LIGHTS.index(n)]) if known and n in LIGHTS else "-" for n in lights)

    at = ", ".join(map(str, lights))
    return table([("scene", "---", lambda g: first(g)["scene"]), ("map", "---", lambda g: first(g)["map"]),
                  ("mode", "---", lambda g: first(g)["mode"]), (f"% of rays traced, {at} lights", "---:", several("share", 1)),
                  ("the paper's", "---:", paper), ("% mispredicted", "---:", several("mispredicted", 4)),
                  ("`l_inf`, %", "---:", several("l_inf", 4))], list(grouped.values()))


def report(group, rows):
    if group == "rays":
        print(rays_report(rows), end="\n\n", flush=True)
        return
    columns = {
        "times": WHERE + [("mode", "---", lambda r: r["mode"]), ("exact", "---:", lambda r: ms(r["exact_s"])),
                          ("mode's", "---:", lambda r: ms(r["mode_s"])), FASTER,
                          ("the paper's", "---:", lambda r: str(PAPER_FASTER[r["scene"]].get(r["mode"], "-"))),
                          ("memory", "---:", lambda r: f"{r['bytes'] / 2 ** 20:.2f} MiB")],
        "bound": WHERE + [("lights", "---:", lambda r: str(r["lights"])),
                          ("exact's visibility", "---:", lambda r: ms(r["exact_visibility_s"])),
                          ("OPT's", "---:", lambda r: ms(r["mode_visibility_s"])),
                          ("faster", "---:", lambda r: f"{r['exact_visibility_s'] / r['mode_visibility_s']:.2f}x"),
                          ("by rays", "---:", lambda r: f"{1 / max(1e-9, r['share']):.2f}x"),
                          ("ns a ray, exact", "---:", lambda r: f"{r['exact_ns']:.0f}"),
                          ("of OPT's", "---:", lambda r: f"{r['own_ns']:.0f}"),
                          ("bound", "---:", lambda r: f"{r['bound']:.2f}x"), ("reached", "---:", lambda r: percent(r["reached"], 0)),
                          ("frame", "---:", lambda r: f"{r['faster']:.2f}x of {r['bound_frame']:.2f}x")],
        "side": WHERE + [("method", "---", lambda r: r["mode"]), ("rays traced", "---:", lambda r: percent(r["share"], 1))] +
        ERRORS + [("exact", "---:", lambda r: ms(r["exact_s"])), ("method's", "---:", lambda r: ms(r["mode_s"])), FASTER,
                  ("memory", "---:", lambda r: f"{r['bytes'] / 2 ** 20:.2f} MiB")],
        "turn": WHERE + [("method", "---", lambda r: r["mode"]), ("error", "---:", lambda r: percent(r["l_inf"], 4)),
                         ("its change", "---:", lambda r: percent(r["change"], 4)),
                         ("p99.9 of a pixel", "---:", lambda r: f"{r['change_p999']:.4f}"),
                         ("largest", "---:", lambda r: f"{r['change_max']:.2f}"),
                         ("light's own change", "---:", lambda r: percent(r["light"], 1))]}
    columns["paths"] = columns["side"]
    columns = columns[group]
    print(table(columns, rows), end="\n\n", flush=True)


def cases():
    places = [(s, m) for m in MAPS for s in SCENES]
    for p in places:
        yield from (("rays", *p, str(n), mode) for mode in ["TRUE"] + MODES for n in LIGHTS)
    for p in places:
        yield from (("times", *p, mode) for mode in TIMED)
    for p in places:
        yield from (("bound", *p, n) for n in ("200", "400"))
    for p in places:
        yield from (("side", *p, m) for m in METHODS)
    for p in places:
        yield from (("paths", *p, m) for m in DENSE)
    for p in places:
        yield from (("turn", *p, m) for m in TURNED)


def main():
    parser = Parser(__doc__)
    parser.add_argument("--flicker", default=os.path.join(ROOT, "build", "bench", "flicker"))
    parser.add_argument("--size", default="513x513")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--runs", type=int, default=3, help="pairs of timed frames")
    a = parser.parse()
    a.lights, a.frames = (24, 2) if a.quick else (200, FRAMES)
    if a.quick:
        a.size, a.runs = "49x49", 1
    chosen = parser.choose(a, cases())
    parser.check_whitted(a)
    kinds = {"rays": rays, "times": times, "bound": bound, "side": side, "paths": paths, "turn": turn}
    failed = done = 0
    with parser.open_csv(a) as out, tempfile.TemporaryDirectory() as a.scratch:
        writer = csv.DictWriter(out, COLUMNS, lineterminator="\n")
        writer.writeheader()
        for group in kinds:
            rows = []
            for case in (c for c in chosen if c[0] == group):
                try:
                    rows.append(kinds[group](a, *case[1:]))
                except Failure as e:
                    failed += 1
                    print(f"grid.py: {'/'.join(case)}: {e}", file=sys.stderr)
                    continue
                writer.writerow(rows[-1])
                out.flush()
                done += 1
            if rows:
                report(group, rows)
    if failed or not done:
        parser.error(f"{failed} cases failed, {done} measured")


if __name__ == "__main__":
    run_main(main)
