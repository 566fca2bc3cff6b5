# SPDX-License-Identifier: Apache-2.0
"""Habits of Python: Ctrl-C, threads, progress, exceptions."""
import contextlib
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from clouds import same_bits, waves

import pointfair as pf

# As slow as parameters can make it, so that a signal meets it in the middle.
SLOW = {"k": 512, "iterations": 100, "noise": 0.01}
POINTS = waves(30000)


@contextlib.contextmanager
def signal_after(seconds, number=signal.SIGINT):
    timer = threading.Timer(seconds, os.kill, [os.getpid(), number])
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


FEW = waves(6000)


@pytest.mark.parametrize("call", [
    lambda: pf.denoise(POINTS, threads=2, **SLOW), lambda: pf.denoise(pf.Cloud(POINTS), threads=2, **SLOW),
    lambda: pf.denoise_batch([POINTS] * 50, threads=2, **SLOW),
    lambda: pf.denoise(POINTS, threads=2, progress=lambda share, stage: None, **SLOW),
    lambda: pf.denoise(FEW, threads=1, k=512, iterations=100),
    lambda: pf.denoise(FEW, threads=1, radius=10.0, min_neighbors=1, iterations=100),
])
def test_ctrl_c_stops_a_run(call):
    before = time.process_time()
    with signal_after(0.4), pytest.raises(KeyboardInterrupt):
        call()
    # seconds of all threads, so that another program takes no part; to their end the runs take more than 10
    assert time.process_time() - before < 5


def test_a_pipeline_goes_on_after_ctrl_c():
    pipeline = pf.Pipeline("cpu")
    pipeline.load(POINTS)
    with signal_after(0.4), pytest.raises(KeyboardInterrupt):
        pipeline.run(**SLOW)
    assert same_bits(pipeline.run(k=8, iterations=1), pf.denoise(POINTS, k=8, iterations=1))


def test_a_handler_that_raises_stops_a_run_and_one_that_does_not_lets_it_go_on():
    class Alarm(Exception):
        pass

    def fail(number, frame):
        raise Alarm

    heard = []
    for handler, parameters in ((fail, SLOW), (lambda *_: heard.append(1), {"k": 300, "iterations": 3, "noise": 0.01})):
        before = signal.signal(signal.SIGUSR1, handler)
        try:
            with signal_after(0.1, signal.SIGUSR1):
                if handler is fail:
                    with pytest.raises(Alarm):
                        pf.denoise(POINTS, **parameters)
                else:
                    pf.denoise(POINTS, **parameters)
        finally:
            signal.signal(signal.SIGUSR1, before)
    assert heard == [1]


def test_progress_goes_from_nothing_to_all():
    seen = []
    pf.denoise(POINTS, k=200, iterations=3, progress=lambda share, stage: seen.append((share, stage)))
    shares = [share for share, stage in seen]
    assert shares == sorted(shares) and seen[-1] == (1.0, "done") and all(isinstance(stage, str) for _, stage in seen)


def test_an_exception_of_the_progress_function_stops_the_run_and_comes_out():
    told = []

    def fail(share, stage):
        told.append(share)
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        pf.denoise(POINTS, progress=fail, **SLOW)
    assert len(told) == 1 and told[0] < 1


def test_progress_true_shows_a_bar(capsys):
    pytest.importorskip("tqdm")
    pf.denoise(POINTS, k=300, iterations=3, progress=True)
    assert "%" in capsys.readouterr().err


def test_other_threads_go_on_during_a_run():
    counted, done = [0], threading.Event()

    def count():
        while not done.is_set():
            counted[0] += 1
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    before = counted[0]
    pf.denoise(POINTS, k=200, iterations=2)
    during = counted[0] - before
    done.set()
    counter.join()
    assert during > 10


def test_a_pipeline_refuses_a_second_thread():
    pipeline = pf.Pipeline("cpu")
    pipeline.load(POINTS)
    errors = []

    def second(share, stage):
        try:
            pipeline.load(POINTS[:50])
        except pf.UsageError as error:
            errors.append(str(error))

    pipeline.run(k=200, iterations=3, progress=lambda *told: (thread := threading.Thread(target=second, args=told)).start() or thread.join())
    assert errors and "another thread" in errors[0]
    assert same_bits(pipeline.run(k=8), pf.denoise(POINTS, k=8))  # what was refused has changed nothing


def test_exceptions_belong_to_pythons_families():
    for kind, family in ((pf.UsageError, ValueError), (pf.FileError, OSError), (pf.DeviceError, RuntimeError), (pf.OutOfMemory, MemoryError)):
        assert issubclass(kind, family) and issubclass(kind, pf.Error) and kind.__module__ == "pointfair" and kind.__doc__


def test_memory_is_flat_over_many_frames():
    import resource
    pipeline, frame = pf.Pipeline("cpu"), waves(5000, dtype=np.float32)
    pipeline.load(frame)
    params = pipeline.resolve(k=8, iterations=1)

    def run(frames):
        for _ in range(frames):
            pipeline.load(frame)
            pipeline.run(params)
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    warm = run(30)
    assert run(150) - warm < 20 * 1024  # KiB; a copy of each result would be 9 MB, of each state 100 MB


def test_no_memory_is_lost_with_each_call():
    """10,000 frames of 5,000 points took 85 MiB, with a new thread for each call."""
    code = ("import os, numpy as np, pointfair as pf\n"
            "x = np.random.default_rng(1).random((5000, 3)); p = pf.Pipeline('cpu')\n"
            "def resident(calls):\n"
            "    for _ in range(calls): p.load(x)\n"
            "    return int(open('/proc/self/statm').read().split()[1]) * os.sysconf('SC_PAGE_SIZE') / 2**20\n"
            "first = resident(200)\n"
            "print(resident(1500) - first)\n")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(done.stdout) < 4  # MiB; 14 where each call leaves 9 KiB


def test_runs_of_many_threads_have_a_helper_each():
    results, points = [], [waves(3000, seed=i) for i in range(8)]
    expected = [pf.denoise(cloud, k=12) for cloud in points]

    def work(i):
        results.append((i, pf.denoise(points[i], k=12)))

    for _ in range(3):
        threads = [threading.Thread(target=work, args=[i]) for i in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert len(results) == 24 and all(same_bits(result, expected[i]) for i, result in results)


def test_a_forked_process_works_or_says_why_not():
    code = ("import os, signal, numpy as np, pointfair as pf\n"
            "x = np.random.default_rng(1).random((3000, 3)); y = pf.denoise(x, k=8)\n"
            "pid = os.fork()\n"
            "if pid == 0:\n"
            "    signal.alarm(60)\n"
            "    try: os._exit(0 if (pf.denoise(x, k=8) == y).all() else 1)\n"
            "    except pf.Error: os._exit(0)\n"
            "raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))\n")
    assert subprocess.run([sys.executable, "-W", "ignore", "-c", code]).returncode == 0


def test_nothing_is_printed():
    code = ("import numpy as np, os, pointfair as pf\nr = np.random.default_rng(1)\npf.denoise(r.random((3000, 3)))\np = pf.Pipeline(); p.load(r.random((9, 3)))\n"
            "many = os.cpu_count() + 1\npf.denoise(r.random((3000, 3)), threads=many)\npf.denoise_depth(r.random((90, 90)), threads=many + 1)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
