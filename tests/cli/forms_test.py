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

    def test_names_of_any_bytes(self):
        v, f = TETRAHEDRON
        for name, data in ((b"\xff\xfe.ply", mesh_forms.ply(v, f)),
                           (b" a\xffb 'c\".obj", mesh_forms.obj(v, f)),
                           (b"-\n.stl", mesh_forms.stl(v, f)), (b"%20\xc3.glb", mesh_forms.glb(v, f))):
            path = os.fsencode(self.folder) + b"/" + name
            with open(path, "wb") as file:
                file.write(data)
            for verb in (["build", path, "-o", path + b".pietra"], ["check", path + b".pietra"],
                         ["render", path + b".pietra", "-o", path + b".png", "--size", "64x64"]):
                run = subprocess.run([command_line_test.PIETRA, *verb], cwd=self.folder,
                                     capture_output=True, timeout=60)
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
        os.mkdir(self.path("folder"))
        verbs = (["info", "x"], ["check", "x"], ["extract", "x", "-o", "x.ply", "--full"],
                 ["render", "x", "-o", "x.png"], ["view", "x", "--renderer", "cpu"],
                 ["bench", "x", "--path", "orbit", "--frames", "2", "--report", "x.json"])

        def refused(verb, x, code, what):
            with self.subTest(verb=verb[0], x=x):
                run = self.run_pietra(*(x if word == "x" else word for word in verb))
                self.assertEqual(run.returncode, code, run.stderr)
                self.assertEqual(run.stderr, f"pietra: {x}: {what}\n")
                self.assertEqual([f for f in os.listdir(self.folder) if f.startswith("x.")], [])
        bad = {"missing": (4, "cannot open: No such file or directory"),
               "folder": (4, "cannot open: Is a directory"),
               "/dev/stdin": (3, "is a pipe or device, not a file"),
               "m.ply": (3, "byte 0: this is no Pietra model")}
        for cut in (0, 1, 40, 128, 500, 5000):
            self.write(f"cut{cut}", whole[:cut])
            bad[f"cut{cut}"] = 3, ("byte 0: this is no Pietra model" if cut < 8 else
                                   f"byte {cut}: the file ends early, within its header" if cut <= 500
                                   else f"byte {cut}: the file ends early, {len(whole) - cut} bytes short")
        self.write("long", whole + b"more")
        bad["long"] = 3, f"byte {len(whole)}: 4 bytes too many follow the model"
        for verb in verbs:
            for x, (code, what) in bad.items():
                # What is no model may be a mesh, which the window offers to build.
                if verb[0] != "view" or not what.startswith(("byte 0", "is a pipe")):
                    refused(verb, x, code, what)
        for x in ("missing", "folder"):
            refused(["compare", "x", "x"], x, *bad[x])
        self.write("x", whole)
        run = self.run_pietra("build", "x", "-o", "y.pietra")
        self.assertEqual((run.returncode, run.stderr), (
            3, "pietra: x: is of no format that Pietra reads (PLY, STL, glTF, OBJ)\n"))
        middle = len(whole) // 2
        self.write("x", whole[:middle] + bytes(64) + whole[middle + 64:])
        for verb in (verbs[1], verbs[2], verbs[3] + ["--pixels", "0"]):
            with self.subTest(verb=verb[0]):
                self.assertEqual(self.run_pietra(*verb).returncode, 3)
        self.assertFalse(os.path.exists(self.path("x.ply")))
        self.assertFalse(os.path.exists(self.path("x.png")))


