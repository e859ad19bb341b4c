"""Runs per second of a sweep on a local Dask cluster, by number of worker processes."""

import argparse
from functools import partial
from pathlib import Path

from distributed import Client, LocalCluster

from dtcasadi.bench import sweep as bench
from dtcasadi.cli.common import Report

RESULTS = Path(__file__).parent / "results" / "sweep_dask.json"


def main() -> None:
    """Measure each size of the cluster and write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2], metavar="N")
    parser.add_argument("--runs", type=int, default=bench.RUNS, metavar="N")
    parser.add_argument("--json", type=Path, default=RESULTS, metavar="F")
    options = parser.parse_args()
    report = Report("sweep_dask", str(options.json))
    report.check()
    job, settings = bench.job_of()
    inputs = bench.inputs_of(options.runs)
    report.section("sweep", f"{options.runs} runs of {bench.SCENE} over {bench.T_END_S:g} s")
    report.note(method=bench.METHOD, step_s=bench.STEP_S)
    for n in options.workers:
        with (
            LocalCluster(n_workers=n, threads_per_worker=1, dashboard_address=None) as cluster,
            Client(cluster) as client,
        ):
            executor = client.get_executor()
            bench.warm(executor, n, bench.lanes, job)
            seconds, _ = bench.timed(partial(bench.swept_on, executor, n, inputs, settings))
            bench.row(report, "sweep on Dask", n, seconds, options.runs)
    report.write_json()


if __name__ == "__main__":
    main()
