#!/usr/bin/env python3
"""The command line as a user types it: exit codes, exact messages, and where they go.

usage: command_line_test.py PIETRA [unittest arguments]
"""

import array
import json
import math
import os
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import unittest

PIETRA = None

TETRAHEDRON = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 1 2 3
3 2 0 3
"""


def write_torus(path, columns, rows):
    """A wavy torus of 2 * columns * rows triangles, as a binary PLY."""
    vertices = array.array("f")
    for i in range(columns):
        u = 2 * math.pi * i / columns
        for j in range(rows):
            v = 2 * math.pi * j / rows
            r = 1 + 0.02 * math.sin(17 * u) * math.cos(11 * v)
            vertices.extend(((3 + r * math.cos(v)) * math.cos(u),
                             (3 + r * math.cos(v)) * math.sin(u), r * math.sin(v)))
    faces = bytearray()
    for i in range(columns):
        for j in range(rows):
            a, b = i * rows + j, (i + 1) % columns * rows + j
            c, d = (i + 1) % columns * rows + (j + 1) % rows, i * rows + (j + 1) % rows
            faces += struct.pack("<B3iB3i", 3, a, b, c, 3, a, c, d)
    with open(path, "wb") as file:
        file.write((f"ply\nformat binary_little_endian 1.0\nelement vertex {columns * rows}\n"
                    "property float x\nproperty float y\nproperty float z\n"
                    f"element face {2 * columns * rows}\n"
                    "property list uchar int vertex_indices\nend_header\n").encode())
        file.write(vertices.tobytes())
        file.write(faces)


class CommandLineTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="pietra-cli-")
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, content):
        with open(self.path(name), "wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)

    def read(self, name):
        with open(self.path(name), "rb") as file:
            return file.read()

    def build(self, mesh, model, *options):
        run = self.run_pietra("build", mesh, "-o", model, *options)
        self.assertEqual(run.returncode, 0, run.stderr)

    def run_pietra(self, *arguments, env=None, **more):
        return subprocess.run([PIETRA, *arguments], capture_output=True, text=True, cwd=self.folder,
                              stdin=subprocess.DEVNULL, timeout=60,
                              env={**os.environ, **(env or {})}, **more)

    def assertRefused(self, arguments, code, message):
        """Nothing on standard output, one line on standard error, nothing left behind."""
        before = sorted(os.listdir(self.folder))
        run = self.run_pietra(*arguments)
        self.assertEqual(run.stderr, f"pietra: {message}\n")
        self.assertEqual(run.stdout, "")
        self.assertEqual(run.returncode, code)
        self.assertEqual(sorted(os.listdir(self.folder)), before)


class Usage(CommandLineTest):
    def test_no_verb(self):
        self.assertRefused([], 2, "no verb given (see pietra --help)")
        self.assertRefused(["--quiet"], 2, "no verb given (see pietra --help)")

    def test_unknown_verb(self):
        self.assertRefused(["fly"], 2, "unknown verb 'fly' (see pietra --help)")
        self.assertRefused(["fly", "--help-me"], 2, "unknown verb 'fly' (see pietra --help)")
        self.assertRefused([""], 2, "unknown verb '' (see pietra --help)")

    def test_unknown_option(self):
        self.assertRefused(["--bogus"], 2, "unknown option '--bogus' (see pietra --help)")

    def test_missing_config(self):
        self.assertRefused(["--config", "no.conf"], 4,
                           "no.conf: cannot open: No such file or directory")

    def test_version(self):
        run = self.run_pietra("--version")
        self.assertRegex(run.stdout, r"^pietra \d+\.\d+\.\d+\n$")
        self.assertEqual((run.returncode, run.stderr), (0, ""))

    def test_help(self):
        run = self.run_pietra("--help")
        self.assertTrue(run.stdout.startswith("pietra - look at triangle meshes of any size"))
        for part in ("\nUsage:\n", "\nVerbs:\n", "--force", "--report FILE", "--log-file FILE",
                     "--config FILE", "\nExit status:\n", "\n  130   interrupted\n"):
            self.assertIn(part, run.stdout)
        self.assertLessEqual(max(map(len, run.stdout.split("\n"))), 80)
        self.assertEqual((run.returncode, run.stderr), (0, ""))
        self.assertEqual(self.run_pietra("-h").stdout, run.stdout)
        self.assertEqual(self.run_pietra("help").stdout, run.stdout)

    def test_every_verb_has_a_help_page(self):
        verbs = self.run_pietra("--help").stdout.split("\nVerbs:\n")[1].split("\n\n")[0]
        for line in verbs.split("\n"):
            if line.startswith("   ") or not line:
                continue
            verb = line.split()[0]
            run = self.run_pietra(verb, "--help")
            self.assertTrue(run.stdout.startswith(f"pietra {verb} - "), verb)
            for part in ("\nUsage:\n  pietra ", "\nExamples:\n", "\nExit status:\n"):
                self.assertIn(part, run.stdout)
            for page_line in run.stdout.split("\n"):
                self.assertLessEqual(len(page_line), 100, page_line)
            self.assertEqual((run.returncode, run.stderr), (0, ""))

    def test_a_full_standard_output_is_no_success(self):
        with open("/dev/full", "w") as full:
            run = subprocess.run([PIETRA, "--help"], stdout=full, stderr=subprocess.PIPE, text=True)
        self.assertEqual(run.returncode, 4)
        self.assertEqual(run.stderr,
                         "pietra: standard output: cannot write: No space left on device\n")


class Build(CommandLineTest):
    def setUp(self):
        super().setUp()
        with open(self.path("tet.ply"), "w") as file:
            file.write(TETRAHEDRON)

    def test_refusals(self):
        refuse = self.assertRefused
        end = " (see pietra build --help)"
        refuse(["build"], 2, "build: IN is missing" + end)
        refuse(["build", "tet.ply"], 2, "build: option --output OUT.pietra is missing" + end)
        refuse(["build", "none.ply", "-o", "x.pietra"], 4,
               "none.ply: cannot open: No such file or directory")
        refuse(["build", ".", "-o", "x.pietra"], 4, ".: cannot open: Is a directory")
        refuse(["build", "tet.ply", "-o", "."], 4, ".: cannot write: Is a directory")
        refuse(["build", "tet.ply", "-o", "no/x.pietra"], 4,
               "no/x.pietra: cannot create: No such file or directory")
        refuse(["build", "tet.ply", "-o", "tet.ply", "--force"], 2,
               "tet.ply: is an input and the output")
        refuse(["build", "tet.ply", "-o", "x.pietra", "--memory", "12Q"], 2,
               "build: --memory: '12Q' is not a size (such as 512M, 1.5G or 1000000)" + end)
        refuse(["build", "tet.ply", "-o", "x.pietra", "--memory", "1M"], 5,
               "--memory 1.0 MiB: building needs 128 MiB at least")
        refuse(["build", "tet.ply", "-o", "x.pietra", "--jobs", "0"], 2,
               "build: --jobs: '0' must be at least 1" + end)
        refuse(["build", "tet.ply", "-o", "x.pietra", "--precision", "fine"], 2,
               "build: --precision: 'fine' is neither auto nor finest nor a number above 0" + end)
        refuse(["build", "tet.ply", "-o", "x.pietra", "--checkpoint", "-1"], 2,
               "build: --checkpoint: '-1' must be at least 0" + end)
        refuse(["build", "tet.ply", "-o", "x.pietra", "--temp-dir", "no"], 4,
               "no: cannot use as --temp-dir: No such file or directory")
        refuse(["build", "tet.ply", "-o", "x.pietra", "--report", "no/r.json"], 4,
               "no/r.json: cannot create: No such file or directory")
        refuse(["build", "tet.ply", "-o", "x.pietra", "--log-file", "no/log"], 4,
               "no/log: cannot write: No such file or directory")

    def test_bad_input_is_named(self):
        self.write("cut.ply", TETRAHEDRON[:-10])
        self.write("index.ply", TETRAHEDRON.replace("3 2 0 3", "3 2 0 4"))
        self.write("empty.ply", "")
        self.write("noise.ply", "This is no mesh.")
        for name in ("cut", "index", "empty", "noise"):
            run = self.run_pietra("build", f"{name}.ply", "-o", "x.pietra")
            self.assertEqual(run.returncode, 3, run.stderr)
            self.assertTrue(run.stderr.startswith(f"pietra: {name}.ply: "), run.stderr)
            self.assertFalse(os.path.exists(self.path("x.pietra")))

    def test_an_output_that_exists(self):
        self.write("x.pietra", "mine")
        self.assertRefused(["build", "tet.ply", "-o", "x.pietra"], 2,
                           "x.pietra: exists; --force overwrites it")
        self.assertEqual(self.read("x.pietra"), b"mine")
        run = self.run_pietra("build", "tet.ply", "-o", "x.pietra", "--force")
        self.assertEqual((run.returncode, run.stdout), (0, ""))
        self.assertNotEqual(self.read("x.pietra"), b"mine")

    def test_a_dry_run_writes_nothing(self):
        run = self.run_pietra("build", "tet.ply", "-o", "x.pietra", "--dry-run")
        self.assertEqual(run.returncode, 0)
        self.assertIn("triangles    4\nvertices     4\n", run.stdout)
        self.assertEqual(os.listdir(self.folder), ["tet.ply"])

    def test_the_report_and_the_log(self):
        run = self.run_pietra("build", "tet.ply", "-o", "x.pietra", "--report", "-", "--quiet",
                              "--log-file", "log")
        self.assertEqual((run.returncode, run.stderr), (0, ""))
        report = json.loads(run.stdout)
        self.assertEqual(report["method"], "tetra")
        self.assertEqual(report["input"]["triangles"], 4)
        self.assertEqual(report["input"]["vertices"], 4)
        self.assertEqual(report["input"]["bytes"], len(TETRAHEDRON))
        self.assertEqual(report["output_bytes"], len(self.read("x.pietra")))
        self.assertEqual(report["dropped"], {"degenerate": 0, "duplicate": 0})
        for key in ("triangles_per_second", "peak_rss_bytes", "memory_limit_bytes",
                    "temp_bytes_peak", "jobs", "ranks", "resumed"):
            self.assertIn(key, report)
        self.assertGreater(report["seconds"]["total"], 0)
        self.assertRegex(self.read("log").decode(), r"^\d{4}-\d\d-\d\d .* info x.pietra: 4 triangles")

    def test_options_from_a_file(self):
        self.write("pietra.conf", "quiet = true\n[build]\noutput = \"y.pietra\"\n")
        run = self.run_pietra("build", "tet.ply", "--config", "pietra.conf")
        self.assertEqual((run.returncode, run.stderr), (0, ""))
        self.assertTrue(os.path.exists(self.path("y.pietra")))

    def test_the_bytes_depend_on_the_input_alone(self):
        write_torus(self.path("torus.ply"), 120, 80)
        os.mkdir(self.path("elsewhere"))
        self.build("torus.ply", "a.pietra", "--jobs", "1")
        self.build("torus.ply", "b.pietra", "--jobs", "3", "--memory", "128M",
                   "--temp-dir", "elsewhere")
        os.rename(self.path("torus.ply"), self.path("renamed.ply"))
        self.build("renamed.ply", "c.pietra")
        self.assertEqual(self.read("a.pietra"), self.read("b.pietra"))
        self.assertEqual(self.read("a.pietra"), self.read("c.pietra"))

    def test_a_signal_ends_it_and_leaves_nothing(self):
        write_torus(self.path("torus.ply"), 400, 400)
        for number in (signal.SIGINT, signal.SIGTERM):
            process = subprocess.Popen(
                [PIETRA, "build", "torus.ply", "-o", "x.pietra", "--progress", "json"],
                cwd=self.folder, stderr=subprocess.PIPE, text=True)
            first = json.loads(process.stderr.readline())  # it is at work now
            self.assertIn(first["event"], ("progress", "stage_ended"))
            process.send_signal(number)
            rest = process.communicate(timeout=60)[1]
            self.assertEqual(process.returncode, 130, rest)
            self.assertEqual(rest.split("\n")[-2], "pietra: interrupted")
            self.assertEqual(sorted(os.listdir(self.folder)), ["tet.ply", "torus.ply"])


class Resume(CommandLineTest):
    """Builds that were interrupted and go on."""

    ARGUMENTS = ["torus.ply", "--leaf-triangles", "300", "--patch-triangles", "200", "--jobs", "2"]

    def setUp(self):
        super().setUp()
        write_torus(self.path("torus.ply"), 300, 300)

    def folder_of_resume(self):
        return [f for f in os.listdir(self.folder) if f.endswith(".resume")]

    def state(self, part):
        """Changes when another state is saved; None while there is none."""
        for folder in self.folder_of_resume():
            try:
                return os.stat(self.path(f"{folder}/{part}.state")).st_ino
            except FileNotFoundError:
                pass
        return None

    def stop(self, method, signal_number, part, *more):
        """Starts to build x.pietra and ends it after this part of the state was saved again; anew,
        should it have been too fast."""
        output = self.path("x.pietra")
        for _ in range(20):
            before = self.state(part) if "--resume" in more else None
            process = subprocess.Popen(
                [PIETRA, "build", "-o", "x.pietra", "--method", method, "--checkpoint", "0"] +
                self.ARGUMENTS + list(more), cwd=self.folder, stderr=subprocess.PIPE, text=True)
            while process.poll() is None and self.state(part) in (None, before):
                pass
            process.send_signal(signal_number)
            rest = process.communicate(timeout=60)[1]
            if not os.path.exists(output):
                break
            os.remove(output)
        self.assertEqual(process.returncode,
                         130 if signal_number == signal.SIGINT else -signal_number, rest)

    def resume(self, method, *more):
        run = self.run_pietra("build", "-o", "x.pietra", "--method", method, "--resume", "--report",
                              "-", *self.ARGUMENTS, *more)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertEqual(self.folder_of_resume(), [])
        return json.loads(run.stdout)["resumed"]

    def test_the_same_bytes_as_without_interruption(self):
        for method, part, number in (("pmesh", "input", signal.SIGKILL),
                                     ("pmesh", "method", signal.SIGINT),
                                     ("tetra", "input", signal.SIGINT),
                                     ("tetra", "method", signal.SIGKILL),
                                     ("cluster", "input", signal.SIGKILL),
                                     ("cluster", "method", signal.SIGINT)):
            self.build(*self.ARGUMENTS[:1], "whole.pietra", "--method", method,
                       *self.ARGUMENTS[1:])
            self.stop(method, number, part)
            self.assertTrue(self.resume(method))
            self.assertEqual(self.read("x.pietra"), self.read("whole.pietra"))
            os.remove(self.path("x.pietra"))
            os.remove(self.path("whole.pietra"))

    def test_twice(self):
        self.build("torus.ply", "whole.pietra", "--method", "pmesh", *self.ARGUMENTS[1:])
        self.stop("pmesh", signal.SIGKILL, "method")
        self.stop("pmesh", signal.SIGKILL, "method", "--resume", "--jobs", "1")
        self.assertTrue(self.resume("pmesh", "--memory", "128M"))
        self.assertEqual(self.read("x.pietra"), self.read("whole.pietra"))

    def test_nothing_to_resume(self):
        self.assertFalse(self.resume("pmesh"))
        os.remove(self.path("x.pietra"))
        self.stop("pmesh", signal.SIGKILL, "method")
        folder, = self.folder_of_resume()
        os.utime(self.path("torus.ply"))  # what was left is of another input now
        run = self.run_pietra("build", "-o", "x.pietra", "--method", "pmesh", "--resume",
                              "--report", "-", *self.ARGUMENTS)
        self.assertFalse(json.loads(run.stdout)["resumed"])
        self.assertEqual(self.folder_of_resume(), [folder])

    def test_damage_starts_afresh(self):
        self.build("torus.ply", "whole.pietra", "--method", "pmesh", *self.ARGUMENTS[1:])
        for part in ("input", "method"):
            self.stop("pmesh", signal.SIGKILL, "method")
            folder, = self.folder_of_resume()
            with open(self.path(f"{folder}/{part}.state"), "r+b") as file:
                file.seek(100)
                file.write(b"damage")
            self.assertEqual(self.resume("pmesh"), part == "method")
            self.assertEqual(self.read("x.pietra"), self.read("whole.pietra"))
            os.remove(self.path("x.pietra"))

    def test_a_full_disk(self):
        """Of the collapses less than all have room; how much they take depends on what is saved."""
        self.build("torus.ply", "whole.pietra", "--method", "pmesh", *self.ARGUMENTS[1:])
        for room in range(3_900_000, 2_600_000, -100_000):
            def no_room():
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))

            run = self.run_pietra("build", "-o", "x.pietra", "--method", "pmesh", "--checkpoint",
                                  "0", *self.ARGUMENTS, preexec_fn=no_room)
            if run.returncode != 0:
                break
            os.remove(self.path("x.pietra"))
        self.assertEqual(run.returncode, 4, run.stderr)
        self.assertRegex(run.stderr, "cannot write: File too large\n$")
        self.assertTrue(self.resume("pmesh"))
        self.assertEqual(self.read("x.pietra"), self.read("whole.pietra"))

    def test_one_at_a_time(self):
        process = subprocess.Popen(
            [PIETRA, "build", "-o", "x.pietra", "--progress", "json"] + self.ARGUMENTS,
            cwd=self.folder, stderr=subprocess.PIPE, text=True)
        process.stderr.readline()  # it is at work now
        run = self.run_pietra("build", "-o", "y.pietra", "--resume", *self.ARGUMENTS)
        self.assertEqual((run.returncode, run.stderr),
                         (2, "pietra: this model is being built by another process\n"))
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)


class Adaptive(CommandLineTest):
    """What is particular to models without patches."""

    def test_extraction_stays_within_memory_or_says_what_it_needs(self):
        write_torus(self.path("torus.ply"), 200, 150)
        self.build("torus.ply", "t.pietra", "--method", "pmesh")
        for size, message in (
                ("64M", r"--memory 64.0 MiB: extracting from this model needs 64.0 MiB at least"),
                ("65M", r"a cut of a progressive mesh needs 1.\d MiB, but only \d+ KiB "
                        r"of the memory limit are left")):
            run = self.run_pietra("extract", "t.pietra", "-o", "x.ply", "--full", "--memory", size)
            self.assertEqual((run.returncode, run.stdout), (5, ""), run.stderr)
            self.assertRegex(run.stderr, "^pietra: " + message + "\n$")
            self.assertFalse(os.path.exists(self.path("x.ply")))
        run = self.run_pietra("extract", "t.pietra", "-o", "x.ply", "--full", "--memory", "68M")
        self.assertEqual(run.returncode, 0, run.stderr)

    def test_colours_survive(self):
        """Extracted in full, each place has the input's colour."""
        def vertices(name):
            head, body = self.read(name).split(b"end_header\n", 1)
            count = int(head.split(b"element vertex ")[1].split()[0])
            words = [line.split() for line in head.decode().split("\n")]
            names = [w[2] for w in words[:words.index(["element", "face", w_faces(head)])]
                     if w[:1] == ["property"]]
            code = "<" + "".join("f" if n in ("x", "y", "z", "nx", "ny", "nz") else "B"
                                 for n in names)
            rows = struct.iter_unpack(code, body[:struct.calcsize(code) * count])
            return [dict(zip(names, row)) for row in rows]

        def w_faces(head):
            return head.split(b"element face ")[1].split()[0].decode()

        side, rows = 40, []
        for i in range(side * side):
            x, y = i % side, i // side
            rows.append(f"{x} {y} {math.sin(x / 5) * math.cos(y / 7):.6f} "
                        f"{i % 251} {i * 7 % 253} {i * 31 % 255}")
        faces = [f"3 {a} {a + 1} {a + side}\n3 {a + 1} {a + side + 1} {a + side}"
                 for a in range(side * (side - 1)) if a % side < side - 1]
        self.write("sheet.ply", "\n".join(
            ["ply", "format ascii 1.0", f"element vertex {side * side}", "property float x",
             "property float y", "property float z", "property uchar red",
             "property uchar green", "property uchar blue",
             f"element face {2 * (side - 1) ** 2}", "property list uchar int vertex_indices",
             "end_header"] + rows + faces) + "\n")
        self.build("sheet.ply", "s.pietra", "--method", "pmesh", "--leaf-triangles", "200")
        run = self.run_pietra("extract", "s.pietra", "-o", "full.ply", "--full")
        self.assertEqual(run.returncode, 0, run.stderr)
        found = vertices("full.ply")
        self.assertEqual(len(found), side * side)
        for v in found:
            i = round(v["x"]) + side * round(v["y"])
            self.assertEqual((v["red"], v["green"], v["blue"]),
                             (i % 251, i * 7 % 253, i * 31 % 255))


