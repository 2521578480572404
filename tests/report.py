# SPDX-License-Identifier: Apache-2.0
"""bench/report: a small report, whose every number must come from a row, and how it goes on after a stop.
Usage: report.py BENCH WHITTED BDPT ZOOM CLUSTERS"""
import argparse
import html.parser
import json
import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import unittest
import xml.dom.minidom

BENCH, PROGRAMS = os.path.abspath(sys.argv[1]), [os.path.abspath(p) for p in sys.argv[2:5]]
sys.dont_write_bytecode = True
sys.path.insert(0, BENCH)
import exr  # noqa: E402
from report import axes, edges, glance, methods, shadow_maps, svg  # noqa: E402
from report.curves import best  # noqa: E402
from report.headline import Entry, where_little_is_asked  # noqa: E402
from report.levels import LEVELS  # noqa: E402
from report.page import FORMATS, lookup  # noqa: E402
from report.curves import at_equal_error, rays_cost, repeats, step_in_rays  # noqa: E402
from report.parameters import verdict  # noqa: E402

VOID = {"meta", "img", "input", "br", "link"}
# digits that are no measurements: settings, axes, names, commands
EXEMPT_TAGS = {"code", "style", "script", "title"}
EXEMPT_CLASSES = {"given", "axis", "name"}


class Page(html.parser.HTMLParser):
    """Collects what is wrong with a page, given its rows by id."""

    def __init__(self, rows):
        super().__init__()
        self.rows, self.stack, self.wrong, self.numbers, self.markers, self.texts = rows, [], [], 0, 0, set()

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        for row in attributes.get("data-row", "").split():
            if row not in self.rows:
                self.wrong.append(f"no row {row}")
        for axis in ("data-x", "data-y"):
            if axis in attributes:
                field, value = attributes[axis].split(" ", 1)
                self.markers += 1
                if repr(lookup(self.rows[attributes["data-row"]], field)) != value:
                    self.wrong.append(f"{attributes['data-row']}: {field} is not {value}")
        if tag not in VOID:
            self.stack.append((tag, attributes))

    def handle_endtag(self, tag):
        if tag not in VOID:
            opened = self.stack.pop()[0]
            if opened != tag:
                self.wrong.append(f"<{opened}> ends as </{tag}>")

    def handle_data(self, text):
        tag, attributes = self.stack[-1] if self.stack else ("", {})
        if tag == "data":
            self.numbers += 1
            self.texts.add(text)
            value = lookup(self.rows[attributes["data-row"]], attributes["data-field"])
            if str(value) != attributes["value"] or FORMATS[attributes["data-format"]](value) != text:
                self.wrong.append(f"{attributes['data-row']}: {attributes['data-field']} is {value}, not {text}")
        elif re.search(r"\d", text) and not any(t in EXEMPT_TAGS or EXEMPT_CLASSES & set((a.get("class") or "").split())
                                                for t, a in self.stack):
            self.wrong.append(f"a number from no row: {text.strip()}")
        elif tag == "title" and len(self.stack) > 2 and self.stack[-2][1].get("data-row"):
            row, (field, _) = self.rows[self.stack[-2][1]["data-row"]], self.stack[-2][1]["data-y"].split(" ", 1)
            if not any(f(lookup(row, field)) in text for k, f in FORMATS.items() if k != "plain"):
                self.wrong.append(f"{row['id']}: {text}")


def read(path):
    with open(path) as f:
        return f.read()


