# SPDX-License-Identifier: Apache-2.0
"""bench/convergence.py: its curves and tables, and small runs of it. Usage: convergence.py BENCH WHITTED"""
import csv
import json
import os
import subprocess
import sys
import tempfile
import unittest
import xml.dom.minidom

BENCH, WHITTED = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
sys.dont_write_bytecode = True
sys.path.insert(0, BENCH)
import convergence  # noqa: E402


def points(pairs):
    return [{"frame_s": t, "rel_mse": e} for t, e in pairs]


class Curves(unittest.TestCase):
    def test_front_keeps_what_nothing_beats(self):
        kept = convergence.front(points([(4, 1), (1, 8), (2, 9), (3, 3), (3, 4), (5, 1), (6, 0.5)]))
        self.assertEqual([(p["frame_s"], p["rel_mse"]) for p in kept], [(1, 8), (3, 3), (4, 1), (6, 0.5)])

    def test_power_laws_are_straight(self):
        curve = points([(t, 3.0 * t ** -1.5) for t in (1, 3, 10)])
        for t in (1, 2, 3, 7.5, 10):
            self.assertAlmostEqual(convergence.at_time(curve, t), 3.0 * t ** -1.5)
        for t in (0.9, 10.1):
            self.assertIsNone(convergence.at_time(curve, t))

    def test_ratio_of_equal_times(self):
        curves = {"selection": points([(1, 8), (16, 0.5)]), "estimate": points([(0.5, 4), (8, 0.25)]),
                  "exact": points([(4, 4), (64, 0.25)])}
        times = convergence.equal_times(curves)
        self.assertEqual((len(times), times[0], times[-1]), (convergence.TIMES, 1, 8))
        text = convergence.table_of(curves, "selection")
        self.assertIn("estimate / selection 0.25 (0.25 ... 0.25 at 8 times)", text)
        self.assertIn("exact / selection 2.00 (2.00 ... 2.00 at 3 times)", text)
        self.assertIn("| 1 | 8 | 2 | - | 0.25 | - |", text)


class Runs(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def run_it(self, *words, status=0):
        done = subprocess.run([sys.executable, os.path.join(BENCH, "convergence.py"), "--whitted", WHITTED, "--quick",
                               "--base", "exact", "--reference-select", "0", *words], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, status, done.stderr)
        return done.stdout, done.stderr

    def test_figures_plots_and_again(self):
        figures, plots = (os.path.join(self.folder, name) for name in ("figures.csv", "plots"))
        said, _ = self.run_it("--filter", "cornell/(cache|estimate|exact)$", "--csv", figures, "--plots", plots, "--seeds", "2")
        with open(figures) as f:
            rows = list(csv.DictReader(f))
        self.assertEqual({r["method"] for r in rows}, {"cache", "estimate", "exact"})
        self.assertEqual(len(rows), 2 * 3 + 2 * 3 + 3)
        self.assertTrue(all(float(r["rel_mse"]) > 0.0 and float(r["frame_s"]) > 0.0 for r in rows))
        self.assertNotIn(os.path.dirname(WHITTED), "".join(r["command"] + r["reference"] for r in rows))
        exact = {int(r["spp"]): float(r["rel_mse"]) for r in rows if r["method"] == "exact"}
        self.assertLess(exact[3], exact[1])
        plot = xml.dom.minidom.parse(os.path.join(plots, "cornell.svg"))
        self.assertEqual(len(plot.getElementsByTagName("polyline")), 3)
        again, _ = self.run_it("--again", figures)
        self.assertEqual(again, said)

    def test_references_are_kept_while_they_hold(self):
        words = ("--filter", "cornell/exact$", "--references", self.folder)
        self.assertIn(" -o ", self.run_it(*words)[1])
        self.assertNotIn(" -o ", self.run_it(*words)[1])
        self.assertIn(" -o ", self.run_it(*words, "--reference-spp", "80")[1])
        said = self.run_it(*words, "--options=--light-samples 2")[1]
        self.assertEqual(said.count("--light-samples 2"), len(said.splitlines()))
        self.assertIn(" -o ", said)
        self.assertNotIn(" -o ", self.run_it(*words)[1])
        name = next(os.path.join(self.folder, n) for n in os.listdir(self.folder) if n.endswith("64spp.json"))
        with open(name) as f:
            noted = json.load(f)
        noted["probe"] *= 1.01
        with open(name, "w") as f:
            json.dump(noted, f)
        said = self.run_it(*words)[1]
        self.assertIn("rendered again", said)
        self.assertIn(" -o ", said)

    def test_what_is_missing_is_said(self):
        said = self.run_it("--filter", "kitchen", "--scenes", self.folder, status=1)[1]
        self.assertIn("kitchen: left out, ", said)
        self.assertEqual(len(said.splitlines()), 2)
        for words in (["--filter", "nothing"], ["--filter", "("], ["--again", WHITTED], ["--again", "missing.csv"],
                      ["--seeds", "0"], ["--options", "'"], ["--csv", "missing/x.csv"], ["--plots", WHITTED]):
            self.assertEqual(len(self.run_it(*words, status=1)[1].splitlines()), 1, words)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
