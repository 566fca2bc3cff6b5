#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the tests of the command line with a program that `make wheels` made: for another system by `make test-windows` and
`make test-aarch64`, for this one by `make test-archive`.

    tests/cli/emulated.py wine build/wheels/windows-x86_64/prefix/bin/pointfair.exe [test_verbs ...]
    tests/cli/emulated.py qemu build/wheels/linux-aarch64/prefix/bin/pointfair [test_verbs ...]
    tests/cli/emulated.py here build/archive/pointfair-0.1.0-macos-arm64/bin/pointfair [test_verbs ...]

What the emulator or the system cannot do is named in NOT_THERE, with the reason."""
import argparse
import collections
import concurrent.futures
import importlib
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile
import time
import unittest

HERE = pathlib.Path(__file__).resolve().parent
SLOW = {"test_kills", "test_outlier_classes", "test_survey", "test_tiled", "test_zones"}  # begun first
COMMANDS = {"wine": "wine", "qemu": "qemu-aarch64-static -L /usr/aarch64-linux-gnu", "here": ""}
BLOCKED = "it waits until Linux says that the process blocks a signal, which qemu does for the program without telling Linux"
OF_LINUX = "it uses a limit, a device or a folder /proc as Linux has them"
NOT_THERE = {"wine": {
    "test_bad_input.Files.test_no_permission": "wine runs for the user only that its folder belongs to",
    "test_bad_input.Files.test_no_thread_can_be_started": "wine runs for the user only that its folder belongs to",
    "test_bad_input.Outputs.test_a_link_to_nothing_is_no_output": "wine follows links before the program sees them",
    "test_bad_input.Outputs.test_a_report_has_any_name_that_a_file_can_have": "a limit of Linux, and reasons in other words",
    "test_bad_input.Outputs.test_a_report_on_a_full_device": "/dev/full is a device of Linux",
    "test_bad_input.Outputs.test_disk_full": "a limit of Linux",
    "test_bad_input.Outputs.test_output_equal_to_input": "Windows replaces no file that is being read, and the program says so",
    "test_bad_input.Outputs.test_a_report_follows_links_and_keeps_permissions": "Windows gives files no permissions",
    "test_bad_input.Streams": "pipes and devices have names that Windows does not know",
    "test_each.Each.test_the_table_of_a_run_that_was_stopped_goes_on": "Windows lacks SIGTERM and pipes in folders",
    "test_interrupt": "it waits until Linux says that the process blocks a signal, and sends SIGTERM, which Windows lacks",
    "test_kills": "limits of Linux, and moments of a run that are over before wine has started",
    "test_tiled.Bits.test_a_cloud_that_would_not_fit_is_computed_in_tiles_and_one_line_says_so": "a limit of Linux",
    "test_tiled.Cost.test_each_step_reads_and_writes_what_the_design_says": "what wine reads for itself counts, too",
    "test_tiled.Cost.test_halos_of_leaves_cost_little_beyond_the_halo": "what wine reads for itself counts, too",
    "test_view.View.test_saving_stays_in_its_folder": "whole paths begin with the letter of a drive",
    "test_shell": "Windows has neither bash nor manual pages",
    "test_pages.Pages.test_names_are_text": "Windows has no names of files with <",
}, "qemu": {
    "test_interrupt.Interrupt.test_in_the_middle_of_a_run": BLOCKED,
    "test_interrupt.Interrupt.test_a_closed_terminal_leaves_no_folder_of_tiles": BLOCKED,
    "test_interrupt.Interrupt.test_while_reading_standard_input": BLOCKED,
    "test_interrupt.Interrupt.test_while_writing_to_a_reader_that_waits": BLOCKED,
    "test_interrupt.Interrupt.test_bench": BLOCKED,
    "test_interrupt.Interrupt.test_an_ignored_interrupt_stays_ignored": BLOCKED,
}, "here": {} if sys.platform == "linux" else {
    "test_bad_input.Outputs.test_disk_full": OF_LINUX,
    "test_bad_input.Outputs.test_standard_output_full": OF_LINUX,
    "test_bad_input.Outputs.test_a_report_on_a_full_device": OF_LINUX,
    "test_bad_input.Outputs.test_memory": OF_LINUX,
    "test_bad_input.Streams": OF_LINUX,
    "test_interrupt": OF_LINUX,
    "test_kills": OF_LINUX,
    "test_tiled.Bits.test_a_cloud_that_would_not_fit_is_computed_in_tiles_and_one_line_says_so": OF_LINUX,
    "test_tiled.Cost": OF_LINUX,
    "test_view.View.test_a_server_without_free_file_handles_rests_and_goes_on_when_there_are": OF_LINUX,
}}


def tests_of(suite):
    for test in suite:
        yield from tests_of(test) if isinstance(test, unittest.TestSuite) else [test]


def run_one(name):
    """The name of a test, its seconds, what happened, and what it has to say."""
    result, begin = unittest.TestResult(), time.monotonic()
    unittest.defaultTestLoader.loadTestsFromName(name).run(result)
    said = [(kind, text) for kind, several in (("FAIL", result.failures), ("ERROR", result.errors), ("not run", result.skipped))
            for _, text in several]
    kind, text = said[0] if said else ("ok", "")
    return name, time.monotonic() - begin, kind, text


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("emulator", choices=COMMANDS)
    parser.add_argument("program")
    parser.add_argument("names", nargs="*", help="modules, classes or tests, as test_verbs; none: all")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="tests at a time")
    args = parser.parse_args()
    sys.path.insert(0, str(HERE))
    with tempfile.TemporaryDirectory() as folder:
        program, start = pathlib.Path(args.program).resolve(), pathlib.Path(folder, "bin/pointfair")
        start.parent.mkdir()
        start.parent.with_name("share").symlink_to(program.parent.parent / "share")  # the page, where the tests look for it
        start.write_text(f"#!/bin/sh\nexec {COMMANDS[args.emulator]} {shlex.quote(str(program))} \"$@\"\n")
        start.chmod(0o755)
        os.environ.update(POINTFAIR_BIN=str(start), WINEDEBUG="-all")
        if args.emulator == "wine":
            # the first program starts servers, which keep its output open until no program has run for a while: a test
            # would wait for that as for the end of its output
            subprocess.run([start, "--version"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        if COMMANDS[args.emulator]:
            os.environ.setdefault("POINTFAIR_KILLS", "3")  # half as often: each kill runs the program for a minute there
            importlib.import_module("program").TIMEOUT = 1200  # an emulator takes some ten times as long
        names, left_out = [], 0
        modules = args.names or sorted((path.stem for path in HERE.glob("test_*.py")), key=lambda name: (name not in SLOW, name))
        for test in tests_of(unittest.defaultTestLoader.loadTestsFromNames(modules)):
            name = test.id()
            reason = next((NOT_THERE[args.emulator][part] for part in (name, name.rpartition(".")[0], name.partition(".")[0])
                           if part in NOT_THERE[args.emulator]), None)
            if reason:
                left_out += 1
                print(f"not run: {name}: {reason}")
            else:
                names.append(name)
        outcomes = collections.Counter()
        with concurrent.futures.ProcessPoolExecutor(args.jobs) as pool:
            for done in concurrent.futures.as_completed([pool.submit(run_one, name) for name in names]):
                name, seconds, kind, text = done.result()
                outcomes[kind] += 1
                print(f"{kind}: {name}: {seconds:.1f} s{': ' if text else ''}{text}", flush=True)
        print(f"{outcomes['ok']} of {len(names) - outcomes['not run']} tests pass, {left_out + outcomes['not run']} not run")
        sys.exit(1 if outcomes["FAIL"] or outcomes["ERROR"] else 0)


if __name__ == "__main__":  # where processes are not forked, each reads this file again
    main()