class Report(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.out = os.path.join(cls.folder.name, "report")
        cls.first = cls.run_it()

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def words(cls, *more):
        programs = [w for p in zip(("--whitted", "--bdpt", "--zoom"), PROGRAMS) for w in p]
        return [sys.executable, os.path.join(BENCH, "report"), "--tiny", *programs, "--out", cls.out, *more]

    @classmethod
    def run_it(cls, *more, status=0):
        done = subprocess.run(cls.words(*more), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        if done.returncode != status:
            raise AssertionError(f"{more}: {done.returncode}: {done.stderr}")
        return done.stderr

    def rows(self):
        return {r["id"]: r for r in json.loads(read(os.path.join(self.out, "rows.json")))}

    def test_every_number_is_that_of_a_row(self):
        rows, text = self.rows(), read(os.path.join(self.out, "index.html"))
        page = Page(rows)
        page.feed(text)
        self.assertEqual(page.wrong, [])
        self.assertEqual(page.stack, [])
        self.assertGreater(page.numbers, 100)
        self.assertGreater(page.markers, 100)
        self.assertNotRegex(text, r'(src|href)="(?!data:|#)')  # nothing outside of the page
        self.assertNotIn(os.path.dirname(PROGRAMS[0]), text + json.dumps(rows))
        sections = ("curves", "lights", "converged", "pictures", "maps", "flicker", "edges", "clusters", "parameters",
                    "seeing")
        for section in ("headline", *sections):
            self.assertIn(f'<section id="{section}">', text)
        for row in rows.values():
            self.assertIn(row["labels"]["section"], (*sections, "derived"))

    def test_a_wrong_number_is_seen(self):
        rows, text = self.rows(), read(os.path.join(self.out, "index.html"))

        def other_digit(found):
            return found.group(1) + str((int(found.group(2)) + 1) % 10)

        for change in (lambda t: re.sub(r'(data-format="times">)(\d)', other_digit, t, count=1),
                       lambda t: t.replace("</figcaption>", " 17 times</figcaption>", 1),
                       lambda t: re.sub(r'(data-y="\S+ )(\d)', other_digit, t, count=1),
                       lambda t: t.replace('data-row="curves/', 'data-row="curve/', 1)):
            page = Page(rows)
            self.assertNotEqual(change(text), text)
            try:
                page.feed(change(text))
            except KeyError:
                continue  # a row that is not there
            self.assertNotEqual(page.wrong, [])

    def test_alone_is_as_beside_exact(self):
        alone = self.rows()
        with tempfile.TemporaryDirectory() as folder:  # medians of two: each beside an exact frame of its own
            self.run_it("--runs", "2", "--filter", "^curves/shapes/(estimate|adaptive)/", "--out", folder)
            beside = [r for r in json.loads(read(os.path.join(folder, "rows.json"))) if "point" in r]
        self.assertEqual(len(beside), 3)
        repeated = [r["figures"] for r in alone.values() if "frames_s" in r["figures"]]
        self.assertGreater(len(repeated), 10)
        for f in repeated:
            self.assertEqual(f["mode_run"]["frame_s"], statistics.median_high(f["frames_s"]))
        for r in beside:
            a, b = r["point"], alone[r["id"]]["point"]
            self.assertNotIn("exact", alone[r["id"]]["figures"])
            for what in ("error", "flip", "share"):
                self.assertAlmostEqual(a[what], b[what], delta=0.001 * b[what])

    def test_figures_make_sense(self):
        rows = self.rows().values()
        curves = [r for r in rows if r["labels"]["section"] == "curves"]
        self.assertGreater(sum(r["point"]["error"] > 0 for r in curves), 15)
        for r in curves:
            self.assertIn("point", r)
            if r["labels"]["method"] == "limit":
                self.assertGreater(r["point"]["frame"], 1.0)
            elif r["point"]["error"] > 0:
                self.assertTrue(0 < r["point"]["flip"] < 0.5, r)
        for r in rows:
            if r["labels"]["section"] == "pictures":
                blocks, width, height = (r["figures"][k] for k in ("blocks", "width", "height"))
                self.assertEqual([b["flip"] for b in blocks], sorted((b["flip"] for b in blocks), reverse=True))
                for i, b in enumerate(blocks):
                    self.assertGreaterEqual(b["flip"], r["figures"]["flip"])  # worse than the mean
                    self.assertTrue(b["x"] + b["side"] <= width and b["y"] + b["side"] <= height)
                    for c in blocks[:i]:
                        self.assertGreaterEqual(max(abs(b["x"] - c["x"]), abs(b["y"] - c["y"])), b["side"])

    def test_other_draws_are_means(self):
        rows, found = self.rows(), 0
        for r in rows.values():
            if r["labels"]["section"] == "curves" and "draws" in r["figures"]:
                own = [rows[f'{r["id"]}/{i + 1}'] for i in range(r["figures"]["draws"])]
                errors = [o["point"]["error"] for o in own]
                self.assertEqual(len(set(errors)), 2)  # each draw is another one
                self.assertAlmostEqual(r["point"]["error"], statistics.fmean(errors))
                self.assertEqual([r["figures"][k] for k in ("least", "most")], sorted(errors))
                self.assertEqual("frame" in r["point"], r["labels"]["method"] == "fewer")
                base = rows[r["labels"]["base"]]["figures"]
                for o in own:  # the same eye paths; as many of all lights fewer as are asked for
                    self.assertEqual(o["figures"]["eye_samples"], base["eye_samples"])
                    for k in ("vpls", "env_lights"):
                        self.assertEqual(o["figures"][k] * (r["labels"]["value"] or 1), base[k])
                found += 1
        self.assertEqual(found, 4)  # as many and half of them, in two scenes

    def test_flip_lies_in_the_image(self):
        """Its mean is the row's; of frames beside exact ones, the layer flip.Y is what zoom found by itself."""
        rows, layered = self.rows(), 0
        for r in (r for r in rows.values() if r["labels"]["section"] == "pictures"):
            scene, method, value = (r["labels"][k] for k in ("scene", "method", "value"))
            width, height, layers = exr.read(os.path.join(self.out, f"images/curves-{scene}-{method}.exr"))
            self.assertEqual((width, height), (r["figures"]["width"], r["figures"]["height"]))
            for name in "RGB":
                self.assertGreater(statistics.fmean(layers[name]), 0.0)
            row = rows[f"curves/{scene}/{method}/{value}"]
            self.assertAlmostEqual(row["point"]["flip"], r["figures"]["flip"], 5)
            if "error" not in row["figures"]:
                continue
            layered, flip = layered + 1, layers["flip.Y"]
            self.assertTrue(0.0 <= min(flip) < max(flip) <= 1.0)
            self.assertAlmostEqual(statistics.fmean(flip), row["point"]["flip"], 6)
            for b in r["figures"]["blocks"]:
                inside = [flip[y * width + x] for y in range(b["y"], b["y"] + b["side"])
                          for x in range(b["x"], b["x"] + b["side"])]
                self.assertAlmostEqual(statistics.fmean(inside), b["flip"], 5)
        self.assertEqual(layered, 2)

    def test_markdown_is_the_page(self):
        """Each number of its tables stands on the page; a document takes sections; one that cannot stays as it is."""
        page, text = Page(self.rows()), read(os.path.join(self.out, "figures.md"))
        page.feed(read(os.path.join(self.out, "index.html")))
        cells = [c.strip(" *") for line in text.splitlines() if line.startswith("| ") for c in line.split("|")[1:-1]]
        numbers = [c.split(" ")[0] for c in cells if re.match(r"[0-9.,]+(x| s| %)( |$)", c)]
        self.assertGreater(len(numbers), 200)
        for n in numbers:
            self.assertTrue(any(t.startswith(n) for t in page.texts), n)
        self.assertEqual(re.findall(r"<|&\w+;", re.sub("<= ", "", text)), [])
        self.assertNotRegex(text, r"(?m)^[.,;]")  # what is of a plot alone leaves no hole
        path = os.path.join(self.folder.name, "page.md")
        scene = next(r["labels"]["scene"] for r in self.rows().values() if r["labels"]["section"] == "maps")
        named = (f"maps, maps-{scene}", "headline, lead")
        for sections, status in ((("headline, table", "maps"), 0), (named, 0), (("headline", "nothing"), 1), ((), 1),
                                 (("headline, table", "headline, nothing"), 1)):
            before = "".join(f"A page\n<!-- report: {s} -->\nold\n<!-- end of report -->\n" for s in sections)
            with open(path, "w") as f:
                f.write(before)
            said = self.run_it("--fill", path, status=status)
            if status:
                self.assertIn(path, said.splitlines()[-1])
                self.assertEqual(read(path), before)
            else:
                parts = read(path).split("<!-- ")
                self.assertEqual([p.split(" -->")[0] for p in parts[1:]],
                                 [f"report: {sections[0]}", "end of report", f"report: {sections[1]}", "end of report"])
                for p in (parts[1], parts[3]):
                    self.assertIn(p.split(" -->\n")[1].strip(), text)
                    self.assertTrue(p.count("\n|") > 3 or "lead" in p, p)
                self.assertEqual(len(parts[1].strip().split("\n\n")), 1)
                if "lead" in sections[1]:
                    self.assertIn("as fast as exact", parts[3])
                    self.assertNotIn("|", parts[3])

    def test_parts_are_there(self):
        for folder, end, least in (("plots", ".svg", 10), ("pictures", ".png", 16)):
            names = [n for n in os.listdir(os.path.join(self.out, folder)) if n.endswith(end)]
            self.assertGreaterEqual(len(names), least)
        for name in os.listdir(os.path.join(self.out, "plots")):
            xml.dom.minidom.parse(os.path.join(self.out, "plots", name))
        lines = read(os.path.join(self.out, "rows.csv")).splitlines()
        self.assertEqual(len(lines), len(self.rows()) + 1)

    def test_what_is_there_is_not_run_again(self):
        path = os.path.join(self.out, "rows.jsonl")
        lines = read(path).splitlines(True)
        self.assertIn(f"{len(lines)} of {len(lines)} cases are there already", self.run_it())
        self.assertEqual(read(path), "".join(lines))
        with open(path, "w") as f:  # one is lost, the last was cut off, one is not of this program
            f.write("".join(lines[:5] + lines[6:-2]) + lines[-2].replace('"key": "', '"key": "x') + lines[-1][:40])
        said = self.run_it()
        self.assertIn(f"{len(lines) - 3} of {len(lines)} cases are there already", said)
        self.assertEqual(said.count("\n["), 3, said)
        self.assertEqual(*({json.loads(line)["id"] for line in some} for some in (read(path).splitlines(), lines)))

    def test_interrupted_it_goes_on(self):
        for told in (signal.SIGINT, signal.SIGTERM):
            self.interrupt(told)

    def interrupt(self, told):
        with tempfile.TemporaryDirectory() as out:
            words = self.words("--out", out, "--only", "curves")
            process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                       # a shell in the background has its jobs ignore it
                                       preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))
            path, end = os.path.join(out, "rows.jsonl"), time.monotonic() + 120
            while time.monotonic() < end and not (os.path.exists(path) and os.path.getsize(path)):
                time.sleep(0.01)
            process.send_signal(told)
            said = process.communicate(timeout=60)[1]
            self.assertEqual(process.returncode, 130, said)
            done = int(re.search(r"interrupted; (\d+) of \d+ cases are done and kept: the same", said).group(1))
            self.assertEqual(done, len(read(path).splitlines()))
            self.assertIn("</html>", read(os.path.join(out, "index.html")))
            self.assertIn(f"{done} of ", self.run_it("--out", out, "--filter", "curves/cornell/(exact|cache)"))

    def test_bad_input_is_said_in_a_line(self):
        with tempfile.TemporaryDirectory() as empty:
            closed = os.path.join(PROGRAMS[0], "x")
            with open(os.path.join(empty, "rows.jsonl"), "w") as f:
                f.write('{"id": "curves/cornell/exact", "size": "full"}\n')
            for words in (["--scenes", "/nowhere"], ["--out", empty], ["--scenes", empty], ["--out", closed],
                          ["--only", "nothing"], ["--only", ""], ["--fill", closed], ["--filter", "nothing"],
                          ["--filter", "("], ["--threads", "-1"], ["--runs", "0"], ["--whitted", closed], ["--what"]):
                self.assertEqual(len(self.run_it(*words, status=1).splitlines()), 1, words)


