"""A headless Chromium that looks at a page from disk, with every host name cut off."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--enable-logging=stderr",
    "--v=0",
)
_MESSAGE = re.compile(r':CONSOLE[:(]\d+\)?\] "(.*)", source:')


def binary() -> str:
    """The browser; without one the test is skipped, or fails if PATHCONTROL_REQUIRE_BROWSER is set."""
    for name in NAMES:
        if found := shutil.which(name):
            return found
    reason = f"no browser: none of {', '.join(NAMES)} is installed"
    if os.environ.get("PATHCONTROL_REQUIRE_BROWSER"):
        pytest.fail(reason)
    pytest.skip(reason)


def screenshot(
    html: Path,
    png: Path,
    *,
    size: tuple[int, int] = (1440, 900),
    seconds: float = 2.0,
    moment: float | None = None,
) -> list[str]:
    """Photograph a page after some seconds of its own time; return what it wrote to the console.

    With a moment [s] the animation waits there, else it plays.
    """
    address = html.resolve().as_uri() + ("" if moment is None else f"#t={moment:g}")
    picture = [f"--screenshot={png}", f"--window-size={size[0]},{size[1]}"]
    _, log = _run([*picture, f"--virtual-time-budget={round(1000 * seconds)}", address])
    assert png.is_file(), log
    return [text for text in _MESSAGE.findall(log) if "GL Driver Message" not in text]


def dom(html: Path) -> str:
    """The page as the browser has it after its scripts have run."""
    return _run(["--dump-dom", "--virtual-time-budget=1000", html.resolve().as_uri()])[0]


def _run(arguments: list[str]) -> tuple[str, str]:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [binary(), *_FLAGS, f"--user-data-dir={profile}", *arguments]
        done = subprocess.run(command, capture_output=True, text=True, timeout=180, check=False)
    return done.stdout, done.stderr
