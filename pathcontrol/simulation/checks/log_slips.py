"""Warnings of likely slips in the log of an arm: units, signs and gaps."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array, average_neighbours
from pathcontrol.errors import warn
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.checks.position_range import describe_range

_SLOWEST = 0.5  # s between samples from which times are probably no seconds
_GAP = 5.0  # median steps from which a gap is reported
_LIKE, _SAME = 1.15, 2.0  # factors within which a ratio is like a known one, or taken for 1
_AWAY = 0.5  # rad, from which an arm that is never nearer is not on its path
_BEYOND = 1.2  # torque limits
_REST = 1e-3  # rad/s, below which a speed tells nothing
#: ratios of the rate of the positions to the velocities, and what they come from
_RATIOS = {
    1e-3: "the times are in milliseconds",
    1e-6: "the times are in microseconds",
    1e-9: "the times are in nanoseconds",
    180 / np.pi: "q is in degrees and qd in rad/s",
    np.pi / 180: "q is in rad and qd in deg/s",
    np.pi / 30: "qd is in revolutions per minute",
}


def warn_of_log_slips(
    time: Array, q: Array, qd: Array | None, tau: Array, robot: RobotModel | None, e_p: Array
) -> None:
    """Warn of what is likely wrong with a log: times (k,), q, q̇, τ and e_p (k, n); NaN where they are unknown."""
    sentences = [
        _check_times(time),
        "" if qd is None else _check_rate(time, q, qd),
        describe_range(robot, q),
        "" if robot is None else _check_torques(tau, robot),
        _check_distance(e_p),
    ]
    for sentence in filter(None, sentences):
        warn(sentence)


def _check_times(time: Array) -> str:
    """Return the sentence about times that are no seconds, or have gaps."""
    steps = np.diff(time)
    usual = float(np.median(steps))
    if usual >= _SLOWEST:
        return f"the times of the log are {usual:.4g} s apart; did you mean milliseconds, or nanoseconds? Give seconds"
    if steps.max() > _GAP * usual:
        at = float(time[int(steps.argmax())])
        return (
            f"the log has a gap of {steps.max():.4g} s at {at:.4g} s, its samples are {usual:.4g} s apart; means and "
            "RMS values weigh samples, not time"
        )
    return ""


def _check_rate(time: Array, q: Array, qd: Array) -> str:
    """Return the sentence about velocities that are not the rate of the positions."""
    rate, mean = np.diff(q, axis=0) / np.diff(time)[:, None], average_neighbours(qd)
    if np.sqrt(np.mean(mean**2)) < _REST:
        return ""
    ratio = float(np.vdot(rate, mean) / np.vdot(mean, mean))
    if 1 / _SAME < ratio < _SAME:
        return ""
    if 1 / _SAME < -ratio < _SAME:
        return "the velocities of the log have the other sign than the rate of its positions"
    known = [said for value, said in _RATIOS.items() if 1 / _LIKE < ratio / value < _LIKE]
    guess = f"; it seems that {known[0]}: give seconds, rad and rad/s" if known else ""
    return f"the rate of the positions is {ratio:.3g} times the velocities of the log{guess}"


def _check_torques(tau: Array, robot: RobotModel) -> str:
    """Return the sentence about torques far beyond the limits of the arm."""
    limit = np.where(robot.limits.effort > 0, robot.limits.effort, np.inf)  # some robots state 0
    share = np.nan_to_num(np.abs(tau)) / limit
    row, joint = np.unravel_index(int(share.argmax()), share.shape)
    if share[row, joint] <= _BEYOND:
        return ""
    return (
        f"{robot.joint_names[int(joint)]} has {tau[row, joint]:.4g} N m in the log, its limit is {limit[joint]:.4g}; "
        "are these torques at the joints in N m, not currents or N mm?"
    )


def _check_distance(e_p: Array) -> str:
    """Return the sentence about an arm that was never near its path."""
    away = np.linalg.norm(e_p, axis=-1)
    if np.isnan(away).all() or (nearest := float(np.nanmin(away))) <= _AWAY:
        return ""
    return f"the arm of the log is never nearer than {nearest:.3g} rad to the path; are the joints in another order?"