def row(method, frame, error, scene="room", value=8, **figures):
    labels = {"section": "curves", "scene": scene, "method": method, "value": value}
    return {"id": f"{scene}/{method}/{frame}", "labels": labels, "figures": figures,
            "point": {"frame": frame, "error": error}}


class Points(unittest.TestCase):
    def test_exact_frames_of_a_scene_and_what_was_rendered_alone(self):
        def exact(frame, shade, seen):
            return {"frame_s": frame, "shade_s": shade, "visibility_s": seen, "rays_traced": 90, "rays": 90}

        def beside(method, ratio, *times):
            return {"labels": {"section": "curves", "method": method, "base": "base"},
                    "figures": {"error": {"l_inf": 0.02 * ratio, "l_inf_whole": 0.02, "mispredicted": None},
                                "mode_run": {"rays_traced": 9}, "speedup": {"frame": 4, "shade": 5, "rays": 10},
                                "exact": exact(*times)}}

        alone = {"mode_run": {"frame_s": 0.5, "shade_s": 0.25, "rays_traced": 30},
                 "reference": {"mode_run": {"l_inf": 0.1, "flip": 0.2}}}
        rows = {"base": {"labels": {"section": "curves", "method": "limit", "base": "base"},
                         "figures": {"mode_run": exact(1.8, 1.4, 0.9)}},
                "cache": beside("cache", 3, 2.0, 1.5, 1.0), "cache 2": beside("cache", 3, 2.7, 1.6, 1.1),
                "grid": beside("grid", 7, 9.0, 9.0, 9.0), "bdpt": beside("bdpt", 7, 9.0, 9.0, 9.0),  # of other samples
                "fewer": {"labels": {"section": "curves", "method": "fewer", "base": "base"}, "figures": alone}}
        methods.add_points(rows)
        limit, point = rows["base"]["point"], rows["fewer"]["point"]
        self.assertEqual((limit["exact_s"], limit["frame"], limit["shade"], limit["frames"]), (2.0, 2.0, 3.0, 3))
        self.assertAlmostEqual(limit["noise"], 1.5)
        self.assertAlmostEqual(point["error"], 0.3)  # three times that of the whole image, as the cache's
        self.assertAlmostEqual(point["share"], 1 / 3)
        self.assertEqual((point["frame"], point["shade"], point["flip"]), (4.0, 6.0, 0.2))
        self.assertEqual((rows["cache"]["point"]["frame"], rows["cache"]["point"]["share"]), (4, 0.1))

    def test_front_has_what_nothing_beats(self):
        points = [row("cache", 3, 0.01), row("estimate", 4, 0.02), row("selection", 2, 0.015),
                  row("adaptive", 0.9, 0.001), row("bdpt", 9, 0.001), row("limit", 20, 0),
                  row("selection", 5, 0, served="exact")]
        self.assertEqual([r["labels"]["method"] for r in best(points)], ["estimate", "cache"])

    def test_a_step_in_rays_is_explained(self):
        def drawn(*values, count=24, served="selection"):
            return [row("selection", k, 0.1, value=k, punctual_lights=count, served=served) for k in values]

        self.assertIn('data-field="labels.value" data-format="plain">48</data> on', step_in_rays(drawn(64, 32, 48, 8)))
        for points in (drawn(8, 47), drawn(48, 64), drawn(8, 48, count=8), drawn(8, 48, served="exact"), []):
            self.assertEqual(step_in_rays(points), "")

    def test_what_a_ray_takes(self):
        def of(method, seconds, rays, value=""):
            return row(method, 1, 0, value=value, mode_run={"visibility_s": seconds, "rays_traced": rays})

        for seconds, said in ((1.0, False), (4.5, True)):
            rows = {}
            words = rays_cost(rows, [of("limit", seconds, 1000000), of("cache", 9, 1, 8), of("cache", 2, 400000, 4)],
                              "room")
            self.assertEqual([r["figures"] for r in rows.values()], [{"exact": seconds, "cache": 5.0}])
            self.assertEqual("packets share nothing" in words, said)

    def test_where_the_cache_loses_is_said(self):
        def cache(frame, error=0.01):
            return row("cache", frame, error)

        selection, estimate = row("selection", 3, 0.01), row("estimate", 4, 0.01)
        exact = row("limit", 9, 0)
        exact["point"]["noise"] = 1.1
        for points, said in (([cache(4), selection], "None"), ([cache(2), row("selection", 3, 0.03)], "None"),
                             ([cache(2), selection, estimate], "None"),
                             ([cache(2), selection], "<b>the cache loses</b>: fastest is stochastic"),
                             ([selection], "no setting of the cache that was tried gets there"),
                             ([cache(1.05)], "nothing that was tried is faster than exact by more than"),
                             ([cache(2, 0.05), cache(3, 0.06)], "nearest with the cache is cache (")):
            entry = Entry({r["id"]: r for r in [exact, *points]}, "room", 0.02)
            self.assertIn(said, str(entry.sentence()))
        self.assertRegex(entry.sentence(), "nearest.*5.00 %")
        self.assertIsNone(Entry({r["id"]: r for r in [exact, cache(1.05)]}, "room", 0.02).winner)

    def test_what_the_clock_does_not_tell_apart_does_not_win(self):
        exact, cache = row("limit", 9, 0), row("cache", 3.8, 0.01)
        exact["point"]["noise"] = 1.1
        for speed, won, said in ((4, ["cache", "selection"], "the cache does not win: stochastic selection"),
                                 (4.5, ["selection"], "the cache loses</b>: fastest is stochastic"),
                                 (3.7, ["cache", "selection"], "None"), (3, ["cache"], "None")):
            entry = Entry({r["id"]: r for r in (exact, cache, row("selection", speed, 0.01))}, "room", 0.02)
            self.assertEqual([m for m in entry.found if entry.wins(m)], won)
            self.assertIn(said, str(entry.sentence()))
            self.assertEqual(len(where_little_is_asked([entry])), speed == 4.5)
        self.assertEqual(where_little_is_asked([Entry({"e": exact, "c": cache}, "room", 0.02)]), [])

    def test_variants_are_told_apart(self):
        entry = Entry({r["id"]: r for r in (row("cache", 2, 0.01), row("cache-once", 3, 0.01))}, "room", 0.02)
        self.assertIn(">C_E = 8, refined once<", entry.cell("cache"))

    def test_how_much_times_differ(self):
        frames = [row("estimate", k, 0.01, frames_s=[1.0, 1.1, most]) for k, most in ((1, 1.2), (2, 1.3), (3, 1.5))]
        rows = {}
        self.assertIn(">1.50x</data>): steps", repeats(rows, [*frames, row("estimate", 4, 0.01)], "room"))
        self.assertEqual(rows["curves/room/repeats"]["figures"], {"frames": 3, "middle": 1.3, "most": 1.5})
        self.assertEqual(repeats(rows, frames[:1], "room"), "")
        found = methods.clock(rows, "c", [(16, 2.0, "a"), (16, 3.0, "b"), (1, 1.0, "d"), (4, 5.0, "e"), (4, 5.5, "f")])
        self.assertEqual(found["figures"], {"most": 1.5})
        self.assertIsNone(methods.clock(rows, "c", [(16, 2.0, "a"), (1, 1.0, "d")]))

    def test_two_curves_at_equal_error(self):
        rows = {r["id"]: r for r in (row("cache", 2, 0.01), row("cache", 4, 0.04), row("cache-once", 3, 0.02),
                                     row("cache-once", 9, 0.05), row("cache", 8, 0.01, "hall"),
                                     row("cache", 2, 0.005, "hall"), row("cache-once", 2, 0.01, "hall"),
                                     row("cache", 8, 0.01, "cave"), row("cache-once", 2, 0.01, "cave"))}
        figures = at_equal_error(rows, "cache-once", "cache")["figures"]
        self.assertEqual((figures["scenes"], figures["faster"]), (2, 1))
        self.assertAlmostEqual(figures["most"], 3 / 8 ** 0.5)
        self.assertAlmostEqual(figures["least"], 0.25)
        self.assertIsNone(at_equal_error({}, "cache-once", "cache"))

    def test_no_map_wins_that_is_slower_than_exact(self):
        def of(faster):
            return {"id": "m", "labels": {"value": 64}, "figures": {"l_inf": 0.005, "faster": 0.0123,
                                                                    "without_building": faster}}

        for faster, error, said in ((0.9, 0.001, "exact wins"), (1.5, 0.01, "the cache loses</b>, no C_E"),
                                    (1.5, 0.004, "the cache wins"), (2.5, 0.004, "the cache loses</b> beside")):
            self.assertIn(said, shadow_maps.verdict([of(faster)], [row("cache", 2, error)]))
        self.assertIn(">0.012x<", shadow_maps.verdict([of(2)], []))
        self.assertNotIn("loses", shadow_maps.verdict([of(2)], []))

    def test_at_a_glance(self):
        exact = row("limit", 9, 0)
        exact["point"]["noise"] = 1.1
        points = [row("estimate", 4, 0.009), row("estimate", 6, 0.015), row("cache", 2, 0.009),
                  row("cache", 1.5, 0.001), row("selection", 3.5, 0.009), row("estimate", 12, 0.009, scene="hall"),
                  row("estimate", 13, 0.03, scene="hall"), row("selection", 8, 0.005, scene="hall"),
                  row("selection", 2, 0.001, scene="cave"), row("adaptive", 2, 0.001, scene="other")]
        lights = [row(m, speed, error) for m, speed, error in (("cache", 0.75, 0.005), ("cache", 0.5, 0.004),
                                                               ("cache", 0.9, 0.03), ("estimate", 3, 0.005))]
        for r, kind in zip(lights, ("spots", "spots", "spots", "hair")):
            r["labels"].update(section="lights", kind=kind)
        rows = {r["id"]: r for r in [exact, *points, *lights]}
        entries = [Entry(rows, scene, t) for scene in ("hall", "room", "cave", "other") for t in (0.01, 0.02)]
        with tempfile.TemporaryDirectory() as out:
            os.mkdir(os.path.join(out, "plots"))
            said = glance.section(argparse.Namespace(out=out), rows, entries)
        marks = re.findall(r'data-row="([^"]+)" data-x', said)  # of 1 and 2 %, one where these are the same
        self.assertEqual(sorted(marks), sorted(["room/estimate/4", "room/estimate/6", "room/cache/2",
                                                "room/selection/3.5", "hall/estimate/12", "hall/selection/8",
                                                "cave/selection/2", "room/cache/0.75"]))
        words = re.sub(" +", " ", re.sub("<.*?>", "", said))
        self.assertIn("is 4.00x to 12.00x as fast as exact with the estimate from the cache (in 2 of 3 scenes), 2.00x "
                      "with the plain cache, which answers every pair (in 1 of 3 scenes), 2.00x to 8.00x with", words)
        self.assertIn("the estimate is 1.14x to 1.50x as fast as stochastic selection (within 2 %: 1.50x to 1.71x)",
                      words)
        self.assertIn("spots alone (room)", words)
        self.assertNotIn("hair", words)

    def test_what_is_better_in_each_scene_corrects_a_default(self):
        def of(default, *values):
            rows = [{"id": str(v), "labels": {"words": str(v)},
                     "figures": {"value": v, "equal_rays": r, "equal_time": 1.0}} for v, r in values]
            ours = {"id": "d", "labels": {"words": "default"},
                    "figures": {"value": default, "equal_rays": 1.0, "equal_time": 1.0}}
            return [ours, *rows]

        for a, b, said in ((0.9, 0.8, "the default is corrected</b> as to rays, in each"),
                           (1.0, 0.8, "the default stands"), (0.97, 0.98, "the default is confirmed"),
                           (1.3, 1.2, "the default is confirmed")):
            for parameter in ("cn", "cache-mb"):
                found = verdict({}, parameter, {"one": of(8, (4, a)), "two": of(8, (4, b))}, 1.1)
                trade = parameter == "cache-mb" and "corrected" in said
                self.assertIn("a trade" if trade else said, found)


