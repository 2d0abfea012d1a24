"""The variables and outcomes of a run, with their units."""

from __future__ import annotations

#: every variable of a run: (dimensions, unit, meaning); sliding joints have m for rad and N for N m
VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "q": (("rollout", "time", "joint"), "rad", "joint position"),
    "qd": (("rollout", "time", "joint"), "rad/s", "joint velocity"),
    "q_measured": (("rollout", "time", "joint"), "rad", "joint position as the controller sees it"),
    "qd_measured": (("rollout", "time", "joint"), "rad/s", "joint velocity as the controller sees it"),
    "tau_demand": (("rollout", "time", "joint"), "N m", "torque the control law asks for"),
    "tau": (("rollout", "time", "joint"), "N m", "torque that acts from this moment on"),
    "tau_limit": (
        ("rollout", "time", "joint"),
        "N m",
        "limit of the torque that acts, in runs where rollouts differ in it or a disturbance lowers it",
    ),
    "s": (("rollout", "time"), "1", "path parameter"),
    "sdot": (("rollout", "time"), "1/s", "rate of the path parameter"),
    "e_p": (("rollout", "time", "joint"), "rad", "position error q_d(s) - q as the controller sees it"),
    "e_v": (
        ("rollout", "time", "joint"),
        "rad/s",
        "velocity error q_d'(s) theta(s) - qd as the controller sees it",
    ),
    "regular": (
        ("rollout", "time"),
        "1",
        "0 where the path parameter was undefined, or the law missed its tick, and the last one kept",
    ),
}
#: the variables that are recorded tick by tick, in this order
RECORDED = {name: variable for name, variable in VARIABLES.items() if name != "tau_limit"}


def bytes_of_sample(joints: int) -> int:
    """Return the memory of one sample of one rollout of an arm with ``joints``."""
    return sum(8 * (joints if "joint" in dims else 1) for dims, _, _ in RECORDED.values())


#: every outcome of a run: (dimensions, unit, meaning); coordinates of its data
OUTCOMES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "status": (("rollout",), "", "finished, diverged, or running when the time was up"),
    "finish_time": (("rollout",), "s", "when the rollout was finished, NaN while it is running"),
    "diverged_time": (("rollout",), "s", "when the rollout diverged, NaN if it did not"),
    "reason": (("rollout",), "", "why the rollout diverged, empty if it did not"),
    "laps": (("rollout",), "1", "whole laps of a closed path"),
    "forgotten": (("rollout",), "1", "how often the law forgot what it had learned, as it no longer fitted"),
    "forgotten_time": (("rollout",), "s", "when the law last forgot what it had learned, NaN if it never did"),
    "path_index": (("time",), "1", "which path of a sequence is followed"),
    "path_status": (("path",), "", "finished, diverged, running when its time was up, or waiting"),
    "path_offset": (("path",), "1", "what s of a sequence is more than that of the path"),
    "path_finish_time": (("path",), "s", "when the path of a sequence was finished, NaN if it was not"),
}
