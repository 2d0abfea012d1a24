"""The video of an animation: a browser on this machine draws the frames, FFmpeg joins them."""

from __future__ import annotations

import base64
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from threading import Event
from typing import IO, TYPE_CHECKING, Any, NamedTuple, cast

from pathcontrol._arrays import as_scalar
from pathcontrol._expect import expect
from pathcontrol._files import scratch_folder, whole_file
from pathcontrol._progress import progress_bar
from pathcontrol._suffixes import check_suffix
from pathcontrol.errors import InputError, MissingExtraError, PathControlError

if TYPE_CHECKING:
    from pathcontrol.view.animation.animation import Animation

#: programs that can draw a page, and the variable that names another one
BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "microsoft-edge",
    "microsoft-edge-stable",
)
BROWSER_VARIABLE = "PATHCONTROL_BROWSER"
_SOFTWARE = ("--ignore-gpu-blocklist", "--enable-unsafe-swiftshader")  # draws without a graphics card, too
# no slower than JPEG, nor much slower than the canvas alone, which lacks legend and labels
_PICTURE = {"format": "png", "optimizeForSpeed": True}
_INPUT = ("-y", "-v", "error", "-f", "image2pipe", "-c:v", "png")
_CODEC = ("-an", "-c:v", "libx264", "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "+faststart")
_COLOURS = ("-vf", "scale=out_range=tv:out_color_matrix=bt709", "-colorspace", "bt709")
_MOST_FRAMES = 1_000_000
_LARGEST = 16_384  # px, of a picture of a browser and of H.264
_PATIENCE = 60_000  # ms, for the page to be drawn once


class _Clip(NamedTuple):
    """The frames of a video: size [px], frames a second, and the moments of the film that they show [s]."""

    size: tuple[int, int]
    fps: float
    moments: tuple[float, ...]


def save_video(
    animation: Animation,
    path: str | Path,
    *,
    size: tuple[int, int] = (1280, 720),
    fps: float = 30.0,
    speed: float = 1.0,
) -> Path:
    """Write an animation as a video (H.264 in MP4), whole or not at all: picture and legend, without controls.

    Needs the extra ``video`` and Chromium, Chrome or Edge, which is looked for by the usual names; the environment
    variable ``PATHCONTROL_BROWSER`` names another program.

    Args:
        animation: what :func:`record` made.
        path: the file to write, with the suffix .mp4.
        size: width and height [px], even numbers.
        fps: frames a second.
        speed: how many seconds of the run a second of the video shows.

    Raises:
        InputError: an argument has the wrong value.
        MissingExtraError: a package or a browser is missing.
        PathControlError: the browser cannot draw the page, or FFmpeg cannot write the video.
    """
    from pathcontrol.view.animation.animation import Animation

    expect("animation", animation, Animation)
    path = check_suffix(path, "a video (H.264 in MP4)", ".mp4")
    clip = _clip(animation.duration, size, as_scalar("fps", fps, positive=True), speed)
    for package in ("playwright", "imageio_ffmpeg"):
        if find_spec(package) is None:
            raise MissingExtraError(package, "video", "a video")
    program, stop = find_browser(), Event()
    with whole_file(path) as video, scratch_folder("pathcontrol-film-") as folder, ThreadPoolExecutor(1) as pool:
        page = animation.save(folder / "film.html")
        # in a thread: there is no loop of asyncio that playwright would trip over, and Ctrl-C does not hit it halfway
        work = pool.submit(_write_frames, page, video, clip, program, stop)
        try:
            work.result()
        finally:
            stop.set()
    return path


def find_browser() -> str:
    """Return the program that draws the frames.

    Raises:
        InputError: the environment names one that does not exist.
        MissingExtraError: there is none.
    """
    if chosen := os.environ.get(BROWSER_VARIABLE):
        if found := shutil.which(chosen):
            return found
        raise InputError(
            f"{BROWSER_VARIABLE} = {chosen!r}, expected the name or the path of a browser's program",
            argument=BROWSER_VARIABLE,
            value=chosen,
        )
    for name in BROWSERS:
        if found := shutil.which(name):
            return found
    raise _NoBrowserError


class _NoBrowserError(MissingExtraError):
    """The browser to draw the frames is missing."""

    def __init__(self) -> None:
        ImportError.__init__(
            self,
            f"a video needs Chromium, Chrome or Edge, and there is none of {', '.join(BROWSERS)}; install one, or name "
            f"its program in the environment variable {BROWSER_VARIABLE}",
        )


def _clip(duration: float, size: tuple[int, int], fps: float, speed: float) -> _Clip:
    """Return the frames of the video."""
    if len(size) != 2 or any(not isinstance(n, int) or not 2 <= n <= _LARGEST or n % 2 for n in size):
        raise InputError(
            f"size = {size!r:.80}, expected width and height in pixels, two even numbers up to {_LARGEST} "
            "such as (1280, 720)",
            argument="size",
            value=size,
            limit=_LARGEST,
        )
    step = as_scalar("speed", speed, positive=True) / fps
    if not step * _MOST_FRAMES >= duration:
        raise InputError(
            f"fps = {fps:g} and speed = {speed:g} make more than {_MOST_FRAMES} frames of a film of {duration:g} s; "
            "lower fps, or raise speed",
            argument="fps",
            value=fps,
        )
    frames = max(1, math.ceil(duration / step - 1e-9))
    return _Clip(size, fps, tuple(k * step for k in range(frames)))


def _write_frames(page: Path, video: Path, clip: _Clip, program: str, stop: Event) -> None:
    """Draw and write all frames, unless ``stop`` is set."""
    from playwright.sync_api import Error

    count = len(clip.moments)
    try:
        with (
            _open_painter(page, clip, program) as camera,
            _open_encoder(video, clip) as write,
            progress_bar("filming", count) as say,
        ):
            for k, moment in enumerate(clip.moments):
                if stop.is_set():
                    return
                write(camera(moment))
                say(k + 1)
    except Error as error:
        raise PathControlError(
            f"the browser {program!r} cannot draw the film: {error}; {BROWSER_VARIABLE} can name another one"
        ) from error


@contextmanager
def _open_painter(page: Path, clip: _Clip, program: str) -> Iterator[Any]:
    """Give a function from a moment [s] to its picture, a PNG."""
    from playwright.sync_api import sync_playwright

    width, height = clip.size
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=list(_SOFTWARE), handle_sigint=False)
        tab = browser.new_page(viewport={"width": width, "height": height}, offline=True)
        tab.goto(f"{page.as_uri()}#t=0&bare")
        tab.wait_for_function("window.film", timeout=_PATIENCE)
        tab.evaluate("film.ready")
        session = tab.context.new_cdp_session(tab)

        def camera(moment: float) -> bytes:
            tab.evaluate("moment => { film.seek(moment); film.render(); }", moment)
            return base64.b64decode(session.send("Page.captureScreenshot", _PICTURE)["data"])

        yield camera
        browser.close()


@contextmanager
def _open_encoder(video: Path, clip: _Clip) -> Iterator[Any]:
    """Give a function that takes one picture after another."""
    from imageio_ffmpeg import get_ffmpeg_exe  # type: ignore[import-untyped]

    command = [get_ffmpeg_exe(), *_INPUT, "-framerate", f"{clip.fps:g}", "-i", "-", *_CODEC, *_COLOURS, str(video)]
    with tempfile.TemporaryFile() as log:
        # a session of its own, which Ctrl-C in the terminal does not reach
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=log, start_new_session=True)
        pipe = cast("IO[bytes]", process.stdin)
        try:
            yield pipe.write
            pipe.close()
            failed = process.wait()
        except BrokenPipeError:
            failed = process.wait()
        finally:
            process.kill()
        if failed:
            log.seek(0)
            raise PathControlError(f"FFmpeg cannot write the video: {log.read().decode(errors='replace').strip()}")