class Plots(unittest.TestCase):
    def test_what_lies_beyond_stands_at_the_border(self):
        axis = axes.Axis([1.0, 100.0], 0.0, 10.0)
        self.assertEqual((axis(1e-9), axis(1e9)), (0.0, 10.0))
        self.assertAlmostEqual(axis(10.0), 5.0)

    def test_labels_of_axes_do_not_touch(self):
        def room(value):
            return 8.0 * len(axes.label(value)) + 6.0

        for make in (axes.logarithmic, axes.from_zero):
            for low in (0.00013, 0.7, 3.0, 940.0):
                for ratio in (1.0, 1.02, 1.3, 3.0, 12.0, 700.0, 1e5):
                    axis = make([low, low * ratio], 0.0, 320.0)
                    ticks = axis.ticks(room)
                    labelled = [v for v, said in ticks if said]
                    self.assertTrue(2 <= len(labelled) <= axes.MOST, (low, ratio, labelled))
                    for a, b in zip(labelled, labelled[1:]):
                        self.assertGreaterEqual(axis(b) - axis(a), (room(a) + room(b)) / 2)
                    self.assertTrue(all(axis.low <= v <= axis.high * 1.000001 for v, _ in ticks))
        ticks = axes.logarithmic([0.65, 1.75], 200.0, 0.0).ticks()
        self.assertGreaterEqual(sum(said for _, said in ticks), 4)  # not 1 and 1.5 alone

    def test_values_of_a_knob_are_its_labels(self):
        def said(xs, ys=(0.1, 0.2, 0.4, 0.7)):
            p = svg.Plot("knob", "what", 400, 300)
            p.series = [svg.Series("one", [(x, y, None, "") for x, y in zip(xs, ys)], "#000", "circle"),
                        svg.Series("other", [(x, 1.01 * y, None, "") for x, y in zip(xs, ys)], "#000", "circle")]
            texts = re.findall(r'<text x="([\d.]+)" y="([\d.]+)"[^>]*>([^<]+)</text>', p.svg())
            line = max(float(y) for _, y, words in texts if words != "knob")
            return [words for _, y, words in texts if float(y) == line], {w: float(y) for _, y, w in texts}

        self.assertEqual(said((4, 8, 16, 32))[0], ["4", "8", "16", "32"])
        self.assertEqual(said((4, 16, 16.1, 36))[0], ["4", "16", "36"])  # for two there is no room
        self.assertNotIn("4.0123", said((4.0123, 7.7777, 19.876, 33.333))[0])  # measured
        _, places = said((1, 2, 4, 8), (1.0, 1.0, 1.0, 1.0))
        self.assertGreaterEqual(places["one"] - places["other"], 1.25 * 13 - 0.1)

    def test_words_of_lines_stand_side_by_side_within_the_plot(self):
        p = svg.Plot("error", "what", 480, 300, y_label=lambda v: f"{v:.9f}")
        p.series = [svg.Series("one", [(0.0123, 0.1, None, ""), (0.0456, 0.2, None, "")], "#000", "circle")]
        p.vertical = [(0.0455, "last words"), (0.02, "two"), (0.0205, "others"), (0.019, "one")]
        found = re.findall(r'<text x="([\d.]+)" y="([\d.]+)" text-anchor="(\w+)"[^>]*>([^<]+)</text>', p.svg())
        last = 0.0
        for x, words in ((float(x), words) for x, y, _, words in found if float(y) == 41.0):
            half = svg.width_of(words, 13) / 2
            self.assertGreaterEqual(x - half, last - 0.1, words)
            last = x + half
        self.assertLessEqual(last, 480)
        self.assertGreater(last, 400)
        p.vertical = [(0.0455, "words that would be cut off")]
        x = float(re.search(r'x="([\d.]+)"[^>]*>words', p.svg()).group(1))
        self.assertLessEqual(x + svg.width_of("words that would be cut off", 13) / 2, 480)
        for x, _, anchor, words in found:  # nor is a label of the axis cut
            if anchor == "end":
                self.assertGreaterEqual(float(x), 0.58 * 13 * len(words))

    def test_front_is_steps(self):
        self.assertEqual(svg.steps([(3, 9), (1, 2), (2, 5)]), [(1, 2), (2, 2), (2, 5), (3, 5), (3, 9)])
        self.assertEqual(svg.spread([10, 11, 12, 40, 60], 5, 0, 50), [6, 11, 16, 40, 45 + 5])

    def test_means_over_few_edges_are_left_out(self):
        way = {"name": "halton", "edges": 980, "rows": 500, "columns": 480, "pairs": 499, "right": 1.25, "down": 2.25,
               "off": 3.25, "ragged": 4.25, "rays": 0.5, "mispredicted": 0.25, "l_inf": 0.125}
        a = argparse.Namespace(level=LEVELS["full"])
        table = edges.figures_of(a, [{"id": "e", "labels": {"scene": "room"}, "figures": {"ce": 8, "ways": [way]}}])
        self.assertEqual(re.sub("<.*?>", " ", table.split("<tbody>")[1]).split(),
                         "8 Halton order 1.25 500 – 480 3.25 – 499 50.0 % 25.00 % 12.50 %".split())

    def test_labels_do_not_cover_each_other(self):
        series = [svg.Series(f"name {i}", [(100.0, 100.0 + 3 * i), (180.0, 100.0 + 2 * i)], "#000", "circle")
                  for i in range(5)]
        placed = svg.place_labels(series, (0, 400, 0, 300), 12, [])
        boxes = [(x, y - 9.6, x + 0.62 * 12 * len(n), y + 3) for n, x, y, _ in placed]
        for i, a in enumerate(boxes):
            self.assertTrue(all(svg.overlap(a, b) < 12 for b in boxes[:i]), boxes)
            self.assertTrue(a[0] >= 0 and a[2] <= 400 and a[1] >= 0 and a[3] <= 300)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
