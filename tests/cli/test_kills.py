# SPDX-License-Identifier: Apache-2.0
"""Runs in tiles that are killed, interrupted, or have no room go on, and end with the bits of the run in memory.

POINTFAIR_KILLS=50 kills so often, at random moments (unset: 6); POINTFAIR_SEED=N has other moments."""
import math
import os
import random
import shutil
import signal
import subprocess
import time

from program import BIN, Case, default_signals, run, sphere_points
from test_tiled import write_binary

KILLS = int(os.environ.get("POINTFAIR_KILLS", 6))
SEED = int(os.environ.get("POINTFAIR_SEED", 1))
TILES = 6
LEFT_BY_TASKS = ("chunk-", "measured", "tile-", "done-", "written-")


def finished(folder):
    """What tasks left, with what tells a file from another one under its name."""
    return {entry.name: (entry.stat().st_ino, entry.stat().st_mtime_ns) for entry in folder.iterdir()
            if entry.name.startswith(LEFT_BY_TASKS)} if folder.exists() else {}


def half_written(folder):
    return [name for name in os.listdir(folder) if name.startswith(".")] if folder.exists() else []


class Killed(Case):
    def setUp(self):
        super().setUp()
        self.generator = random.Random(SEED)
        self.source = write_binary(self.path("in.ply"), sphere_points(30000, 0.01))
        self.fair, self.work = self.path("fair"), self.path("work")
        self.fair.mkdir()
        self.out = self.fair / "out.ply"
        self.ok("run", self.source, self.path("whole.ply"), "-q")
        self.words = [BIN, "run", self.source, self.out, "--tiles", str(TILES), "--memory", "64M", "-q"]
        begin = time.monotonic()
        subprocess.run([*self.words, "--work", self.work], check=True)
        self.duration = time.monotonic() - begin
        self.start_anew()

    def start_anew(self):
        shutil.rmtree(self.work, ignore_errors=True)
        self.out.unlink(missing_ok=True)

    def expect_the_bits_and_nothing_else(self):
        self.assertEqual(self.out.read_bytes(), self.path("whole.ply").read_bytes())
        self.assertEqual([entry.name for entry in self.fair.iterdir()], ["out.ply"])
        self.assertEqual(half_written(self.work), [])

    def expect_nothing_was_done_again(self, before):
        now = finished(self.work)
        self.assertEqual({name: mark for name, mark in now.items() if name in before},
                         {name: mark for name, mark in before.items() if name in now})

    def kill_at_random(self, words, number=signal.SIGKILL):
        """Returns whether the process was there to be killed, and what was finished by then."""
        process = subprocess.Popen(words, stderr=subprocess.PIPE, preexec_fn=default_signals)
        try:
            process.wait(self.generator.uniform(0, self.duration))
        except subprocess.TimeoutExpired:
            pass
        if process.poll() is None:
            process.send_signal(signal.SIGSTOP)
            os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
        done = finished(self.work)
        self.assertLessEqual(len(half_written(self.work)), 1)
        process.send_signal(number)
        process.send_signal(signal.SIGCONT)
        text = process.communicate()[1].decode()
        if process.returncode != 0:
            self.assertEqual((process.returncode, text),
                             (-9, "") if number == signal.SIGKILL else (130, "pointfair: interrupted\n"))
        return process.returncode != 0, done

    def test_a_run_that_is_killed_goes_on_with_what_is_finished(self):
        words, kills = [*self.words, "--work", self.work], 0
        while kills < KILLS:
            was_killed, done = self.kill_at_random(words)
            kills += was_killed
            if not was_killed:
                self.expect_the_bits_and_nothing_else()
                self.start_anew()
            elif kills % 3 == 0:
                self.assertEqual(run(*words[1:]).returncode, 0)
                self.expect_nothing_was_done_again(done)
                self.expect_the_bits_and_nothing_else()
                self.start_anew()
        subprocess.run(words, check=True)
        self.expect_the_bits_and_nothing_else()

    def test_a_run_that_is_interrupted_goes_on_with_what_is_finished(self):
        words, stops = [*self.words, "--work", self.work], 0
        while stops < max(3, KILLS // 2):
            was_stopped, done = self.kill_at_random(words, self.generator.choice([signal.SIGINT, signal.SIGTERM]))
            stops += was_stopped
            self.assertEqual([name for name in os.listdir(self.fair) if name.startswith(".")], [])
            if was_stopped:
                self.assertEqual(half_written(self.work), [])
            else:
                self.expect_the_bits_and_nothing_else()
                self.start_anew()
        subprocess.run(words, check=True)
        self.expect_nothing_was_done_again(done)
        self.expect_the_bits_and_nothing_else()

    def test_a_worker_that_is_killed_loses_the_one_task_that_it_had(self):
        kills = 0
        while kills < KILLS:
            self.start_anew()
            self.ok("tile", "plan", self.source, "--out", self.out, "--work", self.work, "--tiles", TILES, "--memory", "64M")
            begun = total = here = 0
            for step in self.report("tile", "status", self.work)["steps"]:
                tasks = [f"{step['step']}:{task}" for task in range(step["tasks"])]
                total += len(tasks)
                while tasks:  # two workers, each with a task
                    pair = [subprocess.Popen([BIN, "tile", "run", self.work, "--task", task]) for task in tasks[:2]]
                    begun += len(pair)
                    victim = self.generator.choice(pair)
                    try:
                        victim.wait(self.generator.uniform(0, 8 * self.duration / (2 * TILES)))
                    except subprocess.TimeoutExpired:
                        victim.kill()
                    ended = [worker.wait() for worker in pair]
                    here += ended.count(-9)
                    self.assertEqual(set(ended) - {0, -9}, set())
                    tasks = [task for task, code in zip(tasks, ended) if code != 0] + tasks[2:]
            self.assertEqual(begun, total + here)
            self.ok("tile", "merge", self.work, "-q")
            self.expect_the_bits_and_nothing_else()
            kills += max(here, 1)

    def test_what_a_killed_run_left_beside_its_output_is_removed_by_the_next(self):
        kills = 0
        while kills < KILLS:
            was_killed, _ = self.kill_at_random(self.words)
            kills += was_killed
            self.out.unlink(missing_ok=True)
            if kills % 2:
                subprocess.run(self.words, check=True)
                self.assertEqual(os.listdir(self.fair), ["out.ply"])
                self.out.unlink()
        subprocess.run(self.words, check=True)
        self.assertEqual(os.listdir(self.fair), ["out.ply"])

    def test_a_run_whose_input_was_changed_meanwhile_is_refused(self):
        words = [*self.words, "--work", self.work]
        while not self.kill_at_random(words)[0] or not self.work.exists() or "plan.txt" not in os.listdir(self.work):
            self.start_anew()
        data = bytearray(self.source.read_bytes())
        data[-8] ^= 1
        self.source.write_bytes(bytes(data))
        self.out.unlink(missing_ok=True)
        result = run(*words[1:])
        self.assertEqual(result.returncode, 3)
        self.assert_one_line(result.stderr.decode())
        self.assertIn(b"changed", result.stderr)
        self.assertFalse(self.out.exists())


class Full(Case):
    """Small file systems in memory, each in a name space of its own."""

    def with_room(self, script, *words):
        """Runs the script with `small` mounted at 100 kB; `grow` makes it large."""
        small = self.path("small")
        small.mkdir(exist_ok=True)
        head = f"mount -t tmpfs -o size=100k none {small} || exit 99; grow() {{ mount -o remount,size=64m {small}; }}; "
        result = subprocess.run(["unshare", "-rm", "sh", "-c", head + script, "sh", *map(str, words)], capture_output=True)
        text = result.stderr.decode()
        if "unshare" in text or result.returncode == 99:
            self.skipTest("no file system can be mounted here")
        return result.stdout.decode(), text

    def expect_missing(self, text):
        self.assert_one_line(text)
        missing = text.split(" bytes more")[0] if " bytes more" in text else text.split(" more than there is room")[0]
        self.assertGreater(int(missing.replace(" bytes,", "").split()[-1]), 0, text)

    def setUp(self):
        super().setUp()
        self.source = write_binary(self.path("in.ply"), sphere_points(20000, 0.01))
        self.ok("run", self.source, self.path("whole.ply"), "-q")

    def test_an_output_that_has_no_room_is_one_line_that_says_how_much_and_no_output(self):
        small = self.path("small")
        script = (f"{BIN} run {self.source} {small}/out.ply --tiles 5 --work {self.path('work')} -q; echo code $?; ls -A {small}; "
                  f"grow; {BIN} run {self.source} {small}/out.ply --tiles 5 --work {self.path('work')} -q; echo again $?; "
                  f"cmp {small}/out.ply {self.path('whole.ply')} && echo same")
        out, text = self.with_room(script)
        self.assertEqual(out, "code 3\nagain 0\nsame\n", text)
        self.expect_missing(text)
        size = self.path("whole.ply").stat().st_size
        self.assertIn(f"needs {size} bytes, ", text)

    def test_a_work_folder_that_has_no_room_is_one_line_that_says_how_much_and_the_run_goes_on(self):
        small, out = self.path("small"), self.path("out.ply")
        words = f"{BIN} run {self.source} {out} --tiles 5 --work {small}/work -q"
        script = f"{words}; echo code $?; grow; {words}; echo again $?"
        said, text = self.with_room(script)
        self.assertEqual(said, "code 3\nagain 0\n", text)
        self.expect_missing(text)
        self.assertEqual(out.read_bytes(), self.path("whole.ply").read_bytes())

    def test_a_task_that_has_no_room_is_one_line_that_says_how_much_and_leaves_no_file(self):
        small, work = self.path("small"), self.path("small") / "work"
        script = (f"grow; {BIN} tile plan {self.source} --out {self.path('out.ply')} --work {work} --tiles 5 || exit; "
                  f"{BIN} tile run {work} --task ingest && {BIN} tile run {work} --task measure || exit; "
                  f"head -c $(($(df -B1 --output=avail {small} | tail -1) - 65536)) /dev/zero > {small}/others; "
                  f"{BIN} tile run {work} --task denoise-1; echo code $?; ls -A {work} | grep -c unfinished; "
                  f"rm {small}/others; {BIN} tile run {work} --all -q; echo again $?")
        said, text = self.with_room(script)
        self.assertEqual(said, "code 3\n0\nagain 0\n", text)
        self.expect_missing(text)
        self.assertEqual(self.path("out.ply").read_bytes(), self.path("whole.ply").read_bytes())


class Group:
    """A memory control group (version 1) with a limit, left and removed at the end."""

    def __init__(self, test, limit):
        self.folder = f"/sys/fs/cgroup/memory/pointfair-test-{os.getpid()}"
        try:
            os.mkdir(self.folder)
        except OSError as error:
            test.skipTest(f"no memory control group can be made here: {error}")
        test.addCleanup(self.remove)
        self.set("memory.limit_in_bytes", limit)

    def set(self, name, value):
        with open(f"{self.folder}/{name}", "w") as file:
            file.write(str(value))

    def enter(self):
        self.set("cgroup.procs", os.getpid())

    def get(self, name):
        with open(f"{self.folder}/{name}") as file:
            return file.read()

    def remove(self):
        for _ in range(50):
            try:
                return os.rmdir(self.folder)
            except OSError:
                time.sleep(0.1)


class Memory(Case):
    def test_a_run_stays_within_its_memory_under_a_control_group_that_has_no_more(self):
        source = self.path("in.ply")
        self.ok("noise", write_binary(self.path("few.ply"), sphere_points(1000, 0)), source, "--sigma", "0.1%", "-q")
        points = sphere_points(4000, 0.01)
        several = [tuple(c + 3 * math.floor(i / len(points)) for c in points[i % len(points)]) for i in range(800000)]
        write_binary(source, several)
        self.ok("run", source, self.path("whole.ply"), "-q", "--k", 8)
        memory = 64 << 20
        group = Group(self, memory * 11 // 10)
        self.ok("run", source, self.path("out.ply"), "-q", "--k", 8, "--memory", "64M", preexec_fn=group.enter)
        self.assertIn("oom_kill 0", group.get("memory.oom_control"))
        self.assertEqual(self.path("out.ply").read_bytes(), self.path("whole.ply").read_bytes())

    def planned(self, source, **options):
        self.ok("tile", "plan", source, "--out", self.path("out.ply"), "--work", self.path("work"), **options)
        text = (self.path("work") / "plan.txt").read_text()
        shutil.rmtree(self.path("work"))
        return int(next(line.split()[1] for line in text.splitlines() if line.startswith("memory ")))

    def test_half_of_what_is_free_is_that_of_the_control_group_and_cached_files_count_as_free(self):
        source = write_binary(self.path("in.ply"), sphere_points(2000, 0.01))
        limit = 400 << 20
        group = Group(self, limit)
        cached = self.path("cached")
        with open(cached, "wb") as file:
            file.truncate(limit)
        subprocess.run(["sh", "-c", f"cat {cached} > /dev/null"], preexec_fn=group.enter, check=True)
        self.assertGreater(int(group.get("memory.usage_in_bytes")), limit // 2)
        memory = self.planned(source, preexec_fn=group.enter)
        self.assertGreater(memory, 0.45 * limit)
        self.assertLess(memory, 0.5 * limit)

    def test_a_task_that_this_machine_has_no_memory_for_says_so_and_does_nothing(self):
        source = self.path("in.ply")
        points = sphere_points(5000, 0.01)
        write_binary(source, points * 200)
        self.ok("tile", "plan", source, "--out", self.path("out.ply"), "--work", self.path("work"), "--memory", "512M")
        self.ok("tile", "run", self.path("work"), "--task", "ingest")
        self.ok("tile", "run", self.path("work"), "--task", "measure")
        group = Group(self, 100 << 20)
        self.fails(4, "tile", "run", self.path("work"), "--task", "denoise-1:0", preexec_fn=group.enter,
                   says=("denoise-1, task 0", "MiB are free here"))
