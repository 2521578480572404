# SPDX-License-Identifier: Apache-2.0
"""What the benchmarks share: where scenes lie and what they need, how programs are run and cases chosen, how tables look."""
import argparse
import json
import os
import re
import shlex
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
BUILTIN = ["atrium", "cornell", "shapes", "dominoes", "plant"]
OF_SCENE = {"living-room": ["--env", "hdri/living-room-sky.exr"],
            "san-miguel": ["--env", "hdri/kloppenheim_05_1k.hdr", "--camera", "4"],
            "hair-straight": ["--env", "hdri/vestibule_1k.hdr"]}


class Failure(Exception):
    pass


def is_builtin(scene):
    return scene in BUILTIN or scene.startswith("conference-lights")


def scene_words(a, scene):
    """The scene on whitted's command line: its file, and the options that belong to it."""
    options = [os.path.join(a.scenes, o) if o.startswith("hdri/") else o for o in OF_SCENE.get(scene, [])]
    return [scene if is_builtin(scene) else os.path.join(a.scenes, scene, scene + ".glb")] + options


def missing_file(a, scene):
    """The path of what this scene lacks, None where all is there."""
    files = [] if is_builtin(scene) else [f"{scene}/{scene}.glb"]
    files += [o for o in OF_SCENE.get(scene, []) if o.startswith("hdri/")]
    lacking = next((f for f in files if not os.path.exists(os.path.join(a.scenes, f))), None)
    return lacking and os.path.join(a.scenes, lacking)


def run(command):
    """What a command writes as JSON."""
    print(shlex.join(command), file=sys.stderr, flush=True)
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines()
        raise Failure(lines[-1] if lines else f"{command[0]} ended with status {done.returncode}")
    return json.loads(done.stdout)


def public(a, command):
    """A command of whitted with nothing of this machine's folders."""
    return shlex.join(["whitted"] + [w.replace(os.path.join(a.scenes, ""), "SCENES/") for w in command[1:]])


def table(columns, rows):
    """Markdown; a column is (head, alignment, text of a row)."""
    lines = [[c[0] for c in columns], [c[1] for c in columns]] + [[c[2](r) for c in columns] for r in rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


class Parser(argparse.ArgumentParser):
    """With the options of all."""

    def __init__(self, text, csv=True):
        super().__init__(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
        self.add_argument("--scenes", default=os.path.join(ROOT, "..", "shared", "scenes"))
        self.add_argument("--whitted", default=os.path.join(ROOT, "build", "renderers", "whitted", "whitted"))
        self.add_argument("--list", action="store_true", help="names of the cases")
        self.add_argument("--filter", default="", help="only cases whose name matches this regular expression")
        if csv:
            self.add_argument("--csv", help="file for all figures")
        self.add_argument("--quick", action="store_true", help="tiny images: do the command lines work?")

    def error(self, text):
        sys.exit(f"{self.prog}: {text}")

    def parse(self):
        a = self.parse_args()
        try:
            a.filter = re.compile(a.filter)
        except re.error as e:
            self.error(f"--filter '{a.filter}': {e}")
        a.scenes = os.path.normpath(a.scenes)
        return a

    def choose(self, a, cases):
        """Of the cases, tuples of words, those that --filter takes; --list prints them and ends."""
        chosen = [c for c in cases if a.filter.search("/".join(c))]
        if not chosen:
            self.error(f"--filter '{a.filter.pattern}' matches no case; --list shows them")
        if a.list:
            print("\n".join("/".join(c) for c in chosen))
            sys.exit()
        return chosen

    def check_whitted(self, a):
        if not os.access(a.whitted, os.X_OK):
            self.error(f"{a.whitted}: not there; meson setup build && ninja -C build")

    def open_csv(self, a):
        try:
            return open(a.csv or os.devnull, "w", newline="")
        except OSError as e:
            self.error(f"{a.csv}: {e.strerror}")


def run_main(main):
    """Ends in one line where it cannot go on."""
    name = os.path.basename(sys.argv[0])
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(f"{name}: interrupted")
    except OSError as e:
        sys.exit(f"{name}: {e}")
