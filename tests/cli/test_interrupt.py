# SPDX-License-Identifier: Apache-2.0
"""Interrupts end a run at once, leave no half file, and a reader that leaves makes no noise."""
import os
import pathlib
import re
import signal
import socket
import subprocess
import time

from program import BIN, Case, default_signals, sphere_points, write_ply


def wait_until_heard(process, number):
    """Until the program waits for the signal, which it blocks for that."""
    while process.poll() is None:
        status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
        waits = int(re.search(r"^SigBlk:\s*([0-9a-f]+)", status, re.M)[1], 16)
        if waits >> (number - 1) & 1:
            return
        time.sleep(0.001)
    raise AssertionError(f"the program ended before it waited for signal {number}: {process.returncode}")


class Interrupt(Case):
    def start(self, *words, **options):
        return subprocess.Popen([BIN, *map(str, words)], stderr=subprocess.PIPE, preexec_fn=default_signals, **options)

    def interrupt(self, process, number):
        """Sends the signal; the program ends with one line."""
        wait_until_heard(process, number)
        process.send_signal(number)
        process.wait(60)
        lines = process.stderr.read().decode().splitlines()
        process.stderr.close()
        self.assertEqual(process.returncode, 130, lines)
        self.assertEqual([line for line in lines if line.startswith("pointfair:")], lines[-1:])
        self.assertIn("interrupted", lines[-1])

    def grow(self, count):
        vertices = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
        mesh = write_ply(self.path("mesh.ply"), vertices, [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)])
        self.ok("noise", mesh, self.path("in.ply"), "--points", count, "--sigma", "0.1%", "-q")
        return self.path("in.ply")

    def test_in_the_middle_of_a_run(self):
        cloud = self.grow(100000)
        before = self.files()
        for number, stage in ((signal.SIGINT, b"neighbors"), (signal.SIGTERM, b"normals"), (signal.SIGINT, b"fairing"),
                              (signal.SIGHUP, b"fairing")):
            process = self.start("run", cloud, self.path("out.ply"), "--k", 200, "--iterations", 100, "--progress", "plain")
            for line in process.stderr:
                if line.strip() == stage:
                    break
            self.interrupt(process, number)
            self.assertEqual(self.files(), before)

    def test_a_closed_terminal_leaves_no_folder_of_tiles(self):
        cloud = self.grow(100000)
        before = self.files()
        process = self.start("run", cloud, self.path("out.ply"), "--k", 100, "--tiles", 4, "--progress", "plain")
        while not any(self.folder.glob(".pointfair-work-*/tile-*")):
            self.assertIsNone(process.poll())
            time.sleep(0.001)
        self.interrupt(process, signal.SIGHUP)
        self.assertEqual(self.files(), before)

    def test_an_input_that_is_cut_short_meanwhile(self):
        cloud = self.grow(100000)
        before = self.files()
        process = self.start("run", cloud, self.path("out.ply"), "--k", 100, "--iterations", 3, "--progress", "plain")
        for line in process.stderr:
            if line.strip() == b"normals":
                break
        os.truncate(cloud, 1000)
        process.wait(60)
        last = process.stderr.read().decode().splitlines()[-1]
        process.stderr.close()
        self.assertEqual(process.returncode, 3)
        self.assertRegex(last, "^pointfair: a file became shorter.*copy it again")
        self.assertEqual(self.files(), before)

    def test_while_reading_standard_input(self):
        process = self.start("run", "-", self.path("out.ply"), stdin=subprocess.PIPE)
        process.stdin.write(b"ply\nformat ascii 1.0\n")
        process.stdin.flush()
        self.interrupt(process, signal.SIGTERM)
        process.stdin.close()
        self.assertEqual(self.files(), [])

    def test_while_writing_to_a_reader_that_waits(self):
        cloud = self.grow(100000)
        process = self.start("noise", cloud, "-", "-q", stdout=subprocess.PIPE)
        process.stdout.read(1)
        self.interrupt(process, signal.SIGTERM)
        process.stdout.close()

    def test_during_each_phase_of_a_short_run_the_output_is_whole_or_absent(self):
        cloud = self.grow(200000)
        before = self.files()
        size = cloud.stat().st_size
        for delay in range(10):
            process = self.start("noise", cloud, self.path("out.ply"), "--sigma", "1%", "-q")
            time.sleep(0.01 * delay)
            process.send_signal(signal.SIGTERM)
            process.wait(60)
            process.stderr.close()
            self.assertIn(process.returncode, (0, 130, -signal.SIGTERM))  # the last: before it had begun
            if self.path("out.ply").exists():
                self.assertEqual(self.path("out.ply").stat().st_size, size)
                self.path("out.ply").unlink()
            self.assertEqual(self.files(), before)

    def test_what_a_killed_run_left_goes_with_the_next_output(self):
        cloud = self.grow(1000)
        dead = subprocess.Popen(["true"])
        dead.wait()
        numbers = "-" + re.sub(r"\D", "", os.readlink("/proc/self/ns/pid"))
        left, of_another = (self.path(f".pointfair-{name}-{dead.pid}-0")
                            for name in (socket.gethostname() + numbers, socket.gethostname() + numbers + "1"))
        for file in (left, of_another):
            file.write_bytes(b"half")
        self.ok("noise", cloud, self.path("out.ply"), "--sigma", "1%", "-q")
        self.assertFalse(left.exists())
        self.assertTrue(of_another.exists())

    def test_bench(self):
        process = self.start("bench", "--points", 200000, "--repeat", 1000, stdout=subprocess.PIPE)
        self.interrupt(process, signal.SIGINT)
        process.stdout.close()

    def test_an_ignored_interrupt_stays_ignored(self):
        process = subprocess.Popen([BIN, "run", "-", self.path("out.ply"), "-q"], stdin=subprocess.PIPE,
                                   stderr=subprocess.PIPE,
                                   preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
        wait_until_heard(process, signal.SIGTERM)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(write_ply(self.path("in.ply"), sphere_points(50, 0.01)).read_bytes(), 60)
        self.assertEqual(process.returncode, 0, errors)


class BrokenPipe(Case):
    def test_a_reader_that_leaves(self):
        cloud = write_ply(self.path("in.ply"), sphere_points(100, 0.01))
        for words in (["run", cloud, "-", "-q"], ["info", cloud], ["doctor"], ["--help"]):
            reading, writing = os.pipe()
            os.close(reading)
            result = subprocess.run([BIN, *map(str, words)], stdout=writing, stderr=subprocess.PIPE)
            os.close(writing)
            self.assertEqual((result.returncode, result.stderr), (1, b""), words)
