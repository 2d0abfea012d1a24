"""The log of a control loop: a thread empties the ring buffer into a file, or keeps the samples in memory."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._files import writing
from pathcontrol._suffixes import check_suffix
from pathcontrol.control.base import Controller
from pathcontrol.errors import InputError, StorageError, warn
from pathcontrol.hardware.loop_context import DIMS, LoopContext, find_rates, only_later
from pathcontrol.hardware.sample_ring import Moments, SampleRing
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.samples import complete_outcome, label_outcome
from pathcontrol.simulation.storage.mcap_messages import Variable
from pathcontrol.simulation.storage.mcap_records import load_mcap
from pathcontrol.simulation.storage.mcap_run import McapRunWriter

_DRAIN = 0.05  # s between two looks at the ring
_FLUSH = 0.25  # s after which what was written is handed to the operating system
_PIECE = 4  # samples put into words at a time: the loop waits no longer for Python's lock
_PAUSE = 2e-5  # s in which the loop can take the lock
_SECONDS = 5.0  # of samples for which there is room


class LoopLog:
    """The log of a control loop, written while it runs; :meth:`ControlLoop.record` makes it.

    The loop puts a sample of each step into a ring buffer, which takes a few microseconds and never blocks; a thread
    empties the buffer every 50 ms into an MCAP file, or into memory. The operating system has all samples after 0.3 s:
    no more is lost if the process is killed, and :meth:`Run.load` reads a file without its end.

    The variables are those of a run, and ``mode``. Of a step with a bad measurement the last good one is kept. ``sdot``
    is the change of s from one step to the next over that of time, e_p = q_d(s) − q and e_v = wq_d'(s)ϑ(s) − q̇ with the
    factor w of the speed.

    Args:
        law: the law of the loop.
        period: its period [s].
        path: the file to write, ``NAME.mcap``; None keeps the samples in memory.
        outcome: gives what the law has to say when the log is closed, see :meth:`Controller.outcome`.

    Attributes:
        ring: the buffer that the loop fills.

    Raises:
        InputError: the name does not end with ``.mcap``.
        MissingExtraError: a file is to be written, and the extra ``mcap`` is not installed.
        StorageError: the file cannot be written.
    """

    def __init__(
        self,
        law: Controller,
        period: float,
        path: str | Path | None = None,
        outcome: Callable[[], Mapping[str, Array]] = dict,
    ) -> None:
        self._context, self._outcome = LoopContext(law, period), outcome
        self._path = None if path is None else check_suffix(path, "a log", ".mcap")
        self.ring = SampleRing(law.robot.n, max(16, round(_SECONDS / period)))
        self._begin = 0.0  # s, time of the first sample
        self._last: Moments | None = None  # the sample that waits for the one after it
        self._sdot = np.zeros(1)
        self._error: Exception | None = None
        self._kept: list[dict[str, Array]] = []
        if self._path is not None:
            load_mcap()
            with writing(self._path):
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._stream = self._path.open("wb")
        self._writer: McapRunWriter | None = None
        self._flushed, self._stop = time.monotonic(), threading.Event()
        self._thread = threading.Thread(target=self._drain_often, name="pathcontrol log", daemon=True)
        self._thread.start()

    @property
    def lost(self) -> int:
        """The number of samples that are not in the log, as there was no room for them."""
        return self.ring.lost

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Write what is left and the end of the file; the loop goes on without a log.

        Raises:
            StorageError: the file could not be written, as on a full disk.
        """
        if self._stop.is_set():
            return
        self.ring.closed = True
        self._stop.set()
        self._thread.join()
        self._drain()
        if self._last is not None:
            self._keep(self._last, self._sdot)
        self._ask_outcome()
        if self._path is not None:
            self._end_file()
        if self._error is not None:
            raise StorageError(f"the log {str(self._path)!r} is not whole: {self._error}") from self._error
        if self.lost:
            warn(f"{self.lost} samples are not in the log: the thread that keeps it had no time for them")

    def run(self) -> Run:
        """Close the log, and return it as a run.

        Raises:
            InputError: the loop has taken no step.
        """
        self.close()
        if self._path is not None:
            return Run.load(self._path)
        if not self._kept:
            raise InputError("the log is empty: the loop has taken no step")
        return self._context.make_run(self._kept, self._begin, self.lost)

    # --- the thread -----------------------------------------------------------------------------------------

    def _drain_often(self) -> None:
        """Empty the ring until the log is closed."""
        while not self._stop.wait(_DRAIN):
            self._drain()

    def _drain(self) -> None:
        """Empty the ring; an error of the file is kept for :meth:`close`."""
        found = self.ring.take()
        if not len(found["time"]) or self._error is not None:
            return
        try:
            self._add(found)
        except Exception as error:  # a full disk must not end the thread, and never the loop
            self._error = error

    def _add(self, found: Moments) -> None:
        """Add samples to the log; the last one waits for that after it, which gives its ṡ."""
        if self._last is not None:
            found = Moments({name: np.concatenate([self._last[name], found[name]]) for name in found})
        found = only_later(found)
        rate = find_rates(found)
        if len(rate):
            self._keep(Moments({name: array[:-1] for name, array in found.items()}), rate)
            self._sdot = rate[-1:]
        self._last = Moments({name: array[-1:] for name, array in found.items()})

    def _keep(self, found: Moments, sdot: Array) -> None:
        """Keep whole samples."""
        if self._writer is None and not self._kept:
            self._begin = float(found["time"][0])
        arrays = self._context.complete(found, sdot, self._begin)
        if self._path is None:
            self._kept.append(arrays)
            return
        if self._writer is None:
            self._writer = self._begin_file(arrays)
        moment = arrays.pop("time")
        for at in range(0, len(moment), _PIECE):
            span = slice(at, at + _PIECE)
            self._writer.write(moment[span], {name: array[None, span] for name, array in arrays.items()})
            time.sleep(_PAUSE)
        if time.monotonic() - self._flushed > _FLUSH:
            self._writer.flush()
            self._flushed = time.monotonic()

    def _ask_outcome(self) -> None:
        """Ask for what the law has to say; what a law of one's own raises must not cost the log."""
        try:
            self._context.outcome = dict(self._outcome())
        except Exception as error:
            warn(f"the log has no outcomes: the law raised {type(error).__name__}: {error}")

    # --- the file -------------------------------------------------------------------------------------------

    def _begin_file(self, arrays: dict[str, Array]) -> McapRunWriter:
        """Return the writer of the file, with all in it that is known before the first sample."""
        labels, _ = self._context.label(arrays, {})
        variables = [Variable(name, dims == DIMS, x.dtype.str, about) for name, (dims, x, about) in labels.items()]
        axes = {
            "rollout": [0],
            "joint": list(self._context.joints),
            "axes": {"rollout": {}, "time": {"units": "s"}, "joint": {}},
        }
        stored = self._context.origin.stored(float(arrays["s"][0]) + 1.0)  # what is known so far of an endless path
        return McapRunWriter(self._stream, variables, axes, self._describe(), stored, begin=time.time_ns())

    def _end_file(self) -> None:
        """Write the end of the file."""
        try:
            with self._stream:
                if self._writer is not None and self._error is None:
                    outcome = label_outcome(complete_outcome(1, self._context.outcome))
                    upto = float(self._last["s"][0]) if self._last is not None else 0.0
                    self._writer.attach_context(self._describe(), self._context.origin.stored(upto))
                    self._writer.finish(outcome, list(outcome))
        except OSError as error:
            self._error = error

    def _describe(self) -> dict[str, Any]:
        """Return the configuration, as far as it is known."""
        return self._context.describe(self._begin, self.lost)
