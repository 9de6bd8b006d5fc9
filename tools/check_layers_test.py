#!/usr/bin/env python3
"""Shows that check_layers.py finds what it is for, on small trees that break one rule each."""

import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SCRIPT = Path(__file__).with_name("check_layers.py")

GOOD = {
    "CMakeLists.txt": "add_subdirectory(src/base)\nadd_subdirectory(src/geometry)\n"
                      "add_subdirectory(src/methods/tetra)\nadd_subdirectory(src/methods/pmesh)\n"
                      "add_subdirectory(src/render)\nadd_subdirectory(tests)\n",
    "src/base/CMakeLists.txt": "add_module(base PACKAGES fmt::fmt)\n",
    "src/base/error.h": "#include <string>\n",
    "src/geometry/CMakeLists.txt": "add_module(geometry DEPENDS base)\n",
    "src/geometry/box.h": "#include <vector>\n#include \"base/error.h\"\n",
    "src/geometry/box.cpp": "#include \"geometry/box.h\"\n",
    "src/methods/tetra/CMakeLists.txt": "add_module(tetra DEPENDS base\n    geometry PACKAGES zstd)\n",
    "src/methods/tetra/build.h": "#include \"geometry/box.h\"\n",
    "src/methods/pmesh/CMakeLists.txt": "add_module(pmesh DEPENDS geometry)\n",
    "src/render/CMakeLists.txt": "add_module(render DEPENDS geometry)\nadd_subdirectory(raster)\n",
    "src/render/raster/CMakeLists.txt": "add_module(raster DEPENDS render geometry)\n",
    "src/render/raster/fill.cpp": "#include \"geometry/box.h\"\n",
    "tests/CMakeLists.txt": "",
}


class CheckLayers(unittest.TestCase):
    def check(self, changes):
        """Exit code and output for the good tree with some files replaced or added."""
        with tempfile.TemporaryDirectory() as root:
            for name, text in {**GOOD, **changes}.items():
                path = Path(root, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text)
            run = subprocess.run([sys.executable, SCRIPT, root], capture_output=True, text=True)
            return run.returncode, run.stdout + run.stderr

    def assertFault(self, changes, text):
        code, output = self.check(changes)
        self.assertEqual(code, 1, output)
        self.assertIn(text, output)

    def test_a_good_tree_passes(self):
        code, output = self.check({})
        self.assertEqual(code, 0, output)
        self.assertIn("6 modules, 4 includes, 0 faults", output)

    def test_an_undeclared_include(self):
        self.assertFault({"src/render/raster/fill.cpp": "\n#  include \"base/error.h\"\n"},
                         'src/render/raster/fill.cpp:2: raster does not declare that it depends on '
                         'base, but includes "base/error.h"')

    def test_an_include_upwards(self):
        self.assertFault({"src/base/error.h": "#include \"geometry/box.h\"\n"},
                         "src/base/error.h:1: base does not declare that it depends on geometry")

    def test_a_dependence_upwards(self):
        self.assertFault({"src/base/CMakeLists.txt": "add_module(base DEPENDS geometry)"},
                         "base depends on geometry, which is not above it")

    def test_an_unknown_dependence(self):
        self.assertFault({"src/render/CMakeLists.txt": "add_module(render DEPENDS gl)"},
                         "render depends on gl, which is not above it")

    def test_methods_do_not_know_each_other(self):
        self.assertFault({"src/methods/pmesh/CMakeLists.txt": "add_module(pmesh DEPENDS tetra)"},
                         "the method pmesh depends on the method tetra")

    def test_folders_of_a_method_are_of_it(self):
        deeper = "add_subdirectory(src/methods/pmesh/front)\nadd_subdirectory(src/methods/pmesh/gl)\n"
        code, output = self.check({
            "CMakeLists.txt": GOOD["CMakeLists.txt"] + deeper,
            "src/methods/pmesh/front/CMakeLists.txt": "add_module(front DEPENDS pmesh)\n",
            "src/methods/pmesh/gl/CMakeLists.txt": "add_module(pmesh_gl DEPENDS pmesh front)\n"})
        self.assertEqual(code, 0, output)

    def test_renderers_know_no_method(self):
        self.assertFault({"src/render/raster/CMakeLists.txt": "add_module(raster DEPENDS tetra)"},
                         "raster must not know methods, but depends on tetra")

    def test_a_header_that_is_not_there(self):
        for include in ("box.h", "../geometry/box.h", "geometry/bax.h", "fmt/format.h"):
            self.assertFault({"src/geometry/box.cpp": f'#include "{include}"\n'},
                             f'"{include}" is no header of src/')

    def test_a_folder_without_a_module(self):
        self.assertFault({"src/loose/x.h": "#include \"base/error.h\"\n"},
                         "src/loose/x.h:1: the folder declares no module")


if __name__ == "__main__":
    unittest.main()
