# SPDX-License-Identifier: Apache-2.0
"""Runs cases one after another and keeps a row of each: what is there is not run again."""
import dataclasses
import fcntl
import hashlib
import json
import os
import shlex
import signal
import subprocess
import sys
import time

from scenes import Failure


@dataclasses.dataclass
class Case:
    id: str             # section/scene/method/value
    words: list         # a program's name and its arguments; files of its own relative to the report's folder
    labels: dict        # what the sections look for: section, scene, method, value ...
    needs: tuple = ()   # ids of the cases whose files it reads
    makes: tuple = ()   # files that it writes
    cost: float = 1.0   # how long it may take, against other cases; for the time left alone


class Programs:
    """Where programs lie, and what says whether they are still the same."""

    def __init__(self, paths):
        self.paths, self.digests = paths, {}

    def digest(self, name):
        if name not in self.digests:
            with open(self.paths[name], "rb") as f:
                self.digests[name] = hashlib.sha256(f.read()).hexdigest()[:16]
        return self.digests[name]


def public(a, words):
    """A command with nothing of this machine's folders."""
    return shlex.join([words[0]] + [w.replace(os.path.join(a.scenes, ""), "SCENES/") for w in words[1:]])


class Rows:
    """FOLDER/rows.jsonl: a line for each case that was run; of several with one id the last one counts. One process at
    a time: others end in a line. A line that was cut off is dropped."""

    def __init__(self, a, programs, cases):
        self.a, self.programs, self.path = a, programs, os.path.join(a.out, "rows.jsonl")
        self.cases = {c.id: c for c in cases}
        self.file = open(self.path, "a+b")
        try:
            fcntl.flock(self.file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise Failure(f"{self.path}: another report is writing there") from None
        self.file.seek(0)
        data = self.file.read()
        whole = data[:data.rfind(b"\n") + 1]
        if len(whole) < len(data):
            self.file.truncate(len(whole))
        self.rows = {}
        for line in whole.splitlines():
            try:
                row = json.loads(line)
                if row["size"] != a.level_name:
                    raise Failure(f"{a.out}: holds a {row['size']} report, this is a {a.level_name} one; another --out")
                self.rows[row["id"]] = row
            except (ValueError, KeyError, TypeError):
                print(f"report: {self.path}: a damaged line left out", file=sys.stderr)

    def key(self, case):
        said = [public(self.a, case.words), self.programs.digest(case.words[0])]
        said += [self.key(self.cases[n]) for n in case.needs]
        return hashlib.sha256("\n".join(said).encode()).hexdigest()[:16]

    def get(self, case):
        """Its row, None where there is none, or too short a one, or the command, the program or a file is another one
        by now."""
        row = self.rows.get(case.id)
        same = row and row.get("key") == self.key(case)
        if same and self.a.level.repeated > 1 and short(case, row["figures"], row["wall_s"]):
            same = "frames_s" in row["figures"]
        return row if same and all(os.path.exists(os.path.join(self.a.out, f)) for f in case.makes) else None

    def add(self, case, figures, seconds):
        row = {"id": case.id, "key": self.key(case), "command": public(self.a, case.words), "wall_s": round(seconds, 3),
               "size": self.a.level_name, "machine": self.a.machine, "labels": case.labels, "figures": figures}
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])  # in the file and here, or in neither
        os.write(self.file.fileno(), (json.dumps(row) + "\n").encode())  # whole, and at the end
        self.rows[case.id] = row
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
        os.fsync(self.file.fileno())


def figures_of(a, programs, case):
    """What the program prints as JSON. Interrupted, it is waited for."""
    command = [programs.paths[case.words[0]]] + case.words[1:]
    process = subprocess.Popen(command, cwd=a.out, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        out, err = process.communicate()
    except BaseException:
        process.send_signal(signal.SIGINT)
        try:
            process.communicate(timeout=20)
        except (subprocess.TimeoutExpired, KeyboardInterrupt):
            process.kill()
            process.communicate()
        raise
    if process.returncode != 0:
        lines = err.strip().splitlines()
        raise Failure(lines[-1] if lines else f"ended with status {process.returncode}")
    try:
        figures = json.loads(out)
    except ValueError:
        raise Failure(f"{public(a, case.words)}: no figures") from None
    if figures.get("complete") is False:
        raise KeyboardInterrupt  # it was told to stop, and so are we
    return figures


SHORT = 5.0  # seconds: what takes less is soon repeated, and soon disturbed


def short(case, figures, seconds):
    """Whether it is of a frame alone that took little. (Of `converged` each is one of many points of a curve, of
    several draws each is one.)"""
    alone = "mode_run" in figures and "exact" not in figures and "draw" not in case.labels
    return alone and seconds < SHORT and case.labels["section"] == "curves"


def measured(a, programs, case):
    """Its figures; of a frame alone that takes little, those of the median of several."""
    start = time.monotonic()
    several = [figures_of(a, programs, case)]
    if short(case, several[0], time.monotonic() - start):
        several += [figures_of(a, programs, case) for _ in range(1, a.level.repeated)]
        several.sort(key=lambda f: f["mode_run"]["frame_s"])
    figures = several[len(several) // 2]
    return {**figures, "frames_s": [f["mode_run"]["frame_s"] for f in several]} if len(several) > 1 else figures


def duration(seconds):
    seconds = int(seconds + 0.5)
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60:02} s"
    return f"{seconds // 3600} h {seconds % 3600 // 60:02} min"


class Progress:
    """A line on standard error: which case runs, how many are done, how long the rest may take."""

    def __init__(self, cases, quiet):
        self.costs, self.done, self.spent, self.quiet = [c.cost for c in cases], 0, 0.0, quiet
        self.live = sys.stderr.isatty()
        self.begin = time.monotonic()

    def left(self):
        if self.done == 0:
            return ""
        rest = sum(self.costs[self.done:])
        return f", {duration(self.spent / max(1e-9, sum(self.costs[:self.done])) * rest)} left"

    def say(self, case):
        if not self.quiet:
            line = f"[{self.done + 1}/{len(self.costs)}{self.left()}] {case.id}"
            sys.stderr.write(f"\r\033[K{line}" if self.live else line + "\n")
            sys.stderr.flush()

    def took(self, seconds):
        self.done += 1
        self.spent += seconds

    def end(self):
        if self.live and not self.quiet:
            sys.stderr.write("\r\033[K")
            sys.stderr.flush()


def run_all(a, programs, cases, rows):
    """Ids of the cases that failed."""
    todo = [c for c in cases if rows.get(c) is None]
    if len(todo) < len(cases) and not a.quiet:
        print(f"report: {len(cases) - len(todo)} of {len(cases)} cases are there already", file=sys.stderr)
    for folder in {os.path.dirname(f) for c in todo for f in c.makes}:
        os.makedirs(os.path.join(a.out, folder), exist_ok=True)
    progress, failed = Progress(todo, a.quiet), []
    try:
        for case in todo:
            progress.say(case)
            start = time.monotonic()
            try:
                lacking = next((n for n in case.needs if rows.get(rows.cases[n]) is None), None)
                if lacking:
                    raise Failure(f"needs {lacking}")
                figures = measured(a, programs, case)
                rows.add(case, figures, time.monotonic() - start)
            except Failure as e:
                progress.end()
                failed.append(case.id)
                print(f"report: {case.id}: {e}", file=sys.stderr)
            progress.took(time.monotonic() - start)
    finally:
        progress.end()
    return failed
