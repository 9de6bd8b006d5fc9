#!/usr/bin/env python3
"""The command line as a user types it: exit codes, exact messages, and where they go.

usage: command_line_test.py PIETRA [unittest arguments]
"""

import os
import subprocess
import sys
import tempfile
import unittest

PIETRA = None


class CommandLineTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="pietra-cli-")
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

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


if __name__ == "__main__":
    PIETRA = os.path.abspath(sys.argv.pop(1))
    unittest.main()
