"""All measurements, and the ratios that are asked of them."""

from __future__ import annotations

from typing import NamedTuple

from benchmarks.cases import Case, paper, seven_joints
from benchmarks.contenders import (
    control_tick,
    ours,
    ours_alone,
    own_task,
    pinocchio_alone,
    plain,
    plain_alone,
    swept,
    wrapped,
)
from benchmarks.contest import contest
from benchmarks.peers import batched, single

ROLLOUTS, TICKS, SHORT, ROUNDS = 1000, 4000, 200, 5
SAMPLE = 20  # of the rollouts, for the plain loop
SWEPT = 250  # rollouts of the sweep, TICKS each
#: (rollouts, ticks) of the cost in rollouts, and of the cost in time
CROWDS = ((100, 400), (1_000, 100), (10_000, 20), (100_000, 10))
LENGTHS = ((100, 250), (100, 1_000), (100, 4_000))


class Row(NamedTuple):
    """One line of the table: what was timed, per rollout and tick [µs], and beside the plain loop on the same arm."""

    arm: str
    what: str
    microseconds: float
    speed: float


class Results(NamedTuple):
    """What was measured.

    Attributes:
        ratios: those that have goals, and others, by name.
        rows: the table.
        growth: time per rollout and tick [µs] by (rollouts, ticks), of ours.
    """

    ratios: dict[str, float]
    rows: list[Row]
    growth: dict[tuple[int, int], float]


def measure() -> Results:
    """Everything, in one run."""
    ratios, rows = _alone(paper(), "2 joints")
    ratios |= _crowd(paper(), "2 joints", rows)
    others, more = _alone(seven_joints(), "7 joints")
    joined = _crowd(seven_joints(), "7 joints", more)
    ratios |= {f"{name}_seven_joints": value for name, value in (others | joined).items()}
    ratios["seven_joints"] = joined["batch1000_1thread"]
    ratios |= _around(paper()) | _tick(paper())
    return Results(ratios, [*rows, *more], _growth(paper()))


def _alone(case: Case, arm: str) -> tuple[dict[str, float], list[Row]]:
    """One rollout: ours beside the plain loop and the peers."""
    contenders = {"plain loop": plain_alone(case, TICKS), "pathcontrol, 1 rollout": ours_alone(case, TICKS)}
    times = contest(contenders | single(case, TICKS), ROUNDS)
    rows = [Row(arm, name, times.median(name), times.ratio("plain loop", name)) for name in times.rounds]
    names = {"single": "plain loop", "mujoco_single": "MuJoCo"}
    there = {key: name for key, name in names.items() if name in times.rounds}
    return {key: times.ratio(name, "pathcontrol, 1 rollout") for key, name in there.items()}, rows


def _crowd(case: Case, arm: str, rows: list[Row]) -> dict[str, float]:
    """Many rollouts, on one thread and on two."""
    contenders = {"plain loop, of these rollouts": plain(case, SAMPLE, SHORT)}
    for threads in (1, 2):
        named = {
            "pathcontrol": ours(case, ROLLOUTS, SHORT, threads),
            "Pinocchio's calls alone": pinocchio_alone(case, ROLLOUTS, SHORT, threads),
            **{f"{name} with our law": peer for name, peer in batched(case, ROLLOUTS, SHORT, threads).items()},
        }
        contenders |= {f"{name}, {ROLLOUTS} rollouts, threads: {threads}": who for name, who in named.items()}
    times, base = contest(contenders, ROUNDS), next(iter(contenders))
    rows += [Row(arm, name, times.median(name), times.ratio(base, name)) for name in times.rounds]
    one, two = (f"{ROLLOUTS} rollouts, threads: {threads}" for threads in (1, 2))
    ratios = {
        "batch1000_1thread": times.ratio(base, f"pathcontrol, {one}"),
        "batch1000_2threads": times.ratio(base, f"pathcontrol, {two}"),
        "over_pinocchio": times.ratio(f"pathcontrol, {one}", f"Pinocchio's calls alone, {one}"),
    }
    if (mjbatch := f"mjbatch with our law, {one}") in times.rounds:
        ratios["mjbatch"] = times.ratio(mjbatch, f"pathcontrol, {one}")
    return ratios


def _around(case: Case) -> dict[str, float]:
    """A path of the user's own beside the circle, a wrapped law beside the law, and a sweep beside its simulations."""
    own = contest({"circle": ours(case, 1, TICKS), "own": own_task(case, 1, TICKS)}, ROUNDS)
    sweep = contest({"simulated": ours(case, SWEPT, TICKS), "swept": swept(case, SWEPT, TICKS)}, ROUNDS)
    paced = contest(
        {
            "law": ours(case, 1, TICKS),
            "wrapped": wrapped(case, TICKS),
            "in Python": wrapped(case, TICKS, engine="pinocchio"),
        },
        ROUNDS,
    )
    return {
        "own_task": own.ratio("own", "circle"),
        "wrapped_law": paced.ratio("wrapped", "law"),
        "wrapped_over_reference": paced.ratio("in Python", "wrapped"),
        "sweep_over_simulation": sweep.ratio("swept", "simulated"),
    }


def _tick(case: Case) -> dict[str, float]:
    """One control tick beside the plain law and one call of RNEA."""
    tick, plainly, rnea = control_tick(case)
    return {
        "control_tick_us": tick,
        "rnea_us": rnea,
        "control_tick_over_rnea": tick / rnea,
        "plain_tick_over_rnea": plainly / rnea,
    }


def _growth(case: Case) -> dict[tuple[int, int], float]:
    """Ours for more and more rollouts, and for longer and longer runs."""
    return {
        size: contest({"ours": ours(case, *size)}, 1 if size[0] > 10_000 else 3).median("ours")
        for size in dict.fromkeys(CROWDS + LENGTHS)
    }
