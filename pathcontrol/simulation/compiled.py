"""The sampled loop in the compiled engine: it does the same as :class:`SampledArm`, faster."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from ctypes import addressof
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._progress import progress_bar
from pathcontrol.control.base import Controller
from pathcontrol.engine.library import lanes, load_library
from pathcontrol.engine.run_settings import add_law, add_plant, rows_or_none
from pathcontrol.engine.speed_rules import SpeedRules
from pathcontrol.engine.structs import (
    RECORDED,
    SAID_NUMBERS,
    SEEN_AND_SAID,
    Memory,
    Record,
    Setup,
    Span,
    State,
    address_of,
)
from pathcontrol.errors import EngineError
from pathcontrol.simulation.arm.changing_arm import ChangingArm
from pathcontrol.simulation.arm.dropout import Dropouts
from pathcontrol.simulation.arm.noise import NoiseSource
from pathcontrol.simulation.arm.plant import has_strong_friction
from pathcontrol.simulation.compiled_disturbances import add_disturbances
from pathcontrol.simulation.divergence import BEYOND, NO_NUMBERS, Divergence
from pathcontrol.simulation.finish import AfterLaps, AtEnd, Finish, detection_ticks
from pathcontrol.simulation.loops import Arm as SimulatedArm
from pathcontrol.simulation.loops import Outside, SampledLoop, check_rows
from pathcontrol.simulation.recorder import Recorder
from pathcontrol.simulation.sampled import Actuator
from pathcontrol.simulation.seam import Left, start_next

_BLOCK = 1 << 17  # ticks of all rollouts together between checks of Ctrl-C and the progress bar
_REASONS = {1: BEYOND, 2: NO_NUMBERS}


class _Block(NamedTuple):
    """Ticks that are run together.

    Attributes:
        done: how many came before.
        ticks: how many these are.
        last: whether they are the last of the run.
        inputs: u of the speed inputs at each, (ticks, inputs, N).
    """

    done: int
    ticks: int
    last: bool
    inputs: Array


class CompiledArm:
    """The arm behind its sensors and actuators, run by the engine; it does the same as :class:`SampledArm`.

    Args:
        loop: the control computer.
        robot: the arm, or one for each rollout.
        q: joint positions it starts at [rad], (N, n).
        qd: joint velocities it starts with [rad/s], (N, n).
        outside: its disturbance, and the number of the first rollout, for its noise.
        controllers: the laws that are to drive it.

    Raises:
        EngineError: a law, an arm, its friction or the disturbance is beyond the engine.
    """

    def __init__(
        self,
        loop: SampledLoop,
        robot: SimulatedArm,
        q: Array,
        qd: Array,
        outside: Outside,
        controllers: Sequence[Controller],
    ) -> None:
        self._library, self._memory, self._setup = load_library(), Memory(), Setup(joints=robot.n)
        self._arm_memory = Memory()
        self._loop, self._shape, self._ticks = loop, q.shape, 0
        self._threads = max(1, min(_threads(robot), -(-len(q) // lanes(self._library))))
        self._noise = None if loop.noise is None else NoiseSource(loop.noise, q.shape, outside.first)
        self._drawn = np.empty((0, 2, *q.shape))
        sensors, actuator = loop.sensors(robot), Actuator(loop, robot, q.shape)
        check_rows(sensors.resolution, "encoders", len(q))
        self._add_loop(sensors.resolution, actuator)
        self._changing = ChangingArm(robot, outside.disturbance, loop.period)
        add_plant(self._setup, robot, has_strong_friction(robot), self._memory)
        add_disturbances(self._setup, outside.disturbance, self._memory)
        self._laws = {controller: self._add_law(controller) for controller in controllers}
        reading = sensors.start(*self._add_noise(q, qd))
        reading = sensors.read(*self._add_noise(q, qd), reading)
        self._state = {"q": q, "qd": qd, "q_read": reading.q, "qd_read": reading.qd}
        self._state = {name: np.array(value, dtype=np.float64, order="C") for name, value in self._state.items()}
        self._state["queue"] = np.zeros((actuator.waiting, *q.shape))
        self._dropouts = Dropouts(outside.disturbance, loop.period, outside.first, len(q))
        if self._dropouts.any:
            self._state |= {name: np.zeros(q.shape) for name in SEEN_AND_SAID}
            self._state |= {name: np.zeros(len(q)) for name in SAID_NUMBERS}
            self._state["q_seen"][...], self._state["qd_seen"][...] = reading
        self.divergence = Divergence(q, qd)
        self._left: Left | None = None
        self.law_outcome: dict[str, Array] = {}  # its laws have nothing to say

    def run(
        self, controller: Controller, duration: float, finish: Finish | None, progress: bool, z: Array | None = None
    ) -> dict[str, Array]:
        """Return the record, (rollout, time, …), from here until ``finish`` ends it, ``duration`` [s] at most.

        ``z`` is the state that the law starts with, where that is known already.
        """
        (setup, rules), period = self._laws[controller], self._loop.period
        _add_finish(setup, finish)
        self._take_over(controller, z)
        ticks, rollouts = max(1, round(duration / period)), self._shape[0]
        recorder = Recorder(rollouts, self._shape[1], ticks + 1)
        block = max(1, min(_BLOCK // rollouts, rules.longest))
        done, over = 0, False
        with progress_bar("simulating", ticks, progress) as update, ThreadPoolExecutor(self._threads) as pool:
            while not over:
                count = self._begin_block(setup, min(block, ticks - done))
                inputs = rules.ask(period * np.arange(done, done + count + (done + count == ticks)), rollouts)
                last = done + count == ticks and len(inputs) > count
                count = min(count, len(inputs))
                over = self._run_block(setup, finish, recorder, _Block(done, count, last, inputs), pool) or last
                done += count
                update(min(done, ticks))
        self._left = Left(controller, self._state_of_law(), period * (recorder.samples - 1))
        return self._close_record(recorder, finish, setup)

    def _add_law(self, controller: Controller) -> tuple[Setup, SpeedRules]:
        """Return the settings with those of a law, and its rules of speed."""
        setup = Setup.from_buffer_copy(self._setup)
        return setup, add_law(setup, controller, self._memory)

    def _take_over(self, controller: Controller, z: Array | None) -> None:
        """Begin with the state of the law, and with no rollout finished or lost."""
        rollouts, state = self._shape[0], self._state
        state["home_q"], state["home_qd"] = state["q"].copy(), state["qd"].copy()
        z = start_next(controller, state["q"], state["qd"], self._left) if z is None else z
        for first in ("", "first_"):
            state[f"{first}s"], state[f"{first}memory"] = z[..., 0].copy(), z[..., 1:].copy()
        state["rest_since"], state["reason"] = np.full(rollouts, np.inf), np.zeros(rollouts)
        for name in ("lap_start", "finish_time", "diverged_time"):
            state[name] = np.full(rollouts, np.nan)
        self.divergence = Divergence(state["home_q"], state["home_qd"])

    def _state_of_law(self) -> Array:
        """Return the state z of the law, (N, m)."""
        return np.column_stack([self._state["s"], self._state["memory"]])

    def _begin_block(self, setup: Setup, most: int) -> int:
        """Set the arm as it is now, and return the number of ticks, ``most`` at most, until it changes."""
        if not self._changing.changes:
            return most
        arm, self._arm_memory = self._changing.at(self._ticks), Memory()
        add_plant(setup, arm, has_strong_friction(arm), self._arm_memory)
        qd = self._changing.strike(self._ticks, self._state["q"], self._state["qd"])
        setup.struck = None if qd is self._state["qd"] else self._arm_memory.address(qd)
        return int(min(most, self._changing.next_change(self._ticks) - self._ticks))

    def _run_block(
        self, setup: Setup, finish: Finish | None, recorder: Recorder, block: _Block, pool: ThreadPoolExecutor
    ) -> bool:
        """Run some ticks and return whether the run is over; this thread takes part."""
        done, count, last, inputs = block
        rollouts = self._shape[0]
        width = lanes(self._library)
        noise = self._draw_noise(count)
        arrays = recorder.reserve(count + last)
        record = Record(**{name: arrays[name].ctypes.data for name in RECORDED}, stride=arrays["q"].strides[0])
        state = State(**{name: address_of(array) for name, array in self._state.items()})
        span = Span(done, self._ticks, count, rollouts, last, rollouts <= width)
        span.inputs = address_of(inputs)
        losses = self._lose(count + last)
        if losses is not None:
            span.missed, span.stale = map(address_of, losses)
        pointers = [addressof(setup), addressof(state), addressof(record)]
        tail = [None if noise is None else address_of(noise), addressof(span)]

        def work(begin: int, end: int) -> int:
            return int(self._library.pathcontrol_run(*pointers, *tail, begin, end))

        packs = -(-rollouts // width)
        cuts = [min(rollouts, width * round(packs * i / self._threads)) for i in range(self._threads + 1)]
        others = pool.map(work, cuts[1:-1], cuts[2:])
        samples = max([work(cuts[0], cuts[1]), *others])
        recorder.add(samples)
        over = self._is_over(finish, setup)
        # the sample at which all packs end together has no period after it
        advanced = samples - 1 if last or (over and span.stops) else count
        self._ticks += advanced
        self._drawn = self._drawn[advanced:]
        return over or samples < count

    def _draw_noise(self, count: int) -> Array | None:
        """Return the noise of the next ``count`` readings, (count, 2, N, n); what a block does not use is kept."""
        if self._noise is None:
            return None
        if len(self._drawn) < count:
            self._drawn = np.concatenate([self._drawn, self._noise.samples(count - len(self._drawn))])
        return self._drawn[:count]

    def _lose(self, count: int) -> NDArray[np.uint8] | None:
        """Return what is lost at the next ``count`` ticks, missed ticks and measurements, (2, count, N)."""
        if not self._dropouts.any:
            return None
        ticks, lost = self._ticks + np.arange(count), self._dropouts
        missed = lost.missed(ticks).astype(np.uint8) + lost.silent(ticks)
        return np.stack([missed, lost.stale(ticks)]).astype(np.uint8, order="C")

    def _is_over(self, finish: Finish | None, setup: Setup) -> bool:
        """Return whether all rollouts are finished or lost."""
        lost = np.isfinite(self._state["diverged_time"])
        if lost.all():
            return True
        return bool(setup.ends_run and finish is not None and (lost | np.isfinite(self._state["finish_time"])).all())

    def _close_record(self, recorder: Recorder, finish: Finish | None, setup: Setup) -> dict[str, Array]:
        """Cut the record where the run ended, mark diverged rollouts, and return the arrays."""
        period, state = self._loop.period, self._state
        lost_time, finish_time = state["diverged_time"], state["finish_time"]
        if self._is_over(finish, setup):
            known = np.where(np.isfinite(finish_time), detection_ticks(finish, finish_time, period), 0)
            lost = np.where(np.isfinite(lost_time) & ~np.isfinite(finish_time), np.round(lost_time / period), 0)
            recorder.cut(int(max(known.max(), lost.max())) + 1)
            end = period * (recorder.samples - 1)
            lost_time = np.where(lost_time > end * (1 + 1e-12), np.nan, lost_time)
        for code, reason in _REASONS.items():
            for row in np.flatnonzero(np.isfinite(lost_time) & (state["reason"] == code)):
                self.divergence.mark(lost_time[row], np.arange(self._shape[0]) == row, reason)
        if finish is not None:
            finish.time = finish_time
        arrays = recorder.arrays()
        self.divergence.erase(arrays, period * np.arange(arrays["s"].shape[1]))
        return arrays

    def _add_noise(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Return positions and velocities (N, n) with noise, as the sensors get them."""
        return (q, qd) if self._noise is None else self._noise.add_noise(q, qd)

    def _add_loop(self, resolution: Array | None, actuator: Actuator) -> None:
        """Set the sensors, torque limits and delay of the loop."""
        loop, setup, n = self._loop, self._setup, self._shape[1]
        setup.period, setup.substeps, setup.delayed = loop.period, loop.substeps, actuator.waiting
        setup.parts = len(actuator.parts)
        for k, part in enumerate(actuator.parts):
            setup.part[k] = part
        setup.encoders, setup.limited = resolution is not None, actuator.limits is not None
        setup.differentiates, setup.filters = loop.velocity == "difference", loop.filter_hz is not None
        if loop.filter_hz is not None:
            setup.keep = np.exp(-2 * np.pi * loop.filter_hz * loop.period)
        setup.resolution = rows_or_none(resolution, n, self._memory)
        setup.torque_limit = rows_or_none(actuator.limits, n, self._memory)


def _threads(robot: SimulatedArm) -> int:
    """Return the number of threads that a robot, or the first of several, allows."""
    return getattr(robot, "threads", None) or robot.robots[0].threads  # type: ignore[union-attr]


def _add_finish(setup: Setup, finish: Finish | None) -> None:
    """Set the rule by which rollouts finish.

    Raises:
        EngineError: a rule that the engine does not know.
    """
    if finish is None:
        return
    setup.ends_run = finish.ends_run
    if type(finish) is AtEnd:
        setup.finish = 1
    elif type(finish) is AfterLaps:
        setup.finish, setup.laps = 2, finish.laps
    else:
        name = type(finish).__name__
        raise EngineError(f"the engine does not know when {name} ends a run", value=name)
