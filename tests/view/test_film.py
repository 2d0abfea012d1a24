"""What a film packs comes out of it again; and how the other tests read films."""

from __future__ import annotations

import base64
import gzip
import json
from typing import Any

import numpy as np
import pytest
import umsgpack
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from pathcontrol import RobotModel, Run
from pathcontrol.view.animation.animation import Animation
from pathcontrol.view.animation.payload import Film

TYPES = {"f4": "<f4", "u4": "<u4", "u1": "u1"}


class Reel:
    """A film as a page gets it: unpacked from its text by what its documentation says, and nothing else."""

    def __init__(self, film: Film) -> None:
        raw = gzip.decompress(base64.b64decode(film.text()))
        length = int.from_bytes(raw[:4], "little")
        self.header: dict[str, Any] = json.loads(raw[4 : 4 + length])
        self._raw, self._first = raw, -(-(4 + length) // 8) * 8

    def block(self, reference: dict[str, Any]) -> np.ndarray:
        at, kind = self._first + reference["at"], TYPES[reference["type"]]
        assert at % 8 == 0
        values = np.frombuffer(self._raw, kind, reference["count"], at)
        return values.astype(float) if reference["type"] == "f4" else values

    def ordered(self) -> list[dict[str, Any]]:
        """Meshcat's commands, and copies, as they come."""
        commands = self.header["scene"]
        return [c | {"type": "copy"} if "copy" in c else umsgpack.unpackb(self.block(c).tobytes()) for c in commands]

    def commands(self, kind: str) -> list[dict[str, Any]]:
        """Those of a kind."""
        return [command for command in self.ordered() if command["type"] == kind]

    def transforms(self) -> dict[str, np.ndarray]:
        """Poses by path, (4, 4), relative to what is above."""
        return {
            c["path"].removeprefix("/meshcat/"): np.reshape(c["matrix"], (4, 4)).T
            for c in self.commands("set_transform")
        }

    def objects(self) -> dict[str, dict[str, Any]]:
        """Objects by path, as three.js reads them."""
        return {c["path"].removeprefix("/meshcat/"): c["object"] for c in self.commands("set_object")}

    def attribute(self, path: str, name: str = "position") -> np.ndarray:
        """An attribute of the vertices of an object, (k, 3)."""
        packed = self.objects()[path]["geometries"][0]["data"]["attributes"][name]["array"]
        return np.frombuffer(packed.data, dtype=np.float32).reshape(-1, 3).astype(float)

    def faces(self, path: str) -> np.ndarray:
        packed = self.objects()[path]["geometries"][0]["data"]["index"]["array"]
        return np.frombuffer(packed.data, dtype=np.uint32).reshape(-1, 3)

    def center_line(self, path: str) -> np.ndarray:
        """Where the middle of a tube runs, (k, 3)."""
        return self.attribute(path).reshape(-1, 6, 3).mean(axis=1)

    def tracks(self) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Times, positions and quaternions by path."""
        found = {}
        for track in self.header["tracks"]:
            times = self.block(track["times"])
            positions = self.block(track["positions"]).reshape(len(times), 3)
            quaternions = self.block(track["quaternions"]).reshape(len(times), 4)
            found[track["path"].removeprefix("/meshcat/")] = (times, positions, quaternions)
        return found

    def growing(self) -> dict[str, tuple[np.ndarray, int]]:
        """Times of the rings and indices from ring to ring, by path."""
        return {
            line["path"].removeprefix("/meshcat/"): (self.block(line["times"]), line["indices"])
            for line in self.header["growing"]
        }

    def chart(self, title: str) -> tuple[np.ndarray, dict[str, np.ndarray], dict[str, Any]]:
        """Times, values by label, and the header of the chart whose title holds some words."""
        [chart] = [chart for chart in self.header["charts"] if title in chart["title"]]
        lines = {line["label"]: self.block(line["values"]) for line in chart["lines"]}
        return self.block(chart["times"]), lines, chart


def reel(animation: Animation) -> Reel:
    return Reel(animation.film)


def played(track: tuple[np.ndarray, np.ndarray, np.ndarray], times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (k, 3) and rotations (k, 3, 3) of a track, as a page interpolates them."""
    keys, positions, quaternions = track
    x = np.stack([np.interp(times, keys, column) for column in positions.T], axis=-1)
    turn = np.stack([np.interp(times, keys, column) for column in quaternions.T], axis=-1)
    i, j, k, w = (turn / np.linalg.norm(turn, axis=-1, keepdims=True)).T
    rows = [
        [1 - 2 * (j * j + k * k), 2 * (i * j - k * w), 2 * (i * k + j * w)],
        [2 * (i * j + k * w), 1 - 2 * (i * i + k * k), 2 * (j * k - i * w)],
        [2 * (i * k - j * w), 2 * (j * k + i * w), 1 - 2 * (i * i + j * j)],
    ]
    return x, np.moveaxis(np.array(rows), -1, 0)


def made_up_run(
    robot: RobotModel, q: np.ndarray, duration: float, s: np.ndarray | None = None, time: np.ndarray | None = None
) -> Run:
    """A run through joint positions (time, n), or (rollout, time, n), at equal steps of time unless they are given."""
    q = np.atleast_3d(q.T).T if q.ndim == 2 else q
    s = np.zeros(q.shape[:2]) if s is None else np.broadcast_to(s, q.shape[:2])
    time = np.linspace(0.0, duration, q.shape[1]) if time is None else time
    joints = dict(zip(robot.joint_names, robot.position_units, strict=True))
    return Run.from_arrays(time, joints, {"q": q, "s": s}, {"controller": {"controller": "None"}}, robot=robot)


# --- packing ------------------------------------------------------------------------------------------------

numbers = arrays.arrays(np.float32, st.integers(0, 9), elements=st.floats(width=32, allow_nan=True))
words = st.text(st.characters(exclude_categories=["Cs"]))


@given(st.lists(st.one_of(numbers, st.binary(max_size=9)), max_size=6), words)
def test_all_that_is_packed_comes_out_again(blocks: list[Any], word: str) -> None:
    film = Film()
    references = [film.block(b, "u1" if isinstance(b, bytes) else "f4") for b in blocks]
    film.header = {"word": word, "blocks": references}
    unpacked = Reel(film)
    assert unpacked.header["word"] == word
    for block, reference in zip(blocks, unpacked.header["blocks"], strict=True):
        expected = np.frombuffer(block, np.uint8) if isinstance(block, bytes) else block
        np.testing.assert_array_equal(unpacked.block(reference), expected)


def test_the_text_is_the_same_for_the_same_film_and_holds_no_markup() -> None:
    films = [Film({"text": "</script><b>"}) for _ in range(2)]
    for film in films:
        film.block([1.0, np.nan])
    assert films[0].text() == films[1].text()
    assert set("<>&'\"") & set(films[0].text()) == set()


def test_a_header_with_numbers_that_json_has_not_is_refused() -> None:
    with pytest.raises(ValueError, match="JSON"):
        Film({"duration": float("nan")}).pack()
