"""All measurements, and the ratios that are asked of them."""

from __future__ import annotations

from typing import NamedTuple

from benchmarks.cases import Case, paper, seven_joints
from benchmarks.contenders import control_tick, ours, ours_alone, pinocchio_alone, plain, plain_alone
from benchmarks.contest import contest
from benchmarks.peers import batched, single

ROLLOUTS, TICKS, SHORT, ROUNDS = 1000, 4000, 200, 5
SAMPLE = 20  # of the rollouts, for the plain loop
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
    ratios["seven_joints"] = joined["batch1000_1thread"]
    ratios |= {
        f"seven_joints_{name}": value for name, value in (others | joined).items() if name != "batch1000_1thread"
    }
    tick, plainly, rnea = control_tick(paper())
    ratios |= {"control_tick_us": tick, "rnea_us": rnea, "control_tick_over_rnea": tick / rnea}
    ratios["plain_tick_over_rnea"] = plainly / rnea
    return Results(ratios, [*rows, *more], _growth(paper()))


def _alone(case: Case, arm: str) -> tuple[dict[str, float], list[Row]]:
    """One rollout: ours beside the plain loop and the peers."""
    contenders = {"plain loop": plain_alone(case, TICKS), "pathcontrol, 1 rollout": ours_alone(case, TICKS)}
    times = contest(contenders | single(case, TICKS), ROUNDS)
    rows = [Row(arm, name, times.median(name), times.ratio("plain loop", name)) for name in times.rounds]
    return {"single": times.ratio("plain loop", "pathcontrol, 1 rollout")}, rows


def _crowd(case: Case, arm: str, rows: list[Row]) -> dict[str, float]:
    """Many rollouts in lockstep, on one thread and on two."""
    contenders = {"plain loop, of these rollouts": plain(case, SAMPLE, SHORT)}
    for threads in (1, 2):
        some = (ours(case, ROLLOUTS, SHORT, threads), pinocchio_alone(case, ROLLOUTS, SHORT, threads))
        names = (
            f"{name}, {ROLLOUTS} rollouts, threads: {threads}" for name in ("pathcontrol", "Pinocchio's calls alone")
        )
        contenders |= dict(zip(names, some, strict=True))
        for name, peer in batched(case, ROLLOUTS, SHORT, threads).items():
            contenders[f"{name} with our law, {ROLLOUTS} rollouts, threads: {threads}"] = peer
    times, base = contest(contenders, ROUNDS), next(iter(contenders))
    rows += [Row(arm, name, times.median(name), times.ratio(base, name)) for name in times.rounds]
    one, two = (f"{ROLLOUTS} rollouts, threads: {threads}" for threads in (1, 2))
    return {
        "batch1000_1thread": times.ratio(base, f"pathcontrol, {one}"),
        "batch1000_2threads": times.ratio(base, f"pathcontrol, {two}"),
        "over_pinocchio": times.ratio(f"pathcontrol, {one}", f"Pinocchio's calls alone, {one}"),
    }


def _growth(case: Case) -> dict[tuple[int, int], float]:
    """Ours for more and more rollouts, and for longer and longer runs."""
    return {
        size: contest({"ours": ours(case, *size)}, 1 if size[0] > 10_000 else 3).median("ours")
        for size in dict.fromkeys(CROWDS + LENGTHS)
    }
