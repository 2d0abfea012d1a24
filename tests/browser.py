"""A headless Chromium that looks at pages from disk: offline, with everything noted that it says or asks for."""

from __future__ import annotations

import atexit
import base64
import io
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from patience import PATIENCE
from PIL import Image

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "microsoft-edge")
# software draws the pictures: a quarter of the pixels shows the same, in half the time
COARSE: dict[str, Any] = {"device_scale_factor": 0.5}
FINE: dict[str, Any] = {"device_scale_factor": 1.0}
LOCAL = ("file:", "data:", "blob:", "about:")
_FLAGS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",  # without a graphics card pages are put together faster by the processor itself
    "--renderer-process-limit=1",  # for the pages of one window: the second one finds the viewer compiled
)


@dataclass(eq=False)
class Opened:
    """A page in the browser.

    Attributes:
        tab: playwright's page.
        messages: what it wrote to the console.
        errors: what it threw and nobody caught.
        requests: addresses that it asked for and that are not on this disk; it got none of them.
    """

    tab: Any
    messages: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    @property
    def complaints(self) -> list[str]:
        """All that a page which works offline and without trouble has none of."""
        return self.messages + self.errors + self.requests

    def __call__(self, script: str, argument: Any = None) -> Any:
        """The value of an expression, or of a function of the argument, in the page."""
        return self.tab.evaluate(script, argument)

    def picture(self) -> np.ndarray:
        """The picture as it is drawn now, without what is written over it, (height, width, 3), 0 to 255."""
        data = self("() => { film.render(); return document.querySelector('#pane canvas').toDataURL(); }")
        return _colors(base64.b64decode(data.partition(",")[2]))

    def pixels(self, selector: str = "#stage") -> np.ndarray:
        """What an element looks like, (height, width, 3), 0 to 255."""
        return _colors(self.tab.locator(selector).screenshot())

    def until(self, condition: str) -> None:
        """Wait until an expression is true in the page, whose policy forbids that playwright waits in it."""
        end = time.monotonic() + PATIENCE
        while not self(condition):
            assert time.monotonic() < end, f"it never came to be that {condition}"
            self.tab.wait_for_timeout(20)


def _colors(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=np.float64)


def binary() -> str:
    """The browser; without one the test is skipped, or fails if PATHCONTROL_REQUIRE_BROWSER is set."""
    for name in NAMES:
        if found := shutil.which(name):
            return found
    reason = f"no browser: none of {', '.join(NAMES)} is installed"
    if os.environ.get("PATHCONTROL_REQUIRE_BROWSER"):
        pytest.fail(reason)
    pytest.skip(reason)


@contextmanager
def opened(
    html: Path,
    size: tuple[int, int] = (900, 600),
    hash: str = "",  # noqa: A002
    before: str = "",
    **context: Any,
) -> Iterator[Opened]:
    """A page from disk, drawn once, or as far as it gets.

    Args:
        html: the file.
        size: of the window [px].
        hash: what follows the address, such as ``"#t=2.5"``.
        before: a script that runs before the page's own.
        context: more for playwright's ``new_context``, such as ``color_scheme="dark"``, or ``**FINE`` to look at
            what is thin.
    """
    window = _window(**context) if context else _usual_window()
    page = Opened(window.new_page())
    try:
        _listen(page)
        page.tab.set_viewport_size({"width": size[0], "height": size[1]})
        page.tab.add_init_script(before)
        page.tab.goto(html.resolve().as_uri() + hash)
        page("() => window.film?.ready?.catch(() => null)")
        yield page
    finally:
        (window if context else page.tab).close()


def _window(**context: Any) -> Any:
    window = _browser().new_context(**{"offline": True} | COARSE | context)
    window.set_default_timeout(1000 * PATIENCE)
    return window


@cache
def _usual_window() -> Any:
    """The window of pages that ask for no other; an empty page in it keeps its process, and what that has compiled."""
    window = _window()
    window.new_page()
    return window


def _listen(page: Opened) -> None:
    def note(message: Any) -> None:
        if "GL Driver Message" not in message.text:  # of the software that stands in for a graphics card
            page.messages.append(message.text)

    def decide(route: Any) -> None:
        if route.request.url.startswith(LOCAL):
            route.continue_()
        else:
            page.requests.append(route.request.url)
            route.abort()

    page.tab.on("console", note)
    page.tab.on("pageerror", lambda error: page.errors.append(str(error)))
    page.tab.route("**/*", decide)


@cache
def _browser() -> Any:
    """One for all tests of this process, as it takes a second to start and playwright allows one of its own."""
    program = binary()
    from playwright.sync_api import sync_playwright

    playwright = sync_playwright().start()
    browser = playwright.chromium.launch(executable_path=program, args=list(_FLAGS), timeout=1000 * PATIENCE)
    atexit.register(_quietly, playwright.stop)
    atexit.register(_quietly, browser.close)
    return browser


def _quietly(close: Callable[[], None]) -> None:
    with suppress(Exception):  # the browser may be gone before we are
        close()
