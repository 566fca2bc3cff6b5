#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the tests of the command line with the program for Windows, in wine: `make test-windows`.

    tests/cli/in_wine.py build/wheels/windows-x86_64/prefix/bin/pointfair.exe [test_verbs ...]

What wine or Windows cannot do is named in NOT_THERE, with the reason."""
import importlib
import os
import pathlib
import shlex
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
NOT_THERE = {
    "test_bad_input.Files.test_no_permission": "wine runs for the user only that its folder belongs to",
    "test_bad_input.Outputs.test_disk_full": "a limit of Linux",
    "test_bad_input.Outputs.test_output_equal_to_input": "Windows replaces no file that is being read, and the program says so",
    "test_interrupt": "it waits until Linux says that the process blocks a signal, and sends SIGTERM, which Windows lacks",
    "test_kills": "limits of Linux, and moments of a run that are over before wine has started",
    "test_tiled.Bits.test_a_cloud_that_would_not_fit_is_computed_in_tiles_and_one_line_says_so": "a limit of Linux",
    "test_tiled.Cost.test_each_step_reads_and_writes_what_the_design_says": "what wine reads for itself counts, too",
    "test_tiled.Cost.test_halos_of_leaves_cost_little_beyond_the_halo": "what wine reads for itself counts, too",
    "test_zones.Zones.test_a_run_that_was_killed_goes_on": "every run is killed before wine has started it",
    "test_view.View.test_saving_stays_in_its_folder": "whole paths begin with the letter of a drive",
    "test_pages.Pages.test_names_are_text": "Windows has no names of files with <",
}


def tests_of(suite):
    for test in suite:
        yield from tests_of(test) if isinstance(test, unittest.TestSuite) else [test]


def main():
    program, *names = sys.argv[1:]
    sys.path.insert(0, str(HERE))
    with tempfile.TemporaryDirectory() as folder:
        program, start = pathlib.Path(program).resolve(), pathlib.Path(folder, "bin/pointfair")
        start.parent.mkdir()
        start.parent.with_name("share").symlink_to(program.parent.parent / "share")  # the page, where the tests look for it
        start.write_text(f"#!/bin/sh\nexec wine {shlex.quote(str(program))} \"$@\"\n")
        start.chmod(0o755)
        os.environ.update(POINTFAIR_BIN=str(start), WINEDEBUG="-all")
        suite, left_out = unittest.TestSuite(), 0
        for name in names or sorted(path.stem for path in HERE.glob("test_*.py")):
            for test in tests_of(unittest.defaultTestLoader.loadTestsFromModule(importlib.import_module(name))):
                reason = NOT_THERE.get(name) or NOT_THERE.get(test.id())
                if reason:
                    left_out += 1
                    print(f"not run: {test.id()}: {reason}")
                else:
                    suite.addTest(test)
        result = unittest.TextTestRunner().run(suite)
        skipped, wrong = len(result.skipped), len(result.failures) + len(result.errors)
        print(f"{result.testsRun - skipped - wrong} of {result.testsRun - skipped} tests pass, {left_out + skipped} not run")
        sys.exit(0 if result.wasSuccessful() else 1)


main()