class OddForms(CommandLineTest):
    """What real programs write: it is read, or refused with its line."""

    def outcome(self, name, data):
        """The colours of the model made of it, its triangles and the warnings; or the fault."""
        self.write(name, data)
        run = self.run_pietra("build", name, "-o", "o.pietra", "--force")
        warnings = [line.split("warning: ")[1] for line in run.stderr.splitlines() if "warning" in line]
        if run.returncode != 0:
            self.assertEqual(run.returncode, 3, run.stderr)
            return run.stderr.strip().removeprefix(f"pietra: {name}: ")
        self.run_pietra("extract", "o.pietra", "-o", "o.ply", "--full", "--force")
        names, vertices, triangles = read_ply(self.read("o.ply"))
        colours = {v[names.index("red"):][:4] for v in map(tuple, vertices)} if "red" in names else None
        return len(triangles), colours, warnings

    def expect(self, table):
        for name, (data, expected) in table.items():
            with self.subTest(name):
                result = self.outcome(name, data)
                self.assertEqual(result if isinstance(expected, str) else result[:len(expected)],
                                 expected)

    def test_ply(self):
        v, f = TETRAHEDRON
        text = mesh_forms.ply(v, f, "ascii")

        def with_colours(kind, names, values):
            head = "".join(f"property {kind} {n}\n" for n in names.split()).encode()
            lines = text.replace(b"element face", head + b"element face").split(b"\n")
            first = lines.index(b"end_header") + 1
            for i in range(first, first + 4):
                lines[i] += b" " + values
            return b"\n".join(lines)
        rgb = {(255, 128, 0, 255)}
        self.expect({
            "uchar.ply": (with_colours("uchar", "red green blue", b"255 128 0"), (4, rgb, [])),
            "float.ply": (with_colours("float", "red green blue", b"1.0 0.5 0"), (4, rgb, [])),
            "uint.ply": (with_colours("uint", "red green blue", b"255 128 0"), (4, rgb, [])),
            "short.ply": (with_colours("ushort", "r g b", b"65535 32896 0"), (4, rgb, [])),
            "diffuse.ply": (with_colours("uchar", "diffuse_red diffuse_green diffuse_blue",
                                         b"255 128 0"), (4, rgb, [])),
            "alpha.ply": (with_colours("uchar", "red green blue alpha", b"255 128 0 9"),
                          (4, {(255, 128, 0, 9)}, [])),
            "index.ply": (text.replace(b"list uchar int vertex_indices",
                                       b"list uint8 int32 vertex_index"), (4, None, [])),
            "info.ply": (text.replace(b"comment", b"obj_info num_cols 5\nobj_info\ncomment"), (4,)),
            "mark.ply": (b"\xef\xbb\xbf" + text, (4,)),
            "cr.ply": (text.replace(b"\n", b"\r"), (4,)),
            "tabs.ply": (text.replace(b" ", b"\t"), (4,)),
            "blanks.ply": (text.replace(b"1.0 0.0 0.0\n", b" 1e+0  +.0 -0E5  \n\n") + b"\n \n", (4,)),
            "comma.ply": (text.replace(b"1.0 0.0 0.0", b"1,0 0,0 0,0"),
                          'line 12: "1,0" is no number (property x of element vertex)'),
            "hex.ply": (text.replace(b"1.0 0.0 0.0", b"0x1 0 0"),
                        'line 12: "0x1" is no number (property x of element vertex)'),
            "nan.ply": (text.replace(b"1.0 0.0 0.0", b"nan(ind) 0 0"),
                        "line 12: vertex 1 is at (nan, 0, 0), which is no point"),
            "qnan.ply": (text.replace(b"1.0 0.0 0.0", b"1.#QNAN 0 0"),
                         'line 12: "1.#QNAN" is no number (property x of element vertex)'),
            "texture.ply": (with_colours("float", "s t", b"0 1"),
                            (4, None, ["texture coordinates are left out"])),
        })

    def test_obj(self):
        v, f = TETRAHEDRON
        text = mesh_forms.obj(v, f)
        orange = b"".join(b"v %g %g %g 1 0.5 0\n" % p for p in v)
        faces = text[text.index(b"f"):]
        rgb = {(255, 128, 0, 255)}
        self.expect({
            "rgb.obj": (orange + faces, (4, rgb, [])),
            "rgb255.obj": (orange.replace(b"1 0.5 0\n", b"255 128 0\n") + faces, (4, rgb, [])),
            "some.obj": (text.replace(b"v 0.0 0.0 0.0", b"v 0 0 0 1 0 0"),
                         (4, {(255, 0, 0, 255), (255, 255, 255, 255)}, [])),
            "joined.obj": (text.replace(b"f 1 3 2", b"f 1 \\\n 3 \\\r\n2"), (4, None, [])),
            "blanks.obj": (text.replace(b" ", b" \t ").replace(b"\n", b"  # why\n"), (4, None, [])),
            "cr.obj": (text.replace(b"\n", b"\r"), (4, None, [])),
            "mark.obj": (b"\xef\xbb\xbf" + text.rstrip(b"\n"), (4, None, [])),
            "groups.obj": (b"o W\xfcrfel\ng a b\ns off\n" + text, (4, None, [])),
            "materials.obj": (b"mtllib a b.mtl\nusemtl c\n" + text, (4, None, ["materials are left out"])),
            "paint.obj": (text + b"#MRGB ffff0000ff00ff00ff0000ffffffffff\n",
                          (4, None, ["the colours in comments (#MRGB) are left out"])),
            "numbers.obj": (text.replace(b"v 1.0 0.0 0.0", b"v +1. 1e-300 0E+5"), (4, None, [])),
            "padded.obj": (text + bytes(9), (4, None, [])),
            "others.obj": (text + b"vp 0.5\np 1\nl 1 2\ncall x.obj\n", (4, None, [
                "1 lines and 1 statements of points are left out",
                "free-form curves and surfaces are left out",
                '1 statements of no known kind are left out ("call" on line 12)'])),
            "comma.obj": (text.replace(b"v 1.0", b"v 1,0"), 'line 2: "1,0" is no number (x of a vertex)'),
            "hex.obj": (text.replace(b"v 1.0", b"v 0x1"), 'line 2: "0x1" is no number (x of a vertex)'),
            "page.obj": (b"<!DOCTYPE html><html>404</html>",
                         'line 1: "<!DOCTYPE" begins no statement of an OBJ file'),
            "wide.obj": (text.decode().encode("utf-16"),
                         'line 1: "??v?" begins no statement of an OBJ file'),
        })

    def test_stl(self):
        v, f = TETRAHEDRON
        binary, text = mesh_forms.stl(v, f), mesh_forms.stl(v, f, text=True)
        paint = binary[:84] + b"".join(binary[i:i + 48] + b"\x1f\x80" for i in range(84, 284, 50))
        self.expect({
            "solid.stl": (b"solid" + binary[5:], (4, None, [])),
            "nameless": (binary, (4, None, [])),
            "paint.stl": (paint, (4, None, ["the 16-bit attributes of 4 facets (colours, in some "
                                            "programs) are left out"])),
            "padded.stl": (binary + b"more", (4, None, ["4 bytes after the last triangle are left out"])),
            "upper.stl": (text.upper(), (4, None, [])),
            "cr.stl": (text.replace(b"\n", b"\r"), (4, None, [])),
            "normals.stl": (text.replace(b"normal 0 0 0", b"normal nan 1.#IND -nan(ind)"), (4, None, [])),
            "none.stl": (b"solid x\nendsolid x\n", "has no triangles: nothing to show"),
            "open.stl": (text.replace(b"endsolid thing\n", b""),
                         "line 30: the file ends within a solid, after 4 triangles"),
            "comma.stl": (text.replace(b"vertex 1.0", b"vertex 1,0"),
                          'line 6: "1,0" stands where a number is expected'),
        })

    def test_glb(self):
        v, f = TETRAHEDRON

        def glb(**scene):
            return mesh_forms.glb(v, f, change=lambda s: s.update(scene))
        rgb, half = {(255, 128, 0, 255)}, {(255, 128, 0, 128)}
        cases = {f"{kind}-{component}.glb": (mesh_forms.glb(v, f, change=mesh_forms.coloured(
            kind, component, pack, values)), (4, expected, [])) for kind, component, pack, values, expected in (
                ("VEC3", 5126, "<3f", (1, 0.5, 0), rgb), ("VEC4", 5126, "<4f", (1, 0.5, 0, 0.5), half),
                ("VEC3", 5121, "<3B", (255, 128, 0), rgb), ("VEC4", 5121, "<4B", (255, 128, 0, 128), half),
                ("VEC3", 5123, "<3H", (65535, 32896, 0), rgb),
                ("VEC4", 5123, "<4H", (65535, 32896, 0, 32896), half))}
        cases["nested.glb"] = glb(nodes=[{"children": [1], "scale": [-1, 1, 1]},
                                         {"mesh": 0, "translation": [5, 0, 0]}]), (4, None, [])
        cases["sceneless.glb"] = mesh_forms.glb(v, f, change=lambda s: s.pop("scenes") and None), (4,)
        cases["packed.glb.gz"] = gzip.compress(glb()), (4, None, [])
        cases["circle.glb"] = (glb(nodes=[{"mesh": 0, "children": [0]}]),
                               "nodes[0].children: node 0 has another parent, or is below itself")
        for name in ("KHR_draco_mesh_compression", "EXT_meshopt_compression"):
            cases[name + ".glb"] = (
                glb(extensionsRequired=[name]), f"extensionsRequired: Pietra does not know the extension "
                f"{name}, without which the file cannot be read")
        cases["quantised.glb"] = glb(extensionsRequired=["KHR_mesh_quantization"]), (4,)
        self.expect(cases)


