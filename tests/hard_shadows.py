# SPDX-License-Identifier: Apache-2.0
"""shadow_maps, sequence and edges of bench/: what they measure behaves as it must. Usage: hard_shadows.py FOLDER"""
import base64
import json
import os
import random
import struct
import subprocess
import sys
import tempfile
import unittest

FOLDER = os.path.abspath(sys.argv[1])


def run(program, *words, status=0):
    done = subprocess.run([os.path.join(FOLDER, program), *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True)
    if done.returncode != status:
        raise AssertionError(f"{program} {words}: {done.returncode}: {done.stderr}")
    return json.loads(done.stdout) if status == 0 else done.stderr


def quad(x, y, z, half):
    """Level, about (x, y, z)."""
    a, b, c, d = ((x + i * half, y, z + j * half) for i, j in ((-1, -1), (-1, 1), (1, 1), (1, -1)))
    return [a, b, c, a, c, d]


def bumps(n, height):
    """The ground from -4 to 4, of triangles that lie in no plane together."""
    rng, at = random.Random(1), {}
    for i in range(n + 1):
        for j in range(n + 1):
            at[i, j] = (8 * i / n - 4, height * rng.random(), 8 * j / n - 4)
    return [at[i + p, j + q] for i in range(n) for j in range(n)
            for p, q in ((0, 0), (0, 1), (1, 1), (0, 0), (1, 1), (1, 0))]


def write_scene(path, corners, light, placed):
    """A .gltf of triangles and one light, whose node has also what `placed` says."""
    data = b"".join(struct.pack("<3f", *c) for c in corners)
    least, most = ([f(c[k] for c in corners) for k in range(3)] for f in (min, max))
    scene = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
             "nodes": [{"mesh": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}, **placed}],
             "extensionsUsed": ["KHR_lights_punctual"], "extensions": {"KHR_lights_punctual": {"lights": [light]}},
             "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
             "accessors": [{"bufferView": 0, "componentType": 5126, "count": len(corners), "type": "VEC3",
                            "min": least, "max": most}],
             "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
             "buffers": [{"byteLength": len(data),
                          "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}]}
    with open(path, "w") as f:
        json.dump(scene, f)


def by_name(ways):
    return {(w["name"], w["value"]) if "value" in w else w["name"]: w for w in ways}


class Maps(unittest.TestCase):
    def test_finer_maps_are_better(self):
        rows = [run("shadow_maps", "conference-lights", "--size", "64x36", "--spp", "1", "--map", n)
                for n in ("32", "128", "512")]
        for coarse, fine in zip(rows, rows[1:]):
            self.assertLess(fine["mispredicted"], 0.6 * coarse["mispredicted"])
            self.assertLess(fine["l_inf"], coarse["l_inf"])
        self.assertLess(rows[-1]["mispredicted"], 0.03)
        for r in rows:
            self.assertEqual(r["mispredicted"], min(s["mispredicted"] for s in r["sweep"]))
            self.assertGreater(r["sweep"][0]["mispredicted"], 2 * r["mispredicted"])  # surfaces shade themselves

    def test_of_a_sun(self):
        r = run("shadow_maps", "atrium", "--size", "64x36", "--spp", "1", "--map", "2048")
        self.assertEqual(r["maps"], 1)
        self.assertLess(r["mispredicted"], 0.02)


    def test_what_lies_nearest_to_the_sun_blocks_it(self):
        """A roof that is the top of the scene lies in the map's near plane; far from the origin not to the last bit."""
        with tempfile.TemporaryDirectory() as out:
            path = os.path.join(out, "roof.gltf")
            write_scene(path, quad(4000.3, 0.7, -7000.1, 4) + quad(4000.3, 2.7, -7000.1, 1.5),
                        {"type": "directional", "intensity": 3}, {"rotation": [-0.70711, 0.0001, 0, 0.70710]})
            r = run("shadow_maps", path, "--look", "4000.3,2.2,-6995,4000.3,0.7,-7000.1,60", "--size", "64x64", "--spp",
                    "1", "--map", "512")
        self.assertLess(r["mispredicted"], 0.03)


class Sequence(unittest.TestCase):
    WORDS = ["--size", "64x36", "--spp", "4", "--frames", "4"]

    def test_a_kept_cache_knows_more(self):
        ways = run("sequence", "conference-lights", *self.WORDS, "--ways", "cache:8,kept:8,unrefined:8")["ways"]
        ways = by_name(ways)
        self.assertLess(ways["kept", "8"]["rays"], 0.8 * ways["cache", "8"]["rays"])
        self.assertGreater(ways["unrefined", "8"]["change"], ways["cache", "8"]["change"])
        self.assertGreater(ways["cache", "8"]["change"], 0)

    def test_it_forgets_lights_that_moved(self):
        """All of them: then it is the emptied one."""
        ways = run("sequence", "atrium", *self.WORDS, "--motion", "light", "--env-lights", "9", "--ways",
                   "cache:4,kept:4")["ways"]
        self.assertGreater(ways[0]["light"], 0)
        self.assertEqual({**ways[0], "name": ""}, {**ways[1], "name": ""})

    def test_virtual_lights_and_the_grid(self):
        soft = run("sequence", "cornell", *self.WORDS, "--vpls", "20", "--ways", "cache:4,kept:4")["ways"]
        self.assertLess(soft[1]["rays"], soft[0]["rays"])
        ways = run("sequence", "atrium", *self.WORDS, "--motion", "light", "--env-lights", "36", "--ways",
                   "grid:NEAR,grid:TRUE,estimate:4")["ways"]
        self.assertTrue(0 < ways[0]["rays"] < 1)
        self.assertLess(ways[1]["error"], 1e-6)
        self.assertGreater(ways[2]["change"], 0)

    def test_lights_drawn_are_those_of_the_first_frame(self):
        """What is drawn has no bias, so the more rays the nearer to exact, whose lights are of the first frame; those
        of the frame at hand would be others."""
        ways = run("sequence", "cornell", *self.WORDS, "--vpls", "200", "--ways",
                   "selection:4,selection:32,estimate:4,estimate:32,cache:8")["ways"]
        ways = by_name(ways)
        for kind in ("selection", "estimate"):
            few, many = ways[kind, "4"], ways[kind, "32"]
            self.assertLess(few["rays"], 0.1)
            self.assertLess(many["error"], 0.5 * few["error"])
            self.assertLess(many["change"], 0.5 * few["change"])
            still = run("sequence", "atrium", *self.WORDS, "--motion", "light", "--env-lights", "100", "--ways",
                        kind + ":4")["ways"][0]
            self.assertGreater(still["change"], 1.1 * still["error"])  # of noise as new as can be: the root of 2
        self.assertLess(ways["selection", "32"]["error"], 0.06)
        self.assertLess(ways["estimate", "4"]["error"], 0.7 * ways["selection", "4"]["error"])


class Edges(unittest.TestCase):
    def test_scanlines_move_shadows_down_and_right(self):
        with tempfile.TemporaryDirectory() as out:
            prefix = os.path.join(out, "e")
            ways = run("edges", "conference-lights", "--size", "192x108", "--ce", "6", "--picture", prefix)["ways"]
            ways = by_name(ways)
            self.assertEqual(len(os.listdir(out)), 14)
            with open(prefix + "-zoom-scanline.png", "rb") as f:
                self.assertEqual(struct.unpack(">II", f.read(24)[16:]), (64, 64))
        for plain in ("", "-plain"):
            halton, scanline, random = (ways[o + plain] for o in ("halton", "scanline", "random"))
            self.assertGreater(scanline["right"], 0.5)
            self.assertGreater(scanline["down"], 0.5)
            self.assertGreater(scanline["right"] + scanline["down"], 1.5 * (halton["right"] + halton["down"]))
            self.assertLess(abs(random["right"]) + abs(random["down"]), 0.5 * (scanline["right"] + scanline["down"]))
            self.assertLess(ways["halton"]["off"], ways["halton-plain"]["off"])
            self.assertLess(ways["halton"]["ragged"], ways["halton-plain"]["ragged"])

    def test_edges_lie_on_planes(self):
        """The same shadow, on a floor and on ground where no row of pixels keeps to one plane."""
        lamp = {"type": "point", "intensity": 100}
        with tempfile.TemporaryDirectory() as out:
            path, found = os.path.join(out, "ground.gltf"), []
            for ground in (quad(0, 0, 0, 4), bumps(40, 0.02)):
                write_scene(path, ground + quad(0, 2, 0, 0.5), lamp, {"translation": [0, 4, 0]})
                said = run("edges", path, "--look", "0,1.9,6,0,0,0,60", "--size", "128x128", "--ce", "4", "--picture",
                           os.path.join(out, "e"))
                found.append(said["ways"][0]["edges"])
                for w in said["ways"]:
                    self.assertEqual(w["rows"] + w["columns"], w["edges"])
                if found[-1]:  # the shadow lies in the middle, and so does what is enlarged
                    self.assertTrue(all(said[k] <= 64 < said[k] + said["side"] for k in ("x", "y")), said)
        self.assertGreater(found[0], 30)
        self.assertEqual(found[1], 0)

    def test_cells_of_a_pixel_move_little(self):
        for w in run("edges", "conference-lights", "--size", "192x108", "--ce", "1")["ways"]:
            self.assertGreater(w["edges"], 50)
            self.assertLess(w["off"], 0.5, w)


class Input(unittest.TestCase):
    def test_bad_input_is_said_in_a_line(self):
        for words in (["shadow_maps", "cornell", "--vpls", "4"], ["shadow_maps", "conference-lights", "--map", "30"],
                      ["edges", "conference-lights", "--spp", "4"], ["edges", "nothing"],
                      ["sequence", "conference-lights", "--ways", "cache:x"],
                      ["sequence", "conference-lights", "--ways", "cache"],
                      ["sequence", "cornell", "--vpls", "4", "--ways", "estimate:0"],
                      ["sequence", "conference-lights", "--ways", ","],
                      ["sequence", "atrium", "--spp", "5", "--ways", "grid:NEAR"]):
            said = run(*words, "--size", "16x16", status=1)
            self.assertEqual(len(said.splitlines()), 1, words)
        self.assertEqual(len(run("edges", "--ce", "0", status=2).splitlines()), 1)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
