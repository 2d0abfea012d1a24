"""Poses over time: key frames of moving parts, from the samples of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.robot.rotations import quaternions_of, rotation_of_quaternion
from pathcontrol.view.animation.scene.keyframes import Indices, inside, interpolate, key_samples

STILL = 1e-9  # m, and the same of the quaternion: what does not move by more is at rest
ERROR = 4.9e-5  # m, and the same of the entries of a rotation: single precision stays within 5e-5, too


@dataclass(frozen=True, eq=False)
class Track:
    """The poses of a part over time, relative to its parent.

    Attributes:
        times: increasing, from the start of the film [s], (keys,).
        positions: [m], (keys, 3).
        quaternions: unit quaternions (x, y, z, w) without a change of sign from key to key, (keys, 4).
    """

    times: Array
    positions: Array
    quaternions: Array

    @classmethod
    def from_poses(cls, times: Array, poses: Array) -> Track:
        """Return a track from homogeneous poses, (keys, 4, 4)."""
        return cls(times, poses[:, :3, 3], continuous_quaternions(poses[:, :3, :3]))

    @classmethod
    def from_positions(cls, times: Array, positions: Array) -> Track:
        """Return a track of a part that does not turn, through positions (keys, 3)."""
        return cls(times, positions, np.tile([0.0, 0.0, 0.0, 1.0], (len(times), 1)))

    @property
    def moves(self) -> bool:
        """True if it leaves its first pose."""
        return bool(
            np.abs(self.positions - self.positions[0]).max() > STILL
            or np.abs(self.quaternions - self.quaternions[0]).max() > STILL
        )

    @property
    def first_rotation(self) -> Array:
        """The first rotation, (3, 3)."""
        return rotation_of_quaternion(self.quaternions[0])

    def thin(self, error: float = ERROR) -> Track:
        """Return the track with the fewest keys that give every other within ``error`` [m; entries of the rotation].

        Between keys the position is linear in time and the quaternion too, normalised. The entries of a rotation
        change by no more than 2‖Δ‖ for a change Δ of its unit quaternion: that is what is measured.
        """

        def holds(first: Indices, length: int) -> NDArray[np.bool_]:
            rows = inside(first, length)
            near = interpolate(self.times, self.positions, first, length)
            off = np.linalg.norm(self.positions[rows] - near, axis=-1).max(-1)
            turned = interpolate(self.times, self.quaternions, first, length)
            turned /= np.linalg.norm(turned, axis=-1, keepdims=True)
            return (off <= error) & (2 * np.linalg.norm(self.quaternions[rows] - turned, axis=-1).max(-1) <= error)

        kept = key_samples(len(self.times), holds)
        return Track(self.times[kept], self.positions[kept], self.quaternions[kept])


def continuous_quaternions(rotations: Array) -> Array:
    """Return unit quaternions (x, y, z, w) of rotations (k, 3, 3), without changes of sign on the way."""
    quaternions = quaternions_of(rotations)
    turned = (quaternions[1:] * quaternions[:-1]).sum(-1) < 0
    signs = np.cumprod(np.where(turned, -1.0, 1.0))
    return quaternions * np.concatenate([[1.0], signs])[:, None]