class Pipes(CommandLineTest):
    def test_every_form_through_a_pipe(self):
        v, f = TETRAHEDRON
        for data in (mesh_forms.ply(v, f), mesh_forms.ply(v, f, "ascii"), mesh_forms.obj(v, f),
                     mesh_forms.stl(v, f), mesh_forms.stl(v, f, text=True), mesh_forms.glb(v, f),
                     gzip.compress(mesh_forms.ply(v, f))):
            run = subprocess.run([command_line_test.PIETRA, "build", "/dev/stdin", "-o", "m.pietra",
                                  "--force"], input=data, cwd=self.folder, capture_output=True, timeout=60)
            self.assertEqual(run.returncode, 0, run.stderr)
            self.assertIn(b": 4 triangles", run.stderr)
            self.assertEqual(os.listdir(self.folder), ["m.pietra"])

    def test_a_bad_mesh_through_a_pipe(self):
        run = subprocess.run([command_line_test.PIETRA, "build", "/dev/stdin", "-o", "m.pietra"],
                             input=b"v 0 0\n", cwd=self.folder, capture_output=True, timeout=60)
        self.assertEqual((run.returncode, run.stderr.decode()),
                         (3, "pietra: /dev/stdin: has vertices but no faces: a cloud of points is nothing to "
                             "show\n"))
        self.assertEqual(os.listdir(self.folder), [])


if __name__ == "__main__":
    command_line_test.PIETRA = os.path.abspath(sys.argv.pop(1))
    unittest.main()
