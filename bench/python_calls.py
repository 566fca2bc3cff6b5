#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Times what Python adds: the import, calls, batches, frames, Ctrl-C. Run it with a Python that has the package:

    build/python/tests/whole/bin/python bench/python_calls.py [time_import time_calls ..]"""
import os
import signal
import statistics
import subprocess
import sys
import threading
import time

import numpy as np

import pointfair as pf

IMPORT = ("import time; a = time.perf_counter(); import numpy; b = time.perf_counter(); import pointfair; c = time.perf_counter(); "
          "print((b - a) * 1e3, (c - b) * 1e3)")
FAST = {"k": 8, "iterations": 1, "noise": 0.01, "similarity_sigma": 0.03, "normal_filter": "off", "outliers": "off"}


# Nothing is left to estimates.
GIVEN = {"k": 8, "iterations": 1, "normal_sigma": 0.1, "closeness_sigma": 0.1, "similarity_sigma": 0.03}


def has_card():
    return any(device.usable and device.info.kind == "cuda" for device in pf.devices())


def waves(count, dtype=np.float32, seed=1):
    rng = np.random.default_rng(seed)
    xy = rng.random((count, 2))
    return np.c_[xy, 0.1 * np.sin(6 * xy[:, 0]) + rng.normal(0, 0.01, count)].astype(dtype)


def seconds(call, repeats=5):
    """The median."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def time_import():
    rows = [tuple(map(float, subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, text=True).stdout.split()))
            for _ in range(7)]
    numpy, own = (statistics.median(column) for column in zip(*rows))
    print(f"import           {own:.0f} ms beyond NumPy's {numpy:.0f} ms")


def processor_seconds(call):
    start = time.process_time()
    call()
    return time.process_time() - start


def time_calls():
    """Calls against load and run of the native pipeline on the same array, in turns."""
    empty = np.empty((0, 3), np.float32)
    print(f"0 points         {seconds(lambda: [pf.denoise(empty) for _ in range(1000)]) * 1e3:.1f} us a call")
    for dtype in (np.float32, np.float64):
        points = waves(100_000, dtype)
        out, pipeline = np.empty_like(points), pf.Pipeline("cpu", threads=1)._native
        for name, parameters in (("default parameters", {}), ("all given", GIVEN)):
            params = pf.Params(**parameters)

            def native():
                pipeline.load(points, False)
                pipeline.run(params._native, out, 1.0, None, None, "", None)

            rounds = [(processor_seconds(lambda: pf.denoise(points, params, threads=1, out=out)), processor_seconds(native))
                      for _ in range(9)]
            call, inside = (min(column) for column in zip(*rounds))
            print(f"100,000 {np.dtype(dtype)}  {name}: {call * 1e3:.1f} ms of processor time a call, {inside * 1e3:.1f} in the native "
                  f"pipeline, {100 * (call / inside - 1):.1f} % more")


def time_batches():
    for device, count in (("cpu", 200), ("cuda", 1000)):
        if device == "cuda" and not has_card():
            continue
        clouds = np.stack([waves(1024, seed=i) for i in range(count)])
        for name, parameters in (("default parameters", {}), ("k = 8", FAST), ("all given", GIVEN)):
            few = clouds[:200]
            loop = seconds(lambda: [pf.denoise(cloud, device=device, **parameters) for cloud in few], 3) * count / len(few)
            batch = seconds(lambda: pf.denoise_batch(clouds, device=device, **parameters), 3)
            print(f"{count} x 1,024 on {device}  {name}: {loop:.3f} s in a loop, {batch:.4f} s in a batch, {loop / batch:.1f} times")


def time_tensors():
    """A tensor on the card against what the pipeline's stages take there."""
    try:
        import torch
    except ImportError:
        return
    if not has_card():
        return
    for count in (1024, 100_000, 1_000_000):
        for dtype in (np.float32, np.float64):
            points = torch.from_numpy(waves(count, dtype)).cuda()
            out, pipeline = torch.empty_like(points), pf.Pipeline("cuda:0")

            def call():
                pf.denoise(points, out=out, **GIVEN)
                torch.cuda.synchronize()

            call()
            took = seconds(call, 30)
            pipeline.load(points)
            pipeline.run(out=out, **GIVEN)
            stages = sum(stage.milliseconds for stage in pipeline.report.stages if stage.name != "upload")
            print(f"{count:,} {np.dtype(dtype)} on the card: {took * 1e3:.3f} ms a call, {stages:.3f} ms in its stages")


