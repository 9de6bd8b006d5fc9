#!/usr/bin/env python3
"""The same model from every form of one mesh, and the right refusal of every broken one.

usage: forms_test.py PIETRA [unittest arguments]
"""

import gzip
import lzma
import math
import os
import resource
import signal
import struct
import subprocess
import sys
import unittest

import command_line_test
import mesh_forms
from command_line_test import CommandLineTest
from verbs_test import read_ply


def single(x):
    """As float has it, so that all forms say the same."""
    return struct.unpack("f", struct.pack("f", x))[0]


def wavy(n):
    vertices = [tuple(single(c) for c in (i / n, j / n, 0.1 * math.sin(9 * i / n) * math.cos(7 * j / n)))
                for i in range(n + 1) for j in range(n + 1)]
    faces = []
    for i in range(n):
        for j in range(n):
            a, b = i * (n + 1) + j, (i + 1) * (n + 1) + j
            faces += [(a, b, b + 1), (a, b + 1, a + 1)]
    return vertices, faces


VERTICES, FACES = wavy(40)
TETRAHEDRON = ([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)],
               [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


class Forms(CommandLineTest):
    def model(self, name, data, *more):
        self.write(name, data)
        self.build(name, "out.pietra", "--force", "--quiet", *more)
        return self.read("out.pietra")

    def test_equivalent_forms_make_the_same_bytes(self):
        binary = mesh_forms.ply(VERTICES, FACES)
        forms = {
            "ascii.ply": mesh_forms.ply(VERTICES, FACES, "ascii"),
            "crlf.ply": mesh_forms.ply(VERTICES, FACES, "ascii", line="\r\n"),
            "big.ply": mesh_forms.ply(VERTICES, FACES, "binary_big_endian"),
            "double.ply": mesh_forms.ply(VERTICES, FACES, real="double"),
            "wide.ply": mesh_forms.ply(VERTICES, FACES, count="uint", index="uint"),
            "narrow.ply": mesh_forms.ply(VERTICES, FACES, count="char", index="ushort"),
            "short.ply": mesh_forms.ply(VERTICES, FACES, "binary_big_endian", count="short",
                                        index="short"),
            "extra.ply": mesh_forms.ply(VERTICES, FACES, extra=True),
            "extra_text.ply": mesh_forms.ply(VERTICES, FACES, "ascii", extra=True),
            "a mesh, packed.ply.gz": gzip.compress(binary),
            "packed.ply.xz": lzma.compress(binary),
            "plain.obj": mesh_forms.obj(VERTICES, FACES),
            "crlf.obj": mesh_forms.obj(VERTICES, FACES, line="\r\n", extra=True),
            "negative.obj": mesh_forms.obj(VERTICES, FACES, negative=True),
            "textured.obj": mesh_forms.obj(VERTICES, FACES, corner="{}/1"),
            "packed.obj.gz": gzip.compress(mesh_forms.obj(VERTICES, FACES)),
            "short.glb": mesh_forms.glb(VERTICES, FACES),
            "wide.glb": mesh_forms.glb(VERTICES, FACES, "I"),
        }
        expected = self.model("plain.ply", binary)
        for name, data in forms.items():
            with self.subTest(name):
                self.assertTrue(self.model(name, data) == expected)

    def test_quads_and_strips_are_the_triangles_that_they_stand_for(self):
        quads = [(a, b, c, d) for (a, b, c), (_, _, d) in zip(FACES[::2], FACES[1::2])]
        expected = self.model("triangles.ply", mesh_forms.ply(VERTICES, FACES))
        self.assertTrue(self.model("quads.ply", mesh_forms.ply(VERTICES, quads)) == expected)
        self.assertTrue(self.model("quads.obj", mesh_forms.obj(VERTICES, quads)) == expected)

    def test_stl_is_welded(self):
        def surface(name, data):
            self.model(name, data)
            run = self.run_pietra("extract", "out.pietra", "-o", "x.ply", "--full", "--force")
            self.assertEqual(run.returncode, 0, run.stderr)
            _, vertices, triangles = read_ply(self.read("x.ply"))
            corners = sorted(sorted(vertices[i][:3] for i in t) for t in triangles)
            return len(vertices), corners
        expected = surface("m.ply", mesh_forms.ply(VERTICES, FACES))
        self.assertEqual(surface("m.stl", mesh_forms.stl(VERTICES, FACES)), expected)
        self.assertEqual(surface("t.stl", mesh_forms.stl(VERTICES, FACES, text=True)), expected)

    def test_files_are_one_model(self):
        half = len(FACES) // 2
        self.write("a.ply", mesh_forms.ply(VERTICES, FACES[:half]))
        self.write("b.obj", mesh_forms.obj(VERTICES, FACES[half:]))
        self.assertEqual(self.run_pietra("build", "a.ply", "b.obj", "-o", "m.pietra").returncode, 0)
        run = self.run_pietra("check", "m.pietra", "--input", "a.ply", "b.obj")
        self.assertEqual(run.returncode, 0, run.stdout)


class Refusals(CommandLineTest):
    """Name, bytes, exit code, words of the message. Nothing may be left behind."""

    def check(self, name, data, code, *words):
        with self.subTest(name):
            if data is not None:
                self.write(name, data)
            run = self.run_pietra("build", name, "-o", "out.pietra")
            self.assertEqual(run.returncode, code, run.stderr)
            line = run.stderr.strip().split("\n")[-1]
            self.assertTrue(line.startswith(f"pietra: {name}"), line)
            for word in words:
                self.assertIn(word, line)
            left = [f for f in os.listdir(self.folder) if "pietra" in f]
            self.assertEqual(left, [])

    def test_broken_inputs(self):
        v, f = TETRAHEDRON
        os.mkdir(self.path("folder.ply"))
        self.check("missing.ply", None, 4, "No such file")
        self.check("folder.ply", None, 4, "directory")
        self.check("empty.ply", b"", 3, "empty")
        self.check("empty.obj", b"", 3, "empty")
        self.check("noise.bin", bytes(range(256)) * 9, 3, "no format")
        for form in ("ascii", "binary_little_endian", "binary_big_endian"):
            whole = mesh_forms.ply(v, f, form)
            self.check(f"{form}-cut.ply", whole[:-9], 3, "end")
            self.check(f"{form}-far.ply", mesh_forms.ply(v, f[:3] + [(1, 2, 4)], form), 3, "4")
            self.check(f"{form}-negative.ply", mesh_forms.ply(v, f[:3] + [(1, 2, -1)], form), 3)
            bad = v[:3] + [(float("nan"), 0.0, 1.0)]
            self.check(f"{form}-nan.ply", mesh_forms.ply(bad, f, form), 3)
            bad = v[:3] + [(float("inf"), 0.0, 1.0)]
            self.check(f"{form}-inf.ply", mesh_forms.ply(bad, f, form), 3)
            self.check(f"{form}-none.ply", mesh_forms.ply(v, [], form), 3, "nothing to show")
            self.check(f"{form}-degenerate.ply", mesh_forms.ply(v, [(0, 0, 1)] * 9, form), 3,
                       "degenerate")
            self.check(f"{form}-huge.ply", mesh_forms.ply(
                [(1e300 * x, y, z) for x, y, z in v] + [(-1e308, 0.0, 0.0)], f, form,
                real="double"), 3)
        tiny = [(1e-300 * x, 1e-300 * y, 1e-300 * z) for x, y, z in v]
        self.check("tiny.ply", mesh_forms.ply(tiny, f, real="double"), 3, "lattice")
        lies = mesh_forms.ply(v, f).replace(b"element face 4", b"element face 4000000000")
        self.check("lies.ply", lies, 3)
        self.check("cut.ply.gz", gzip.compress(mesh_forms.ply(v, f))[:-20], 3)
        self.check("cut.ply.xz", lzma.compress(mesh_forms.ply(v, f))[:-20], 3)
        self.check("far.obj", mesh_forms.obj(v, f[:3] + [(1, 2, 4)]), 3, "line 8", "5")
        self.check("zero.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", 3, "line 4")
        self.check("short.obj", b"v 0 0\nf 1 1 1\n", 3, "line 1")
        self.check("two.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", 3, "line 4")
        self.check("points.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", 3)
        stl = mesh_forms.stl(v, f)
        self.check("cut.stl", stl[:-10], 3)
        self.check("lies.stl", stl[:80] + struct.pack("<I", 4000000000) + stl[84:], 3)
        self.check("cut-text.stl", mesh_forms.stl(v, f, text=True)[:-40], 3, "line")
        glb = mesh_forms.glb(v, f)
        self.check("cut.glb", glb[:-10], 3)
        self.check("far.glb", mesh_forms.glb(v, f[:3] + [(1, 2, 4)]), 3)
        self.check("version.glb", glb[:4] + struct.pack("<I", 9) + glb[8:], 3)
        self.check("draco.gltf", b'{"asset":{"version":"2.0"},"extensionsRequired":'
                   b'["KHR_draco_mesh_compression"]}', 3, "KHR_draco_mesh_compression")

    def test_what_is_odd_but_right(self):
        v, f = TETRAHEDRON
        far = [(4e6 + x, 6e6 + y, 100 + z) for x, y, z in v]
        for name, data in (("one.ply", mesh_forms.ply(v, f[:1])),
                           ("same.ply", mesh_forms.ply(v, f[:1] * 100000)),
                           ("far.ply", mesh_forms.ply(far, f, real="double")),
                           ("small.ply", mesh_forms.ply(
                               [(1e-30 * x, 1e-30 * y, 1e-30 * z) for x, y, z in v], f)),
                           ("a b'c\".ply", mesh_forms.ply(v, f))):
            with self.subTest(name):
                self.write(name, data)
                self.build(name, "out.pietra", "--force", "--quiet")
                self.assertEqual(self.run_pietra("check", "out.pietra").returncode, 0)

    def test_a_name_that_is_no_text(self):
        name = os.fsencode(self.folder) + b"/\xff\xfe.ply"
        with open(name, "wb") as file:
            file.write(mesh_forms.ply(*TETRAHEDRON))
        run = subprocess.run([command_line_test.PIETRA, "build", name, "-o", "out.pietra"],
                             cwd=self.folder, capture_output=True, timeout=60)
        self.assertEqual(run.returncode, 0, run.stderr)

    def test_no_room_for_the_output(self):
        self.write("m.ply", mesh_forms.ply(VERTICES, FACES))
        self.build("m.ply", "m.pietra")

        def little_room():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # then writing fails, as on a full disk
            resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
        for verb in (["build", "m.ply", "-o", "out"],
                     ["extract", "m.pietra", "-o", "out.ply", "--full"],
                     ["extract", "m.pietra", "-o", "out.glb", "--full"],
                     ["render", "m.pietra", "-o", "out.png"],
                     ["synth", "sphere", "-o", "out.ply", "--triangles", "100k"]):
            with self.subTest(verb):
                run = self.run_pietra(*verb, preexec_fn=little_room)
                self.assertEqual(run.returncode, 4, run.stderr)
                self.assertIn("File too large", run.stderr)
                self.assertEqual([f for f in os.listdir(self.folder) if f.startswith("out")], [])

    def test_damaged_models_in_every_verb(self):
        self.write("m.ply", mesh_forms.ply(VERTICES, FACES))
        self.build("m.ply", "m.pietra", "--leaf-triangles", "300", "--patch-triangles", "200")
        whole = self.read("m.pietra")
        verbs = (["info", "x"], ["check", "x"], ["extract", "x", "-o", "x.ply", "--full"],
                 ["render", "x", "-o", "x.png"], ["bench", "x", "--path", "orbit", "--frames", "2"])
        for cut in (0, 1, 40, 128, 500):
            self.write("x", whole[:cut])
            for verb in verbs:
                with self.subTest(verb=verb[0], cut=cut):
                    run = self.run_pietra(*verb)
                    self.assertEqual(run.returncode, 3, run.stderr)
                    self.assertTrue(run.stderr.startswith("pietra: x: "), run.stderr)
        middle = len(whole) // 2
        self.write("x", whole[:middle] + bytes(64) + whole[middle + 64:])
        for verb in (verbs[1], verbs[2], verbs[3] + ["--pixels", "0"]):
            with self.subTest(verb=verb[0]):
                self.assertEqual(self.run_pietra(*verb).returncode, 3)
        self.assertFalse(os.path.exists(self.path("x.ply")))
        self.assertFalse(os.path.exists(self.path("x.png")))


if __name__ == "__main__":
    command_line_test.PIETRA = os.path.abspath(sys.argv.pop(1))
    unittest.main()
