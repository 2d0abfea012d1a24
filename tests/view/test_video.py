"""Videos: what FFmpeg reads back is what was asked for."""

from __future__ import annotations

import asyncio
import importlib.util
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import browser
import numpy as np
import pytest
from patience import PATIENCE, wait_until

import pathcontrol as pc
from pathcontrol import Circle, InputError, MissingExtraError, RobotModel, Run
from pathcontrol.view import video
from pathcontrol.view.animation.animation import Animation
from pathcontrol.view.video import save_video

SIZE = (320, 200)


@pytest.fixture(scope="module")
def run(arm: RobotModel, circle: Circle) -> Run:
    law = pc.Projection(arm, circle, k_p=800.0, K_v=[45.0, 100.0])
    return pc.simulate(law, circle.q_d(np.array(0.0)), duration=1.5)


@pytest.fixture(scope="module")
def animation(run: Run) -> Animation:
    return pc.record(run)


@pytest.fixture(scope="module")
def clip(animation: Animation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """1.5 s at twice the speed and 10 frames a second: 8 frames."""
    needed()
    return save_video(animation, tmp_path_factory.mktemp("video") / "clip.mp4", size=SIZE, fps=10, speed=2.0)


def needed() -> None:
    browser.binary()
    for package in ("playwright", "imageio_ffmpeg"):
        if importlib.util.find_spec(package) is None:
            if os.environ.get("PATHCONTROL_REQUIRE_BROWSER"):
                pytest.fail(f"{package} is not installed")
            pytest.skip(f"{package} is not installed")


def frames(path: Path) -> tuple[dict, np.ndarray]:
    """What the file says of itself, and its frames (k, height, width, 3)."""
    from imageio_ffmpeg import read_frames

    reader = read_frames(str(path))
    about = next(reader)
    width, height = about["size"]
    return about, np.array([np.frombuffer(f, np.uint8).reshape(height, width, 3) for f in reader], dtype=float)


def test_frames_duration_size_and_format(clip):
    about, pictures = frames(clip)
    assert pictures.shape == (8, 200, 320, 3)
    assert about["fps"] == 10
    assert about["duration"] == pytest.approx(0.8)
    assert about["codec"] == "h264"
    assert about["pix_fmt"].startswith("yuv420p")


def test_frames_are_those_of_the_page_at_their_moments(clip, animation, tmp_path):
    _, pictures = frames(clip)
    with browser.opened(animation.save(tmp_path / "film.html"), SIZE, "#t=0&bare", **browser.FINE) as shown:
        for k in (0, 4, 7):
            shown("t => { film.seek(t); film.render(); }", 0.2 * k)
            there = shown.pixels("body")
            assert there.shape == pictures[k].shape
            off = [np.abs(there - picture).mean() for picture in pictures]
            assert int(np.argmin(off)) == k
            assert off[k] < 4  # of 255: what the codec loses


def test_the_arm_moves_and_the_rest_does_not(clip):
    _, pictures = frames(clip)
    changed = np.abs(pictures[-1] - pictures[0]).max(axis=-1) > 40
    assert 0.005 < changed.mean() < 0.4
    assert not changed[:10].any()  # the sky


def test_a_still_is_one_frame_also_in_a_notebook_where_a_loop_is_running(run, tmp_path):
    needed()
    still = pc.record(run.with_data(run.data.isel(time=[0])))

    async def cell() -> Path:
        return save_video(still, tmp_path / "still.mp4", size=SIZE)

    with ThreadPoolExecutor(1) as pool:  # the browser of the other tests has a loop in this thread
        assert len(frames(pool.submit(lambda: asyncio.run(cell())).result())[1]) == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"size": (321, 200)}, "321"),
        ({"size": (0, 200)}, "even"),
        ({"size": (200,)}, "even"),
        ({"size": (200.0, 100.0)}, "even"),
        ({"fps": 0}, "fps"),
        ({"fps": float("nan")}, "fps"),
        ({"speed": -1}, "speed"),
    ],
)
def test_bad_arguments(animation, tmp_path, options, said):
    with pytest.raises(InputError, match=said):
        save_video(animation, tmp_path / "a.mp4", **options)
    assert list(tmp_path.iterdir()) == []


def test_only_mp4(animation, tmp_path):
    with pytest.raises(InputError, match=r"a\.gif.*\.mp4"):
        save_video(animation, tmp_path / "a.gif")


@pytest.mark.parametrize("package", ["playwright", "imageio_ffmpeg"])
def test_a_missing_package_is_named_with_its_extra(animation, tmp_path, monkeypatch, package):
    monkeypatch.setattr(video, "find_spec", lambda name: None if name == package else object())
    with pytest.raises(MissingExtraError, match=rf"{package}.*pathcontrol\[video\]"):
        save_video(animation, tmp_path / "a.mp4")


def test_a_missing_browser_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv(video.BROWSER_VARIABLE, raising=False)
    with pytest.raises(MissingExtraError, match=r"Chromium.*PATHCONTROL_BROWSER"):
        video.find_browser()
    monkeypatch.setenv(video.BROWSER_VARIABLE, "netscape")
    with pytest.raises(InputError, match="PATHCONTROL_BROWSER = 'netscape'"):
        video.find_browser()


def test_the_variable_names_the_browser(monkeypatch, tmp_path):
    program = tmp_path / "mine"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.setenv(video.BROWSER_VARIABLE, str(program))
    assert video.find_browser() == str(program)


def test_what_is_no_browser_leaves_no_file(animation, tmp_path, monkeypatch):
    needed()
    program = tmp_path / "mine"
    program.write_text("#!/bin/sh\nexit 3\n")
    program.chmod(0o755)
    monkeypatch.setenv(video.BROWSER_VARIABLE, str(program))
    with pytest.raises(pc.PathControlError, match="mine' cannot draw the film"):
        save_video(animation, tmp_path / "a.mp4")
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_ctrl_c_leaves_no_half_video(run, tmp_path):
    needed()
    run.save(tmp_path / "run.nc")
    command = [sys.executable, "-m", "pathcontrol", "view", "run.nc", "--mp4", "a.mp4"]
    process = subprocess.Popen(
        command,
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    wait_until(lambda: list(tmp_path.glob(".a-*.mp4")) or process.poll() is not None)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the command and all that it has started
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, err
    assert b"Traceback" not in err
    assert [path.name for path in tmp_path.iterdir()] == ["run.nc"]
