"""Poses over time: the frames of a film, taken from the samples of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pathcontrol._arrays import Array

STILL = 1e-9  # m, and the same of the quaternion: what does not move by more is at rest


@dataclass(frozen=True, eq=False)
class Track:
    """Where something is over time, in the base frame.

    Attributes:
        times: times of the frames from the start of the film [s], (frames,).
        positions: [m], (frames, 3).
        quaternions: unit quaternions (x, y, z, w) without a change of sign from frame to frame, (frames, 4).
    """

    times: Array
    positions: Array
    quaternions: Array

    @classmethod
    def from_poses(cls, times: Array, poses: Array) -> Track:
        """A track from homogeneous poses, (frames, 4, 4)."""
        return cls(times, poses[:, :3, 3], continuous_quaternions(poses[:, :3, :3]))

    @property
    def moves(self) -> bool:
        """Whether it is anywhere else than where it starts."""
        return bool(
            np.abs(self.positions - self.positions[0]).max() > STILL
            or np.abs(self.quaternions - self.quaternions[0]).max() > STILL
        )


def frame_times(time: Array, fps: float) -> Array:
    """Times of the frames [s], (frames,): ``fps`` a second from the first sample on, and the last sample."""
    whole = np.ceil((time[-1] - time[0]) * fps - 1e-6)
    return np.append(time[0] + np.arange(whole) / fps, time[-1])


def at_times(time: Array, samples: Array, times: Array) -> Array:
    """Samples (time,) or (time, n) at other times, by linear interpolation."""
    if samples.ndim == 1:
        return np.interp(times, time, samples)
    return np.stack([np.interp(times, time, column) for column in samples.T], axis=-1)


def continuous_quaternions(rotations: Array) -> Array:
    """Unit quaternions (x, y, z, w) of rotations (frames, 3, 3), without changes of sign on the way."""
    quaternions = Rotation.from_matrix(rotations).as_quat()
    turned = (quaternions[1:] * quaternions[:-1]).sum(-1) < 0
    signs = np.cumprod(np.where(turned, -1.0, 1.0))
    return quaternions * np.concatenate([[1.0], signs])[:, None]
