"""What a million rollouts cost, in one process and on worker processes, and how far the law of docs/cluster.md holds.

The paper's first experiment, 10 s at 400 samples a second, from many postures and with many gains. Run it with:
python -m benchmarks.cluster (two to four minutes on two cores).
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from distributed import Client, LocalCluster
from scipy import stats

from benchmarks.cases import paper
from pathcontrol import ExtendedMotionPlan, Space, sweep

CHUNK, CHUNKS, DURATION, TINY = 250, 4, 10.0, 200
PEAKS = ["e_p_peak", "tau_demand_peak"]  # numbers that need no distance to the path
MANY = (16, 64, 256)  # workers nobody has started
CASE = paper()
SPACE = Space.sobol(
    {
        "K_p": stats.loguniform(200.0, 5000.0),
        "k": stats.uniform(5.0, 45.0),
        "q": stats.norm(CASE.start, np.deg2rad([10.0, 10.0])),
    },
    CHUNK * CHUNKS,
)


class Row(NamedTuple):
    """One sweep, or the start of workers.

    Attributes:
        what: how it was run.
        workers: how many processes computed.
        seconds: how long it took [s].
        processor: processor time of those processes [s], which other programs of a busy machine change little.
    """

    what: str
    workers: int
    seconds: float
    processor: float = math.nan


def build(threads: int, duration: float = DURATION) -> Callable:
    """Of the arguments of a chunk, for a robot with so many threads."""
    robot = CASE.robot.with_threads(threads)

    def chunk(p, samples):
        law = ExtendedMotionPlan(robot, CASE.task, p["K_p"][:, None], CASE.gains[1], p["k"], start="nearest")
        return {"controller": law, "q": p["q"], "duration": duration, "loop": CASE.loop}

    return chunk


def timed(
    what: str, workers: int, client: Client | None = None, threads: int = 1, metrics: Sequence[str] | None = None
) -> Row:
    """A whole sweep."""

    def processor() -> float:
        return time.process_time() if client is None else sum(client.run(time.process_time).values())

    with tempfile.TemporaryDirectory() as folder:
        spent, began = processor(), time.perf_counter()
        options = {"metrics": metrics, "chunk": CHUNK, "progress": False, "cluster": client}
        result = sweep(build(threads), SPACE, Path(folder) / "out", **options)
        seconds = time.perf_counter() - began
        assert result.finished == SPACE.samples
        return Row(what, workers, seconds, processor() - spent)


def bare(what: str, workers: int, client: Client) -> Row:
    """A chunk of one rollout of one period, of many: what handing out, taking in and writing take."""
    space = Space.given({name: values[:TINY] for name, values in SPACE.design().items()})
    one = build(1, CASE.loop.period)
    options = {"metrics": PEAKS, "chunk": 1, "progress": False, "cluster": client}
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        sweep(one, space, Path(folder) / "out", **options)
        return Row(what, workers, (time.perf_counter() - began) / TINY)


def on_workers(count: int) -> Iterator[Row]:
    """Sweeps on so many processes with a thread each; what it takes until they have loaded everything is apart."""
    began = time.perf_counter()
    quiet = {"dashboard_address": "127.0.0.1:0", "silence_logs": 50}
    with LocalCluster(n_workers=count, threads_per_worker=1, **quiet) as cluster, Client(cluster) as client:
        client.run(load)
        yield Row(f"start of workers: {count}", count, time.perf_counter() - began)
        yield timed(f"workers: {count}", count, client)
        yield timed(f"workers: {count}, two metrics", count, client, metrics=PEAKS)
        yield bare(f"an empty chunk, workers: {count}", count, client)


def load() -> None:
    import benchmarks.cases  # noqa: F401


def show(rows: Iterable[Row]) -> list[Row]:
    """For each sweep, as soon as it is over, its time, and by that and by processor time the hours of a million."""
    million, shown = 1e6 / SPACE.samples / 3600, []
    print(f"{CHUNKS} chunks of {CHUNK} rollouts of {DURATION:g} s, two joints, 400 samples a second\n")
    print(f"{'':30}{'s':>8}{'h a million':>14}{'processor h a million':>24}")
    for row in rows:
        hours = "" if math.isnan(row.processor) else f"{row.seconds * million:14.2f}{row.processor * million:24.2f}"
        print(f"{row.what:30}{row.seconds:8.2f}{hours}", flush=True)
        shown.append(row)
    return shown


def show_law(rows: list[Row]) -> None:
    """The law, with the time of a chunk on one worker."""
    by_name = {row.what: row.seconds for row in rows}
    chunk, two, empty = by_name["workers: 1"] / CHUNKS, by_name["workers: 2"], by_name["an empty chunk, workers: 2"]
    law = math.ceil(CHUNKS / 2) * chunk
    print(f"\nlaw: ceil(chunks / workers) x {chunk:.2f} s; 2 workers: {law:.1f} s, measured {two:.1f} s")
    print(f"an empty chunk takes {1e3 * empty:.0f} ms: more than {chunk / empty:.0f} workers wait for one another")
    for workers in MANY:
        hours = math.ceil(math.ceil(1e6 / CHUNK) / workers) * chunk / 3600
        print(f"not run, by the law: a million rollouts on {workers} such workers {hours:.2f} h")


def measured() -> Iterator[Row]:
    yield timed("this process", 1)
    yield timed("this process, 2 threads", 1, threads=2)
    for count in (1, 2):
        yield from on_workers(count)


def main() -> None:
    show_law(show(measured()))


if __name__ == "__main__":
    main()