def time_frames(frames=30):
    """A stream of a sensor whose noise is half a spacing. Processor time is told too, since on a loaded machine the clock tells
    little, and what is left of the noise."""
    rng, count = np.random.default_rng(1), 100_000
    xy = rng.random((count, 2))
    surface = 0.1 * np.sin(6 * xy[:, 0])
    noise = rng.normal(0, 0.5 / np.sqrt(count), count)
    frame = np.c_[xy, surface + noise].astype(np.float32)
    pipeline = pf.Pipeline("cpu")
    pipeline.load(frame)
    for given in ({}, {"iterations": 1}, {"k": 16, "iterations": 1}, {"k": 8, "iterations": 1}):
        params, times, busy = pipeline.resolve(**given), [], []
        for _ in range(frames):
            start, began = time.perf_counter(), time.process_time()
            pipeline.load(frame)
            smooth = pipeline.run(params)
            times.append(time.perf_counter() - start)
            busy.append(time.process_time() - began)
        left = (smooth[:, 2] - 0.1 * np.sin(6 * smooth[:, 0])).std() / noise.std()
        name = ", ".join(f"{key}={value}" for key, value in given.items()) or "default parameters"
        print(f"100,000 a frame  {name}, resolved: {statistics.median(times) * 1e3:.1f} ms a frame, {min(times) * 1e3:.1f} at least, "
              f"{statistics.median(busy) * 1e3:.1f} ms of processor time, leaves {left:.2f} of the noise")


def resident_mib():
    """Memory of this process now."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def measure_memory(frames=10_000, points=5000):
    """Frames of changing size, each with its own result."""
    pipeline, given = pf.Pipeline("cpu"), pf.Params(**GIVEN)
    clouds = [waves(points - 100 * i, seed=i) for i in range(10)]
    resident = []
    for i in range(frames):
        pipeline.load(clouds[i % 10])
        pipeline.run(given)
        if i + 1 in (frames // 10, frames):
            resident.append(resident_mib())
    print(f"memory           {resident[0]:.1f} MiB after {frames // 10:,} frames of about {points:,} points, {resident[1]:.1f} after {frames:,}")


def time_threads(calls=20):
    """Two threads with a pipeline of one thread each, against the same runs one after the other."""
    points = waves(50_000)

    def work():
        pipeline = pf.Pipeline("cpu", threads=1)
        for _ in range(calls):
            pipeline.load(points)
            pipeline.run(**GIVEN)

    def both():
        threads = [threading.Thread(target=work) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    alone, together = seconds(lambda: [work(), work()], 3), seconds(both, 3)
    print(f"two threads      {together:.2f} s at once, {alone:.2f} s one after the other")


def time_interrupts():
    points, delays = waves(1_000_000), []
    for i in range(8):
        sent = []

        def interrupt():
            sent.append(time.monotonic())
            os.kill(os.getpid(), signal.SIGINT)

        timer = threading.Timer(0.3 + 0.25 * i, interrupt)
        timer.start()
        try:
            pf.denoise(points, k=64, iterations=20)
        except KeyboardInterrupt:
            delays.append((time.monotonic() - sent[0]) * 1e3)
        timer.join()
    print(f"Ctrl-C           {', '.join(f'{delay:.0f}' for delay in delays)} ms until KeyboardInterrupt")


if __name__ == "__main__":
    print(pf.devices()[0].info.name)
    measures = (time_import, time_calls, time_batches, time_tensors, time_frames, measure_memory, time_threads, time_interrupts)
    wanted = sys.argv[1:]
    for measure in measures:
        if not wanted or measure.__name__ in wanted:
            measure()
