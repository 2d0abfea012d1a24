"""Meshes that were drawn are not thinned and split again, and a file that has changed is seen."""

from __future__ import annotations

import pytest
import trimesh

from pathcontrol.view.bodies import body_meshes
from pathcontrol.view.bodies.body_meshes import read_mesh


@pytest.fixture
def split(monkeypatch):
    """What was split so far, of an empty memory."""
    split, own = [], body_meshes._split_sharp_edges
    monkeypatch.setattr(body_meshes, "_kept", {})
    monkeypatch.setattr(body_meshes, "_split_sharp_edges", lambda *how: split.append(how) or own(*how))
    return split


def write_ball(path, radius, subdivisions=2):
    trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius).export(path)
    return path


def test_a_mesh_is_split_once_for_each_content_scale_and_detail(split, tmp_path):
    path = write_ball(tmp_path / "ball.stl", 0.1)
    ((first, _),) = read_mesh(path, 1.0, 1e-4)
    ((again, _),) = read_mesh(path, 1.0, 1e-4)
    assert again is first
    ((copied, _),) = read_mesh(path.rename(tmp_path / "other.stl"), 1.0, 1e-4)
    assert copied is first
    assert len(split) == 1
    ((finer, _),) = read_mesh(tmp_path / "other.stl", 1.0, 0.0)
    ((larger, _),) = read_mesh(tmp_path / "other.stl", 2.0, 1e-4)
    ((changed, _),) = read_mesh(write_ball(path, 0.3), 1.0, 1e-4)
    assert len(split) == 4
    assert len(finer.faces) >= len(first.faces)
    assert abs(larger.bounds).max() == pytest.approx(0.2, rel=0.01)
    assert abs(changed.bounds).max() == pytest.approx(0.3, rel=0.01)


def test_what_is_kept_is_not_written_to_and_bounded(split, tmp_path, monkeypatch):
    path = write_ball(tmp_path / "ball.stl", 0.1)
    ((mesh, _),) = read_mesh(path)
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 0.0
    monkeypatch.setattr(body_meshes, "_MOST_KEPT", len(mesh.faces))
    ((other, _),) = read_mesh(path, 2.0)
    assert [*body_meshes._kept.values()] == [other]
    read_mesh(write_ball(path, 0.1, subdivisions=3))
    assert sum(len(kept.faces) for kept in body_meshes._kept.values()) <= len(mesh.faces)
