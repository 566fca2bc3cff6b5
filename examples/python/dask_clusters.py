# SPDX-License-Identifier: Apache-2.0
"""Clouds larger than memory on a Dask cluster: a laptop, Slurm, all cards of a machine.

    python dask_clusters.py laptop a.laz b.laz denoised/ /scratch/work

Every worker must see the files and the work folder, from which a run that was stopped goes on."""
from __future__ import annotations

import importlib
import sys
from typing import Any

import pointfair.cluster

distributed: Any = importlib.import_module("dask.distributed")  # has no types


def laptop() -> Any:
    """Two processes of this machine."""
    return distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)


def slurm() -> Any:
    """Up to 32 jobs with a task at a time; those that Slurm ends are replaced."""
    jobs = importlib.import_module("dask_jobqueue")
    cluster = jobs.SLURMCluster(cores=4, processes=1, memory="16GB", walltime="04:00:00",
                                worker_extra_args=["--nthreads", "1"])
    cluster.adapt(minimum=1, maximum=32)
    return cluster


def cards() -> Any:
    """One worker for each card of this machine."""
    return importlib.import_module("dask_cuda").LocalCUDACluster()


# What one task may use on each, a worker's memory or less.
CLUSTERS: dict[str, tuple[Any, dict[str, Any]]] = {
    "laptop": (laptop, {"memory": "2G"}),
    "slurm": (slurm, {"memory": "12G", "threads": 4}),
    "cards": (cards, {"memory": "32G", "device": "cuda"}),
}


def denoise(where: str, inputs: list[str], output_folder: str, work: str) -> dict[str, Any]:
    """The inputs are one cloud; each file comes back under its name. Returns the report."""
    make, limits = CLUSTERS[where]
    with make() as cluster, distributed.Client(cluster) as client:
        report: dict[str, Any] = pointfair.cluster.denoise(client, inputs, output_folder=output_folder, work=work, **limits)
    return report


if __name__ == "__main__":
    where, *inputs, output_folder, work = sys.argv[1:]
    print(denoise(where, inputs, output_folder, work))
