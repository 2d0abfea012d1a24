"""The builder of a film's scene: arms, lines and markers, each with its motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.view.animation.payload import Film
from pathcontrol.view.animation.rollout import Recording
from pathcontrol.view.animation.scene.desired_path import Line
from pathcontrol.view.animation.scene.meshcat_commands import Scene, absolute, path
from pathcontrol.view.animation.scene.palette import DESIRED, GRID, RAPID, WALL
from pathcontrol.view.animation.scene.trace import Trace
from pathcontrol.view.animation.scene.tracks import Track
from pathcontrol.view.animation.scene.tube import SIDES, dashes, join_meshes, simplify, tube
from pathcontrol.view.animation.walls import THICKNESS, Plate
from pathcontrol.view.bodies.body_shapes import Box, Color, Mesh, Sphere

GHOST = 0.35  # opacity of an arm that stands in another
_FRAMED_POSES = 50
_MOST_RINGS = 20_000  # limit of rings for all cuts of a drawing
_MOST_TUBES = 2000  # more cuts are drawn as lines of a pixel
_MOST_DASHES = 10_000
CELLS = 8  # at least so many, and at most 2.5 times as many, from the middle to the rim
_STEPS = np.array([1.0, 0.5, 0.2, 0.1])


class Stage:
    """A scene with the parts that move and grow in it.

    Attributes:
        film: keeps the numbers.
        scene: the objects.
        tracks, growing, on_top, tubes, timed: as the header of a film has them.
    """

    def __init__(self, film: Film) -> None:
        self.film, self.scene = film, Scene()
        self.tracks: list[dict[str, Any]] = []
        self.growing: list[dict[str, Any]] = []
        self.on_top: list[str] = []
        self.tubes: list[dict[str, Any]] = []
        self.timed: list[dict[str, Any]] = []

    def add_arm(self, index: int, recording: Recording, shift: Array, *, ghost: bool = False) -> None:
        """Add the links of an arm, moved by ``shift`` [m], (3,), or its ghost in the colour of its run."""
        group = f"arms/{index}"
        self.scene.place(group, _translation(shift))
        links = list(dict.fromkeys(visual.link for visual in recording.visuals))
        names = {link: path(group, i, link) for i, link in enumerate(links)}
        for i, visual in enumerate(recording.visuals):
            color = (*recording.color[:3], GHOST) if ghost else visual.color
            self.scene.add(path(names[visual.link], i, visual.name), visual.shape, color, visual.origin)
        for link in links:
            self._move(names[link], Track.from_poses(recording.time, recording.poses[link]))

    def add_desired(self, index: int, lines: Sequence[Line], radius: float, shift: Array) -> None:
        """Draw the desired path: cuts as tubes of a ``radius`` [m], rapids as thin dashes."""
        cuts = [line.points + shift for line in lines if not line.rapid]
        if len(cuts) > _MOST_TUBES:
            segments = np.concatenate([np.stack([points[:-1], points[1:]], axis=1) for points in cuts])
            self.scene.add_segments(path("lines", index, "desired path"), segments, DESIRED)
        elif cuts:
            tubes = [tube(simplify(points, radius / 24, _MOST_RINGS // len(cuts)), radius) for points in cuts]
            self._add_tube(path("lines", index, "desired path"), join_meshes(tubes))
        rapids = [line.points + shift for line in lines if line.rapid]
        if rapids:
            whole = sum(float(np.linalg.norm(np.diff(points, axis=0), axis=-1).sum()) for points in rapids)
            dash = max(4 * radius, whole / (2 * _MOST_DASHES))
            pieces = np.concatenate([dashes(points, dash) for points in rapids])
            self.scene.add_segments(path("lines", index, "rapids"), pieces, RAPID)

    def _add_tube(self, name: str, mesh: Mesh) -> None:
        """Add a tube."""
        self.scene.add_line(name, mesh, DESIRED, lining=True)
        self.tubes.append({"path": absolute(name), "sides": SIDES})

    def add_trace(self, index: int, line: Trace, times: Array, colors: Array) -> None:
        """Draw the line of the tool as it grows, at ``times`` (k,) [s] in ``colors`` (k, 3) of all samples."""
        name = path("lines", index, "path taken")
        self.scene.add_colored_line(name, line.mesh, line.on_vertices(colors))
        rings = self.film.block(times[line.rings])
        self.tubes.append({"path": absolute(name), "sides": SIDES})
        self.growing.append({"path": absolute(name), "times": rings, "indices": line.indices})

    def add_marker(self, name: str, times: Array, positions: Array, color: Color, radius: float) -> None:
        """Add a dot that moves through positions (k, 3) and that nothing hides."""
        self.scene.add(f"{name}/ball", Sphere(radius), color)
        self._move(name, Track.from_positions(times, positions))
        self.on_top.append(absolute(name))

    def add_plate(self, name: str, plate: Plate, shift: Array) -> None:
        """Add a see-through plate that is there while its wall is."""
        size = plate.edge * np.array([THICKNESS, 1.0, 1.0])
        self.scene.place(name, _translation(shift) @ plate.pose)
        self.scene.add(f"{name}/plate", Box(size), WALL, _translation(np.array([-0.5 * size[0], 0.0, 0.0])))
        times = {"from": plate.begin, "to": plate.end if np.isfinite(plate.end) else None}
        self.timed.append({"path": absolute(name), **times})

    def add_ground(self, points: Array) -> None:
        """Draw the ground under points [m], (k, 3)."""
        self.scene.add_segments("ground", ground_grid(points), GRID)

    def header(self) -> dict[str, Any]:
        """Return the scene and its motion for the header of a film."""
        scene = [self.film.block(c, "u1") if isinstance(c, bytes) else c for c in self.scene.commands]
        lines = {"growing": self.growing, "tubes": self.tubes, "timed": self.timed}
        return {"scene": scene, "tracks": self.tracks, "on_top": self.on_top, **lines}

    def _move(self, name: str, whole: Track) -> None:
        """Place a name where its track begins, and keep the track if it leads anywhere."""
        start = np.eye(4)
        start[:3, :3], start[:3, 3] = whole.first_rotation, whole.positions[0]
        self.scene.place(name, start)
        if not whole.moves:
            return
        track = whole.thin()
        columns = {name: self.film.block(getattr(track, name)) for name in ("times", "positions", "quaternions")}
        self.tracks.append({"path": absolute(name), **columns})


def swept(recording: Recording) -> Array:
    """Return the positions of the outermost points of an arm's links [m], (k, 3)."""
    some = slice(None, None, -(-len(recording.time) // _FRAMED_POSES))
    outlines = [_transform(recording.poses[visual.link][some], visual.outline) for visual in recording.visuals]
    return np.concatenate([recording.tool_positions[:1], *outlines])


def _translation(shift: Array) -> Array:
    """Return the pose of a shift."""
    pose = np.eye(4)
    pose[:3, 3] = shift
    return pose


def _transform(poses: Array, points: Array) -> Array:
    """Return points (k, 3) at poses (m, 4, 4): (m k, 3)."""
    return (points @ poses[:, :3, :3].swapaxes(-1, -2) + poses[:, None, :3, 3]).reshape(-1, 3)


def ground_grid(points: Array) -> Array:
    """Return grid lines [m], (k, 2, 3), one segment for each side of a cell, under and around points (m, 3)."""
    lower, upper = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    radius = max(0.8 * float(np.linalg.norm(upper - lower)), 1e-3)
    pitch = _pitch(radius)
    middle = np.round((lower + upper) / 2 / pitch) * pitch
    steps = pitch * np.arange(-np.ceil(radius / pitch), np.ceil(radius / pitch) + 1)
    along, across = (a.reshape(-1) for a in np.meshgrid(steps[:-1], steps))
    segments = np.zeros((2, len(along), 2, 3))
    for direction in range(2):
        segments[direction, :, :, direction] = np.stack([along, along + pitch], axis=-1)
        segments[direction, :, :, 1 - direction] = across[:, None]
    inside = (np.linalg.norm(segments, axis=-1) <= radius).all(axis=-1)
    return segments[inside] + np.append(middle, 0.0)


def _pitch(radius: float) -> float:
    """Return the coarsest of …, 0.1, 0.2, 0.5, 1, 2, … m that gives enough cells."""
    power = 10.0 ** np.ceil(np.log10(radius / CELLS))
    return float(power * _STEPS[power * _STEPS <= radius / CELLS * (1 + 1e-9)][0])