class Model(CommandLineTest):
    """Verbs that read a model."""

    @classmethod
    def setUpClass(cls):
        cls.shared = tempfile.TemporaryDirectory(prefix="pietra-cli-")
        write_torus(os.path.join(cls.shared.name, "torus.ply"), 150, 100)
        subprocess.run([PIETRA, "build", "torus.ply", "-o", "torus.pietra", "--quiet",
                        "--leaf-triangles", "500", "--patch-triangles", "300"],
                       cwd=cls.shared.name, check=True)

    @classmethod
    def tearDownClass(cls):
        cls.shared.cleanup()

    def setUp(self):
        super().setUp()
        for name in ("torus.ply", "torus.pietra"):
            os.symlink(os.path.join(self.shared.name, name), self.path(name))

    def report(self, *arguments, code=0):
        """The JSON on standard output."""
        run = self.run_pietra(*arguments)
        self.assertEqual(run.returncode, code, run.stderr)
        return json.loads(run.stdout)

    def test_what_is_no_model(self):
        self.write("empty.pietra", "")
        self.write("cut.pietra", self.read("torus.pietra")[:-100])
        for verb in (["info"], ["check"], ["render", "-o", "x.png"], ["extract", "--full", "-o", "x.ply"]):
            self.assertRefused(verb + ["none"], 4, "none: cannot open: No such file or directory")
            self.assertRefused(verb + ["."], 4, ".: cannot open: Is a directory")
            self.assertRefused(verb + ["torus.ply"], 3, "torus.ply: byte 0: this is no Pietra model")
            for damaged in ("empty.pietra", "cut.pietra"):
                run = self.run_pietra(*verb, damaged)
                self.assertEqual((run.returncode, run.stdout), (3, ""))
                self.assertTrue(run.stderr.startswith(f"pietra: {damaged}: "), run.stderr)

    def test_a_flipped_bit_in_a_page(self):
        data = bytearray(self.read("torus.pietra"))
        data[len(data) // 2] ^= 16
        self.write("bad.pietra", bytes(data))
        run = self.run_pietra("check", "bad.pietra", "--json")
        self.assertEqual(run.returncode, 3)
        self.assertIn("pietra: bad.pietra: ", run.stderr)
        report = json.loads(run.stdout) if run.stdout else {"ok": False}
        self.assertFalse(report["ok"])
        for verb in (["render", "--pixels", "0", "--cull", "none", "-o", "x.png"],
                     ["extract", "--full", "-o", "x.ply"]):
            run = self.run_pietra(*verb, "bad.pietra")
            self.assertEqual(run.returncode, 3, run.stderr)
            self.assertRegex(run.stderr, r"^pietra: bad\.pietra: byte \d+: ")
            self.assertFalse(os.path.exists(self.path(verb[-1])))

    def test_info(self):
        info = self.report("info", "torus.pietra", "--json")
        self.assertEqual(info["method"], "tetra")
        self.assertEqual(info["input"], {"triangles": 30000, "vertices": 15000, "files": 1})
        self.assertEqual(info["bytes"], len(self.read("torus.pietra")))
        self.assertAlmostEqual(info["bounds"]["max"][2], 1.02, places=1)
        self.assertGreater(info["levels"], 3)
        for key in ("format_version", "precision", "attributes", "nodes", "triangles_stored",
                    "bytes_per_input_triangle", "max_error"):
            self.assertIn(key, info)
        text = self.run_pietra("info", "torus.pietra").stdout
        self.assertIn("input          30000 triangles, 15000 vertices, 1 file\n", text)

    def test_check(self):
        check = self.report("check", "torus.pietra", "--json", "--cuts", "5", "--samples", "20k")
        self.assertTrue(check["ok"])
        self.assertEqual(check["pages"]["bad"], 0)
        self.assertEqual(check["bounds"]["not_nested"], 0)
        self.assertEqual(check["errors"]["not_monotone"], 0)
        self.assertEqual(check["cuts"]["checked"], 5)
        self.assertEqual(check["cuts"]["cracked_edges"], 0)
        self.assertEqual(check["cuts"]["overlapping_edges"], 0)
        self.assertGreater(check["certificate"]["samples"], 0)
        self.assertEqual(check["certificate"]["error_bound_violations"], 0)
        with_input = self.report("check", "torus.pietra", "--json", "--cuts", "1", "--samples",
                                 "20k", "--input", "torus.ply")
        self.assertTrue(with_input["ok"])
        self.assertGreater(with_input["certificate"]["samples"], 0)

    def test_check_finds_another_input(self):
        write_torus(self.path("other.ply"), 40, 30)
        check = self.report("check", "torus.pietra", "--json", "--cuts", "1", "--samples", "20k",
                            "--input", "other.ply", code=6)
        self.assertFalse(check["ok"])
        self.assertGreater(check["certificate"]["error_bound_violations"], 0)

    def test_extract(self):
        info = self.report("info", "torus.pietra", "--json")
        full = self.report("extract", "torus.pietra", "-o", "full.ply", "--full", "--report", "-")
        self.assertEqual((full["triangles"], full["vertices"]), (30000, 15000))
        self.assertLessEqual(full["max_error"], info["precision"])
        few = self.report("extract", "torus.pietra", "-o", "few.obj", "--triangles", "5k",
                          "--report", "-")
        self.assertLessEqual(few["triangles"], 5000)
        self.assertEqual(few["triangles"], 2 * few["vertices"])  # a closed torus, welded
        near = self.report("extract", "torus.pietra", "-o", "near.stl", "--error", "0.05",
                           "--report", "-")
        self.assertLessEqual(near["max_error"], 0.05)
        self.write("c.json", '{"eye":[0,-40,5],"target":[0,0,0],"up":[0,0,1],"fovy_deg":30}')
        seen = self.report("extract", "torus.pietra", "-o", "seen.glb", "--camera", "c.json",
                           "--pixels", "2", "--size", "640x480", "--report", "-")
        self.assertLess(seen["triangles"], 30000)

    def test_what_was_extracted_can_be_built_again(self):
        self.report("extract", "torus.pietra", "-o", "full.ply", "--full", "--report", "-")
        self.build("full.ply", "again.pietra")
        again = self.report("info", "again.pietra", "--json")
        self.assertEqual(again["input"], {"triangles": 30000, "vertices": 15000, "files": 1})

    def test_extract_refusals(self):
        one = "give one of --error, --triangles, --full and --camera, to say how fine"
        self.assertRefused(["extract", "torus.pietra", "-o", "x.ply"], 2, one)
        self.assertRefused(["extract", "torus.pietra", "-o", "x.ply", "--full", "--error", "1"], 2, one)
        self.assertRefused(["extract", "torus.pietra", "-o", "x.abc", "--full"], 2,
                           "x.abc: the name of a mesh ends in .ply, .obj, .stl or .glb")
        self.write("c.json", '{"eye":[0,0],"target":[0,0,0]}')
        self.assertRefused(["extract", "torus.pietra", "-o", "x.ply", "--camera", "c.json"], 3,
                           "c.json: eye: is not an array of three numbers")

    def test_render_and_compare(self):
        one = self.report("render", "torus.pietra", "-o", "one.png", "--size", "320x256", "--view",
                          "iso", "--report", "-")
        full = self.report("render", "torus.pietra", "-o", "full.png", "--size", "320x256",
                           "--view", "iso", "--pixels", "0", "--report", "-")
        self.assertLessEqual(one["triangles"], full["triangles"])
        self.assertGreater(one["pixels_covered"], 5000)
        self.assertEqual(one["tolerance_px"], 1)
        for key in ("select", "load", "decode", "draw", "total"):
            self.assertGreaterEqual(one["ms"][key], 0)
        self.assertIn("ram", one["resident_bytes"])
        same = self.report("compare", "one.png", "one.png", "--json", "--max-px", "0",
                           "--max-shade", "0")
        self.assertTrue(same["ok"])
        self.report("compare", "one.png", "full.png", "--json", "--max-px", "2")
        self.report("render", "torus.pietra", "-o", "top.png", "--size", "320x256", "--view", "top",
                    "--report", "-")
        other = self.report("compare", "one.png", "top.png", "--json", "--max-px", "2", code=6)
        self.assertFalse(other["ok"])

    def test_a_picture_of_many_models_and_of_every_kind(self):
        for show in ("normals", "depth", "lod", "patches", "triangles", "error"):
            run = self.run_pietra("render", "torus.pietra", "torus.pietra", "-o", "x.png", "--size",
                                  "64x64", "--show", show, "--samples", "4", "--force")
            self.assertEqual(run.returncode, 0, run.stderr)
            self.assertEqual(self.read("x.png")[:8], b"\x89PNG\r\n\x1a\n")

    def test_render_refusals(self):
        end = " (see pietra render --help)"
        refuse = self.assertRefused
        refuse(["render", "torus.pietra", "-o", "x.jpg"], 2, "x.jpg: is not named .png")
        refuse(["render", "torus.pietra", "-o", "x.png", "--size", "0x5"], 2,
               "render: --size: '0x5': width and height must be from 1 to 16384" + end)
        refuse(["render", "torus.pietra", "-o", "x.png", "--view", "inside"], 2,
               "render: --view: 'inside' is none of front, back, left, right, top, bottom, iso" + end)
        refuse(["render", "torus.pietra", "-o", "x.png", "--pixels", "-1"], 2,
               "render: --pixels: '-1' must be at least 0" + end)
        refuse(["render", "torus.pietra", "-o", "x.png", "--show", "scalar:q"], 2,
               "torus.pietra: has no scalar 'q'")
        refuse(["render", "torus.pietra", "-o", "x.png", "--show", "colour"], 2,
               "torus.pietra: has no colours")
        refuse(["render", "torus.pietra", "-o", "x.png", "--camera", "no.json"], 4,
               "no.json: cannot open: No such file or directory")
        run = self.run_pietra("render", "torus.pietra", "-o", "x.png", "--ram", "1M")
        self.assertEqual(run.returncode, 5)
        self.assertRegex(run.stderr, r"^pietra: --ram 1\.0 MiB: drawing this needs \S+ MiB at least\n$")

    def test_compare_refusals(self):
        self.report("render", "torus.pietra", "-o", "a.png", "--size", "64x64", "--report", "-")
        self.report("render", "torus.pietra", "-o", "b.png", "--size", "32x64", "--report", "-")
        self.write("c.png", "no picture")
        self.assertEqual(self.run_pietra("compare", "a.png", "b.png").returncode, 2)
        self.assertEqual(self.run_pietra("compare", "a.png", "c.png").returncode, 3)
        self.assertEqual(self.run_pietra("compare", "a.png", "none.png").returncode, 4)


class Synth(CommandLineTest):
    def test_every_kind_is_a_mesh_that_can_be_built(self):
        for kind in ("sphere", "statue", "terrain"):
            run = self.run_pietra("synth", kind, "-o", f"{kind}.ply", "--triangles", "2k", "--report", "-")
            self.assertEqual(run.returncode, 0, run.stderr)
            triangles = json.loads(run.stdout)["triangles"]
            self.assertTrue(500 <= triangles <= 8000, f"{kind}: {triangles}")
            self.build(f"{kind}.ply", f"{kind}.pietra")
        run = self.run_pietra("synth", "subdivide", "sphere.ply", "-o", "more.ply", "--levels", "1",
                              "--report", "-")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.build("more.ply", "more.pietra")

    def test_the_same_seed_gives_the_same_bytes(self):
        for name, seed in (("a", "5"), ("b", "5"), ("c", "6")):
            self.run_pietra("synth", "terrain", "-o", f"{name}.ply", "--triangles", "2k", "--seed", seed)
        self.assertEqual(self.read("a.ply"), self.read("b.ply"))
        self.assertNotEqual(self.read("a.ply"), self.read("c.ply"))

    def test_refusals(self):
        refuse = self.assertRefused
        refuse(["synth"], 2, "synth: KIND is missing (see pietra synth --help)")
        run = self.run_pietra("synth", "cube", "-o", "x.ply")
        self.assertEqual(run.returncode, 2)
        self.assertRegex(run.stderr, r'^pietra: synth knows no "cube", but sphere, ')
        refuse(["synth", "subdivide", "-o", "x.ply"], 2, "synth subdivide needs a mesh to subdivide")
        refuse(["synth", "sphere", "-o", "x.abc"], 2,
               "x.abc: the name of a mesh ends in .ply, .obj, .stl or .glb")
        refuse(["synth", "sphere", "-o", "no/x.ply"], 4,
               "no/x.ply: cannot create: No such file or directory")


if __name__ == "__main__":
    PIETRA = os.path.abspath(sys.argv.pop(1))
    unittest.main()
