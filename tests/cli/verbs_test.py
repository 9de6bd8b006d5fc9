#!/usr/bin/env python3
"""Verbs that make and show things: synthetic meshes, pictures, extracted meshes as others read them.

usage: verbs_test.py PIETRA [unittest arguments]
"""

import collections
import json
import math
import os
import struct
import subprocess
import sys
import tempfile
import unittest

import command_line_test
from command_line_test import CommandLineTest, write_torus

WIDTHS = {"float": "f", "double": "d", "uchar": "B"}


def read_ply(data):
    """Names of the vertices' properties, the vertices, and the triangles of a PLY that we wrote."""
    head, body = data.split(b"end_header\n", 1)
    counts, names, code, part = {}, [], "<", ""
    for line in head.decode().split("\n"):
        words = line.split()
        if words[:1] == ["element"]:
            part = words[1]
            counts[part] = int(words[2])
        elif words[:1] == ["property"] and part == "vertex":
            code += WIDTHS[words[1]]
            names.append(words[2])
    size = struct.calcsize(code) * counts["vertex"]
    vertices = list(struct.iter_unpack(code, body[:size]))
    triangles = [t[1:] for t in struct.iter_unpack("<BIII", body[size:])]
    assert len(vertices) == counts["vertex"] and len(triangles) == counts["face"]
    return names, vertices, triangles


def read_floats(data):
    """Vertices and triangles of what write_torus() writes."""
    head, body = data.split(b"end_header\n", 1)
    count = int(head.split(b"element vertex ")[1].split()[0])
    return (list(struct.iter_unpack("<fff", body[:12 * count])),
            [t[1:] for t in struct.iter_unpack("<BIII", body[12 * count:])])


def mesh_text(vertices, triangles):
    """An ASCII PLY."""
    head = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}", "property float x",
            "property float y", "property float z", f"element face {len(triangles)}",
            "property list uchar int vertex_indices", "end_header"]
    rows = ["%.9g %.9g %.9g" % v for v in vertices] + ["3 %d %d %d" % t for t in triangles]
    return "\n".join(head + rows) + "\n"


def edge_uses(triangles):
    """How many edges are used by how many triangles, without regard to direction."""
    uses = collections.Counter()
    for a, b, c in triangles:
        for edge in ((a, b), (b, c), (c, a)):
            uses[min(edge), max(edge)] += 1
    return collections.Counter(uses.values())


class VerbTest(CommandLineTest):
    def report(self, *arguments, code=0):
        """The JSON on standard output."""
        run = self.run_pietra(*arguments)
        self.assertEqual(run.returncode, code, run.stderr)
        return json.loads(run.stdout)


class Synth(VerbTest):
    def test_every_kind(self):
        for kind in ("sphere", "statue", "terrain"):
            made = self.report("synth", kind, "-o", f"{kind}.ply", "--triangles", "3k", "--report", "-")
            self.assertEqual(made["kind"], kind)
            self.assertTrue(1000 < made["triangles"] < 9000, made)
            names, vertices, triangles = read_ply(self.read(f"{kind}.ply"))
            self.assertEqual((len(vertices), len(triangles)), (made["vertices"], made["triangles"]))
            closed = set(edge_uses(triangles)) == {2}
            self.assertEqual(closed, kind != "terrain")

    def test_the_seed_decides(self):
        for name, seed in (("a", "1"), ("b", "1"), ("c", "2")):
            self.report("synth", "statue", "-o", f"{name}.ply", "--triangles", "2k", "--seed", seed,
                        "--report", "-")
        self.assertEqual(self.read("a.ply"), self.read("b.ply"))
        self.assertNotEqual(self.read("a.ply"), self.read("c.ply"))

    def test_subdivide(self):
        write_torus(self.path("torus.ply"), 20, 12)
        made = self.report("synth", "subdivide", "torus.ply", "-o", "fine.ply", "--levels", "2",
                           "--displace", "0.2", "--report", "-")
        self.assertEqual(made["triangles"], 480 * 16)
        self.assertEqual(set(edge_uses(read_ply(self.read("fine.ply"))[2])), {2})
        flat = self.report("synth", "subdivide", "torus.ply", "-o", "flat.obj", "--levels", "2",
                           "--displace", "0", "--report", "-")
        self.assertEqual(flat["vertices"], made["vertices"])

    def test_refusals(self):
        end = " (see pietra synth --help)"
        refuse = self.assertRefused
        refuse(["synth"], 2, "synth: KIND is missing" + end)
        refuse(["synth", "cube", "-o", "x.ply"], 2,
               'synth knows no "cube", but sphere, statue, terrain, earth, subdivide')
        refuse(["synth", "sphere", "-o", "x.abc"], 2,
               "x.abc: the name of a mesh ends in .ply, .obj, .stl or .glb")
        refuse(["synth", "sphere", "-o", "x.ply", "--levels", "2"], 2,
               "--levels: goes with synth subdivide only")
        refuse(["synth", "sphere", "-o", "x.ply", "--displace", "0.1"], 2,
               "--displace: goes with synth subdivide only")
        refuse(["synth", "sphere", "in.ply", "-o", "x.ply"], 2,
               "synth sphere takes no input, 'in.ply' was given")
        refuse(["synth", "subdivide", "-o", "x.ply"], 2, "synth subdivide needs a mesh to subdivide")
        refuse(["synth", "subdivide", "in.ply", "-o", "x.ply", "--triangles", "5"], 2,
               "--triangles: synth subdivide is told --levels instead")
        refuse(["synth", "subdivide", "none.ply", "-o", "x.ply"], 4,
               "none.ply: cannot open: No such file or directory")
        self.write("x.ply", "mine")
        refuse(["synth", "sphere", "-o", "x.ply"], 2, "x.ply: exists; --force overwrites it")


