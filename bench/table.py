#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whole frames, exact against cached, on the real scenes: prints a Markdown table and keeps the figures as CSV.

    python3 bench/table.py [--scenes FOLDER] [--runs N] [--readme README.md]

FOLDER holds NAME/NAME.glb and hdri/living-room-sky.exr. Build first: meson setup build && ninja -C build.
"""
import argparse
import csv
import json
import os
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SCENES = ["kitchen", "conference", "breakfast", "living-room"]
SETTINGS = [("640x360", 1, 8), ("320x180", 16, 32)]
ENVIRONMENTS = {"living-room": "hdri/living-room-sky.exr"}
COLUMNS = ["scene", "triangles", "width", "height", "spp", "ce", "threads", "runs", "rays_asked", "rays_traced",
           "exact_frame_s", "cache_frame_s", "frame", "frame_min", "frame_max", "shade", "l_inf", "l_inf_whole",
           "rel_mse", "p999", "max", "mispredicted"]


def measure(arguments, scene, size, spp, ce):
    command = [arguments.whitted, os.path.join(arguments.scenes, scene, scene + ".glb"), "--size", size, "--spp",
               str(spp), "--ce", str(ce), "--threads", "1", "--compare", "--runs", str(arguments.runs), "--quiet",
               "--json", "-"]
    if scene in ENVIRONMENTS:
        command += ["--env", os.path.join(arguments.scenes, ENVIRONMENTS[scene])]
    print(" ".join(command), file=sys.stderr)
    j = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    row = {key: j[key] for key in ("scene", "triangles", "width", "height", "spp", "ce", "threads", "runs")}
    row.update({key: j["mode_run"][key] for key in ("rays_asked", "rays_traced")})
    row.update(exact_frame_s=j["exact"]["frame_s"], cache_frame_s=j["mode_run"]["frame_s"])
    row.update({key: j["speedup"][key] for key in ("frame", "frame_min", "frame_max", "shade")})
    row.update(j["error"])
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default=os.path.join(ROOT, "..", "shared", "scenes"))
    parser.add_argument("--whitted", default=os.path.join(ROOT, "build", "renderers", "whitted", "whitted"))
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--csv", default=os.path.join(ROOT, "bench", "results", "whitted.csv"))
    parser.add_argument("--readme", help="replace the table in this file as well")
    arguments = parser.parse_args()
    scenes = [s for s in SCENES if os.path.exists(os.path.join(arguments.scenes, s, s + ".glb"))]
    if not scenes:
        sys.exit(f"{arguments.scenes}: none of {', '.join(SCENES)} found")

    os.makedirs(os.path.dirname(os.path.abspath(arguments.csv)), exist_ok=True)
    rows = [measure(arguments, s, *setting) for setting in SETTINGS for s in scenes]
    with open(arguments.csv, "w", newline="") as out:
        writer = csv.DictWriter(out, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)

    lines = ["| scene | triangles | setting | rays traced | `l_inf` | p99.9 | mispredicted | exact | cached | faster |",
             "| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"]
    for r in rows:
        lines.append(
            f"| {r['scene']} | {r['triangles']:,.0f} | {r['width']:.0f}x{r['height']:.0f}, {r['spp']:.0f} spp, "
            f"C_E {r['ce']:g} | {100 * r['rays_traced'] / r['rays_asked']:.1f} % | {100 * r['l_inf']:.2f} % | "
            f"{r['p999']:.2f} | {100 * r['mispredicted']:.1f} % | {r['exact_frame_s']:.2f} s | "
            f"{r['cache_frame_s']:.2f} s | {r['frame']:.2f}x ({r['frame_min']:.2f} ... {r['frame_max']:.2f}) |")
    table = "\n".join(lines)
    print(table)
    if arguments.readme:
        with open(arguments.readme) as f:
            text = f.read()
        head, rest = text.split("<!-- table: python3 bench/table.py -->\n", 1)
        tail = rest[rest.index("<!-- end of table -->"):]
        with open(arguments.readme, "w") as f:
            f.write(head + "<!-- table: python3 bench/table.py -->\n" + table + "\n" + tail)


if __name__ == "__main__":
    main()
