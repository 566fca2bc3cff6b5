#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the tests of the command line with a program for another system: `make test-windows`, `make test-aarch64`.

    tests/cli/emulated.py wine build/wheels/windows-x86_64/prefix/bin/pointfair.exe [test_verbs ...]
    tests/cli/emulated.py qemu build/wheels/linux-aarch64/prefix/bin/pointfair [test_verbs ...]

What the emulator or the system cannot do is named in NOT_THERE, with the reason."""
import importlib
import os
import pathlib
import shlex
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
COMMANDS = {"wine": "wine", "qemu": "qemu-aarch64-static -L /usr/aarch64-linux-gnu"}
BLOCKED = "it waits until Linux says that the process blocks a signal, which qemu does for the program without telling Linux"
NOT_THERE = {"wine": {
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
}, "qemu": {
    "test_interrupt.Interrupt.test_in_the_middle_of_a_run": BLOCKED,
    "test_interrupt.Interrupt.test_while_reading_standard_input": BLOCKED,
    "test_interrupt.Interrupt.test_while_writing_to_a_reader_that_waits": BLOCKED,
    "test_interrupt.Interrupt.test_bench": BLOCKED,
    "test_interrupt.Interrupt.test_an_ignored_interrupt_stays_ignored": BLOCKED,
}}


def tests_of(suite):
    for test in suite:
        yield from tests_of(test) if isinstance(test, unittest.TestSuite) else [test]


def main():
    emulator, program, *names = sys.argv[1:]
    sys.path.insert(0, str(HERE))
    with tempfile.TemporaryDirectory() as folder:
        program, start = pathlib.Path(program).resolve(), pathlib.Path(folder, "bin/pointfair")
        start.parent.mkdir()
        start.parent.with_name("share").symlink_to(program.parent.parent / "share")  # the page, where the tests look for it
        start.write_text(f"#!/bin/sh\nexec {COMMANDS[emulator]} {shlex.quote(str(program))} \"$@\"\n")
        start.chmod(0o755)
        os.environ.update(POINTFAIR_BIN=str(start), WINEDEBUG="-all")
        suite, left_out = unittest.TestSuite(), 0
        for name in names or sorted(path.stem for path in HERE.glob("test_*.py")):
            for test in tests_of(unittest.defaultTestLoader.loadTestsFromModule(importlib.import_module(name))):
                reason = NOT_THERE[emulator].get(name) or NOT_THERE[emulator].get(test.id())
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