class Shown(VerbTest):
    """A statue, closed, and a terrain, open and with attributes, each as a model."""

    @classmethod
    def setUpClass(cls):
        cls.shared = tempfile.TemporaryDirectory(prefix="pietra-verbs-")
        for kind in ("statue", "terrain"):
            for arguments in (["synth", kind, "-o", f"{kind}.ply", "--triangles", "20k"],
                              ["build", f"{kind}.ply", "-o", f"{kind}.pietra",
                               "--leaf-triangles", "500", "--patch-triangles", "300"]):
                subprocess.run([command_line_test.PIETRA, *arguments, "--quiet"],
                               cwd=cls.shared.name, check=True)

    @classmethod
    def tearDownClass(cls):
        cls.shared.cleanup()

    def setUp(self):
        super().setUp()
        for name in os.listdir(self.shared.name):
            os.symlink(os.path.join(self.shared.name, name), self.path(name))

    def extract(self, model, *arguments):
        """What is written, as the three parts of read_ply()."""
        self.report("extract", f"{model}.pietra", "-o", "x.ply", "--force", "--report", "-",
                    *arguments)
        return read_ply(self.read("x.ply"))

    def test_a_closed_mesh_is_closed_in_every_cut(self):
        info = self.report("info", "statue.pietra", "--json")
        full = self.extract("statue", "--full")
        self.assertEqual(len(full[2]), info["input"]["triangles"])
        self.assertEqual(len(full[1]), info["input"]["vertices"])
        for cut in (full, self.extract("statue", "--triangles", "4k"),
                    self.extract("statue", "--error", str(info["max_error"] / 20))):
            names, vertices, triangles = cut
            self.assertEqual(set(edge_uses(triangles)), {2})
            self.assertEqual(len(set(vertices)), len(vertices))
            self.assertEqual(len({v for t in triangles for v in t}), len(vertices))

    def test_an_open_mesh_keeps_its_border_and_its_attributes(self):
        before = read_ply(self.read("terrain.ply"))
        after = self.extract("terrain", "--full")
        self.assertEqual(sorted(before[0]), sorted(after[0]))
        self.assertEqual(edge_uses(before[2]), edge_uses(after[2]))
        kept = [name for name in before[0] if name not in ("x", "y", "z", "nx", "ny", "nz")]
        self.assertIn("red", kept)
        columns = lambda mesh: sorted(tuple(v[mesh[0].index(name)] for name in kept) for v in mesh[1])
        self.assertEqual(columns(before), columns(after))

    def test_memory_and_threads_change_no_byte(self):
        self.extract("statue", "--full")
        first = self.read("x.ply")
        self.extract("statue", "--full", "--memory", "100M", "--jobs", "1")
        self.assertEqual(self.read("x.ply"), first)

    def test_below_the_finest_bound_the_finest_is_written_with_a_warning(self):
        run = self.run_pietra("extract", "statue.pietra", "-o", "x.ply", "--error", "0", "--report", "-")
        report = json.loads(run.stdout)
        self.assertEqual(run.returncode, 0)
        self.assertIn("the finest is written", run.stderr)
        self.assertEqual(report["triangles"],
                         self.report("info", "statue.pietra", "--json")["input"]["triangles"])
        self.assertGreater(report["max_error"], 0)

    def test_a_progressive_mesh_is_built_checked_and_extracted(self):
        self.report("build", "statue.ply", "-o", "fine.pietra", "--method", "pmesh", "--report", "-")
        info = self.report("info", "fine.pietra", "--json")
        self.assertEqual(info["method"], "pmesh")
        self.assertTrue(self.report("check", "fine.pietra", "--input", "statue.ply", "--json")["ok"])
        for of, extra in (("input", ["--input", "statue.ply"]), ("finest cut", [])):
            said = self.run_pietra("check", "fine.pietra", *extra).stdout
            self.assertIn(f"against the {of}", said)
        full = self.extract("fine", "--full")
        self.assertEqual(len(full[2]), info["input"]["triangles"])
        few = self.extract("fine", "--triangles", "1000")
        self.assertTrue(900 < len(few[2]) <= 1000)
        coarse = self.extract("fine", "--error", str(info["max_error"] / 20))
        for names, vertices, triangles in (full, few, coarse):
            self.assertEqual(set(edge_uses(triangles)), {2})

    def test_a_progressive_mesh_is_drawn_and_flown_through(self):
        self.report("build", "statue.ply", "-o", "fine.pietra", "--method", "pmesh", "--report", "-",
                    "--force")
        full = self.render("full.png", "--pixels", "0", "--cull", "none")
        fine = self.render("fine.png", models=("fine.pietra",))
        all_of_it = self.render("all.png", "--pixels", "0", "--cull", "none",
                                models=("fine.pietra",))
        self.assertEqual(all_of_it["triangles"], full["triangles"])
        in_parts = self.render("parts.png", "--pixels", "0", "--cull", "none", "--ram", "8M",
                               models=("fine.pietra",))
        self.assertGreater(in_parts["patches"], all_of_it["patches"])
        self.assertEqual(in_parts["triangles"], full["triangles"])
        self.assertEqual(self.read("parts.png"), self.read("all.png"))
        self.assertLess(fine["triangles"], full["triangles"] / 2)
        self.assertEqual(fine["tolerance_px"], 1)
        self.assertEqual((full["errors_proven"], fine["errors_proven"]), (True, True))
        self.assertEqual(self.run_pietra("compare", "all.png", "full.png", "--max-px", "1.5")
                         .returncode, 0)
        self.assertEqual(self.run_pietra("compare", "fine.png", "full.png", "--max-px", "1.5")
                         .returncode, 0)
        both = self.render("both.png", models=("fine.pietra", "statue.pietra"))
        self.assertGreater(both["triangles"], fine["triangles"])
        flight = self.report("bench", "fine.pietra", "statue.pietra", "--path", "orbit", "--frames",
                             "8", "--size", "200x160", "--report", "-")
        self.assertTrue(any(frame["operations"] > 0 for frame in flight["frames"]))

    def test_face_clusters_are_selected_by_area(self):
        self.report("build", "statue.ply", "-o", "faces.pietra", "--method", "cluster", "--report",
                    "-", "--force")
        self.assertEqual(self.report("check", "faces.pietra", "--json")["ok"], True)
        drawn = [self.render(f"{pixels}.png", "--select", "area", "--pixels", str(pixels),
                             "--cull", "none", models=("faces.pietra",))
                 for pixels in (1, 4, 16, 64)]
        triangles = [picture["triangles"] for picture in drawn]
        self.assertEqual(triangles, sorted(triangles, reverse=True))
        self.assertGreater(triangles[1], 4 * triangles[3])
        # Two pictures of 4 x 4 pixels a face or less, whatever they show.
        self.assertGreater(triangles[1], drawn[1]["pixels_covered"] / 16)
        by_error = self.render("error.png", "--pixels", "4", "--cull", "none",
                               models=("faces.pietra",))
        self.assertLess(by_error["triangles"], triangles[1])
        flight = self.report("bench", "faces.pietra", "--path", "orbit", "--frames", "4", "--size",
                             "200x160", "--pixels", "4", "--select", "area", "--report", "-")
        self.assertEqual(flight["select"], "area")
        for verb in (["render", "-o", "x.png"], ["bench", "--path", "orbit", "--frames", "4"]):
            run = self.run_pietra(verb[0], "faces.pietra", "statue.pietra", *verb[1:], "--select",
                                  "area")
            self.assertEqual(run.returncode, 2)
            self.assertIn("statue.pietra: does not say how large its faces are", run.stderr)

    def render(self, name, *arguments, models=("statue.pietra",)):
        return self.report("render", *models, "-o", name, "--size", "200x160", "--report", "-",
                           *arguments)

    def test_ram_changes_no_pixel(self):
        self.render("a.png", "--pixels", "0")
        run = self.run_pietra("render", "statue.pietra", "-o", "b.png", "--size", "200x160", "--ram",
                              "1k")
        least = float(run.stderr.split("needs ")[1].split()[0])
        self.assertIn(" MiB at least", run.stderr)
        self.render("b.png", "--pixels", "0", "--ram", f"{least + 0.2:.2f}M", "--jobs", "1")
        self.assertEqual(self.read("a.png"), self.read("b.png"))

    def test_culling_and_light(self):
        shown = self.render("none.png", "--cull", "none")
        for word in ("frustum", "cone", "occlusion", "all"):
            self.assertLessEqual(self.render(f"{word}.png", "--cull", word)["triangles"],
                                 shown["triangles"])
            same = self.report("compare", "none.png", f"{word}.png", "--json", "--max-px", "1",
                               "--max-shade", "8")
            self.assertTrue(same["ok"])
        self.assertEqual(self.read("occlusion.png"), self.read("none.png"))
        self.render("left.png", "--light", "-1,0,0")
        self.report("compare", "none.png", "left.png", "--json", "--max-shade", "8", code=6)

    def test_only_closed_components_are_culled_by_their_normals(self):
        write_torus(self.path("torus.ply"), 150, 60)
        vertices, triangles = read_floats(self.read("torus.ply"))
        side, first = 40, len(vertices)  # an open sheet below, a little bent
        for i in range(side + 1):
            for j in range(side + 1):
                x, y = 10 * i / side - 5, 10 * j / side - 5
                vertices.append((x, y, -4 + 0.02 * x * y))
        for i in range(side):
            for j in range(side):
                a = first + i * (side + 1) + j
                triangles += [(a, a + side + 1, a + 1), (a + 1, a + side + 1, a + side + 2)]
        self.write("mixed.ply", mesh_text(vertices, triangles))
        self.report("build", "mixed.ply", "-o", "mixed.pietra", "--leaf-triangles", "300",
                    "--patch-triangles", "200", "--report", "-")
        for name, eye in (("above", [6, -9, 11]), ("below", [6, -9, -16])):
            self.write("c.json", json.dumps({"eye": eye, "target": [0, 0, -2], "up": [0, 0, 1],
                                             "fovy_deg": 45}))
            for pixels in ("0", "2"):
                def shown(picture, *arguments):
                    return self.render(picture, "--force", "--camera", "c.json", "--pixels", pixels,
                                       *arguments, models=["mixed.pietra"])["triangles"]
                all_of_it = shown("none.png", "--cull", "none")
                fewer = shown("cone.png", "--cull", "cone")
                self.assertEqual(self.read("cone.png"), self.read("none.png"), (name, pixels))
                if pixels == "0":
                    self.assertLess(fewer, all_of_it)
                # Nor is anything left out for being seen from behind.
                shown("both.png", "--cull", "none", "--two-sided")
                self.report("compare", "none.png", "both.png", "--json", "--max-px", "1")

    def test_a_closed_mesh_that_is_inside_out_is_seen_from_outside(self):
        write_torus(self.path("torus.ply"), 60, 30)
        vertices, triangles = read_floats(self.read("torus.ply"))
        self.write("turned.ply", mesh_text(vertices, [(a, c, b) for a, b, c in triangles]))
        for name in ("torus", "turned"):
            self.report("build", f"{name}.ply", "-o", f"{name}.pietra", "--report", "-")
            self.render(f"{name}.png", "--pixels", "0", models=[f"{name}.pietra"])
        self.report("compare", "torus.png", "turned.png", "--json", "--max-px", "1")

    def test_from_within_a_part_that_shares_its_nodes_nothing_is_culled(self):
        # A closed tube in an open one that ends before it does: few nodes hold the closed one alone.
        around, vertices, triangles = 24, [], []

        def tube(radius, length):
            first = len(vertices)
            for i in range(6 * length + 1):
                for k in range(around):
                    angle = 2 * math.pi * k / around
                    vertices.append((i / 6, radius * math.cos(angle), radius * math.sin(angle)))
            for i in range(6 * length):
                for k in range(around):
                    a, b = (first + i * around + n for n in (k, (k + 1) % around))
                    triangles.extend([(a, b, a + around), (b, b + around, a + around)])
            return first
        tube(1.02, 85)
        first = tube(1, 100)
        for k in range(1, around - 1):
            triangles.append((first, first + k + 1, first + k))
            last = first + 600 * around
            triangles.append((last, last + k, last + k + 1))
        self.write("tubes.ply", mesh_text(vertices, triangles))
        self.report("build", "tubes.ply", "-o", "tubes.pietra", "--leaf-triangles", "300",
                    "--patch-triangles", "200", "--report", "-")
        self.write("c.json", json.dumps({"eye": [10, 0.1, 0.2], "target": [100, 0, 0],
                                         "up": [0, 0, 1], "fovy_deg": 45}))
        for pixels in ("0", "1"):
            for word in ("none", "all"):
                shown = self.render(f"{word}{pixels}.png", "--camera", "c.json", "--cull", word,
                                    "--pixels", pixels, models=["tubes.pietra"])
                self.assertEqual(shown["pixels_covered"], 200 * 160, (word, pixels))
            self.assertEqual(self.read(f"all{pixels}.png"), self.read(f"none{pixels}.png"))

    def test_every_view_of_the_attributes(self):
        pictures = set()
        for show in ("shaded", "normals", "depth", "lod", "patches", "triangles", "wire", "error", "colour",
                     "scalar:height"):
            self.render(f"{show}.png", "--show", show, "--pixels", "4", models=["terrain.pietra"])
            pictures.add(self.read(f"{show}.png"))
        self.assertEqual(len(pictures), 10)

    def test_opengl_draws_the_same(self):
        run = self.run_pietra("render", "statue.pietra", "-o", "gl.png", "--size", "200x160",
                              "--renderer", "gl")
        if "there is no OpenGL 4.5" in run.stderr:
            self.skipTest(run.stderr)
        self.assertEqual(run.returncode, 0, run.stderr)
        for samples in ("1", "4"):
            self.render("cpu.png", "--samples", samples)
            shown = self.render("gl.png", "--samples", samples, "--renderer", "gl", "--force")
            self.assertGreater(shown["resident_bytes"]["vram"], 0)
            self.report("compare", "cpu.png", "gl.png", "--json", "--max-px", "1", "--max-shade", "2")
            os.remove(os.path.join(self.folder, "cpu.png"))

    def test_render_refusals(self):
        end = " (see pietra render --help)"
        refuse = self.assertRefused
        start = ["render", "statue.pietra", "-o", "x.png"]
        os.environ["__EGL_VENDOR_LIBRARY_FILENAMES"] = os.devnull  # no driver is found
        refuse(start + ["--renderer", "gl"], 2,
               "--renderer gl: there is no OpenGL 4.5: no EGL device offers it")
        del os.environ["__EGL_VENDOR_LIBRARY_FILENAMES"]
        refuse(start + ["--light", "1,2"], 2, "render: --light: '1,2' is not of the form X,Y,Z" + end)
        refuse(start + ["--light", "0,0,0"], 2, "render: --light: '0,0,0' is no direction" + end)
        refuse(start + ["--camera", "c.json", "--view", "top"], 2,
               "--camera and --view exclude each other: give one")

    def test_bench_on_every_path(self):
        for path in ("orbit", "dive", "flight", "jumps", "inspection"):
            r = self.report("bench", "statue.pietra", "--path", path, "--frames", "12", "--size",
                            "160x120", "--report", "-")
            self.assertEqual(len(r["frames"]), 12)
            self.assertEqual(r["summary"]["frames"], 12)
            self.assertGreater(r["summary"]["first_image_ms"], 0)
            self.assertGreaterEqual(r["summary"]["converged_ms"], 0)
            self.assertGreater(max(f["triangles"] for f in r["frames"]), 0)
            self.assertGreater(r["summary"]["overhead_ratio"], 0.5)
            self.assertGreater(min(f["static_ms"] for f in r["frames"]), 0)
            self.assertNotIn("cold_overhead_ratio", r["summary"])
            self.assertGreater(r["summary"]["largest_process_bytes"],
                               r["summary"]["rss_before_bytes"])
            self.write("path.json", json.dumps(r["path"]))
            again = self.report("bench", "statue.pietra", "--path", "path.json", "--frames", "12",
                                "--size", "160x120", "--renderer", "none", "--report", "-")
            self.assertEqual(again["path"], r["path"])
            self.assertNotIn("overhead_ratio", again["summary"])
        undrawn = self.report("bench", "statue.pietra", "--path", "orbit", "--frames", "5",
                              "--renderer", "none", "--prefetch", "off", "--report", "-")
        self.assertEqual(undrawn["frames"][0]["draw_ms"], 0)
        self.assertRefused(["bench", "statue.pietra", "--path", "orbit", "--ram", "1K"], 5,
                           self.run_pietra("bench", "statue.pietra", "--path", "orbit", "--ram",
                                           "1K").stderr[len("pietra: "):-1])
        self.assertRefused(["bench", "statue.pietra", "--path", "none.json"], 4,
                           "none.json: cannot open: No such file or directory")

    def skip_without_opengl(self, run):
        if "there is no OpenGL 4.5" in run.stderr or "no window can be opened" in run.stderr:
            self.skipTest(run.stderr)
        self.assertEqual(run.returncode, 0, run.stderr)

    def test_bench_by_opengl(self):
        fly = ["bench", "statue.pietra", "statue.pietra", "--path", "jumps", "--frames", "12",
               "--size", "160x120", "--renderer", "gl", "--report", "-"]
        run = self.run_pietra(*fly, "--vram", "2M", "--log-level", "debug")
        self.skip_without_opengl(run)
        self.assertNotIn("OpenGL:", run.stderr)
        r = json.loads(run.stdout)
        self.assertEqual(r["renderer"], "gl")
        for frame in r["frames"]:
            self.assertTrue(0 < frame["device_bytes"] <= 2 << 20, frame)
            self.assertGreater(frame["gpu_ms"], 0)
        self.assertGreater(r["summary"]["overhead_ratio"], 0)
        self.assertRefused(fly + ["--vram", "1K"], 5, "--ram 1.0 GiB, --vram 1.0 KiB: OpenGL needs "
                           "512 KiB of graphics memory")

    def test_view_by_opengl(self):
        # The wheel goes to what is seen at the cursor: in motion that is coarser on a busy machine.
        self.write("s.txt", "key Tab\nwait\nscreenshot a.png\ndrag left 200 150 300 180\n"
                   "wait\nwheel 3 200 150\nkey 5\nwait\nscreenshot b.png\nkey A\ndouble 200 150\nwait\n"
                   "screenshot c.png\nquit\n")
        screen = {"SDL_VIDEODRIVER": "offscreen", "ASAN_OPTIONS": "detect_leaks=0"}
        look = ["view", "statue.pietra", "--size", "400x300", "--vram", "16M", "--script", "s.txt"]
        for renderer in ("gl", "cpu"):
            run = self.run_pietra(*look, "--log-level", "debug", "--renderer", renderer, env=screen)
            self.skip_without_opengl(run)
            self.assertEqual((run.stdout, run.stderr), ("", ""))
            for name in "abc":
                os.rename(self.path(f"{name}.png"), self.path(f"{renderer}_{name}.png"))
        for name in "abc":
            self.report("compare", f"cpu_{name}.png", f"gl_{name}.png", "--json", "--max-shade", "2")
        none = dict(screen, SDL_VIDEODRIVER="dummy")  # has no OpenGL
        run = self.run_pietra(*look, env=none)
        self.assertEqual(run.returncode, 0)
        self.assertTrue(run.stderr.startswith("pietra: drawing with the processor: "), run.stderr)
        run = self.run_pietra(*look, "--renderer", "gl", env=none)
        self.assertEqual(run.returncode, 2)
        self.assertTrue(run.stderr.startswith("pietra: --renderer gl: "), run.stderr)

    def test_bench_writes_a_page(self):
        html = os.path.join(self.folder, "r.html")
        whole = {"target": [0, 0, 0], "up": [0, 0, 1], "fovy_deg": 45}
        self.write("short.json", json.dumps({"seconds": 0.2, "keys": [
            {"t": 0, "eye": [9, 0, 0], **whole}, {"t": 0.2, "eye": [9, 1, 0], **whole}]}))
        r = self.report("bench", "statue.pietra", "--path", "short.json", "--frames", "9", "--size",
                        "160x120", "--cold", "--html", html, "--report", "-")
        self.assertGreater(r["summary"]["cold_overhead_ratio"], 0)
        for flight in ("without_prefetch", "without_drawing"):
            self.assertEqual(len(r[flight]["frames"]), 9)
        self.assertEqual(max(f["draw_ms"] for f in r["without_drawing"]["frames"]), 0)
        with open(html, encoding="utf-8") as file:
            page = file.read()
        self.assertEqual(page.count("<svg"), page.count("</svg>"))
        self.assertGreater(page.count("<svg"), 5)
        for absent in ("<script", "http", "src=", "nan"):
            self.assertNotIn(absent, page)
        self.assertRefused(["bench", "statue.pietra", "--path", "orbit", "--html", html], 2,
                           f"{html}: exists; --force overwrites it")

    def test_view_does_as_a_script_says(self):
        self.write("s.txt", "# turn it\nwait\nscreenshot a.png\ndrag left 200 150 300 180\n"
                   "wheel 3 200 150\nkey 5\nwait\nscreenshot b.png\n"
                   "key 1\nkey Z\nwait\nscreenshot c.png\nkey O\nwait\nscreenshot d.png\nquit\n")
        # SDL loads graphics drivers, which leave memory behind: nothing for a leak checker.
        screen = {"SDL_VIDEODRIVER": "offscreen", "ASAN_OPTIONS": "detect_leaks=0"}
        run = self.run_pietra("view", "statue.pietra", "--size", "400x300", "--script", "s.txt",
                              env=screen)
        self.assertEqual((run.returncode, run.stdout), (0, ""), run.stderr)
        moved = self.report("compare", "a.png", "b.png", "--json")
        self.assertGreater(moved["shade"]["p99"], 20)
        green = self.report("compare", "c.png", "d.png", "--json")  # what is seen from there
        self.assertGreater(green["shade"]["p99"], 20)
        # A mesh is offered, built beside the window when accepted, and shown; or it is dropped.
        for first, script in (("torus.ply", "key Return\n"), ("statue.pietra", "drop torus.ply\n")):
            write_torus(self.path("torus.ply"), 40, 24)
            self.write("s.txt", script + "wait\nkey F\nkey Tab\nwait\nscreenshot c.png\nquit\n")
            run = self.run_pietra("view", first, "--size", "400x300", "--script", "s.txt", env=screen)
            self.assertEqual((run.returncode, run.stdout), (0, ""), run.stderr)
            self.assertEqual(self.report("info", "torus.pietra", "--json")["input"]["triangles"], 1920)
            os.remove(self.path("torus.pietra"))
        self.write("bad.txt", "wait\njump\n")
        run = self.run_pietra("view", "statue.pietra", "--renderer", "cpu", "--script", "bad.txt",
                              env=screen)
        self.assertEqual((run.returncode, run.stderr),
                         (3, "pietra: bad.txt: line 2: 'jump' is no command\n"))

    def test_compare_finds_what_has_moved(self):
        for name, x in (("a", 0.0), ("b", 0.0), ("c", 0.05)):
            self.write("c.json", json.dumps({"eye": [x, -5, 0.5], "target": [x, 0, 0],
                                             "up": [0, 0, 1], "fovy_deg": 40}))
            self.render(f"{name}.png", "--camera", "c.json")
        same = self.report("compare", "a.png", "b.png", "--json", "--max-px", "0", "--max-shade", "0")
        self.assertEqual(same["largest_px"], 0)
        moved = self.report("compare", "a.png", "c.png", "--json", "--max-px", "1", code=6)
        self.assertGreater(moved["largest_px"], 1)


if __name__ == "__main__":
    command_line_test.PIETRA = os.path.abspath(sys.argv.pop(1))
    unittest.main()
