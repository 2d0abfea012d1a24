"""Runs the scripts of ``examples/`` while the documentation is built, and keeps the animations that they write.

A page of the gallery belongs to the script of its name. A script runs again when it, or the library, is newer than
what it wrote. Scripts that need an extra which is not installed are left out, with a warning.
"""

import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from sphinx.util import logging

ROOT = Path(__file__).parents[2]
WRITTEN = ROOT / "docs" / "_build" / "extra" / "gallery"
ROBOTS, TUNE = ("robots", "example_robot_data"), ("tune", "pymoo")
OF_AN_EXTRA = {"six_joints": ROBOTS, "mill_pocket": ROBOTS, "deburr_bracket": ROBOTS, "tune_gains": TUNE}

_log = logging.getLogger(__name__)


def run_examples(app):
    """Run what is not up to date; an example that fails is an error of the documentation."""
    if app.builder.format != "html":
        return
    newest = max(file.stat().st_mtime for file in (ROOT / "pathcontrol").rglob("*") if file.suffix != ".pyc")
    for page in sorted(Path(app.srcdir, "gallery").glob("*.md")):
        script = ROOT / "examples" / f"{page.stem}.py"
        extra, module = OF_AN_EXTRA.get(page.stem, ("", "sys"))
        if find_spec(module) is None:
            _log.warning("%s is left out of the gallery: it needs the extra %s", script.name, extra)
        elif not _current(WRITTEN / page.stem, max(newest, script.stat().st_mtime)):
            _run(script, WRITTEN / page.stem)


def _current(folder, newest):
    pages = list(folder.glob("*.html"))
    return bool(pages) and min(page.stat().st_mtime for page in pages) > newest


def _run(script, folder):
    """Run a script and keep the pages and the figures it writes."""
    _log.info("running %s for the gallery", script.name)
    everything = folder.with_name(f"{folder.name}-all")
    done = subprocess.run([sys.executable, script, everything], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{script} failed:\n{done.stderr}")
    folder.mkdir(parents=True, exist_ok=True)
    for page in (*everything.glob("*.html"), *everything.glob("*.svg")):
        page.replace(folder / page.name)
    shutil.rmtree(everything)


def setup(app):
    """Called by Sphinx."""
    WRITTEN.mkdir(parents=True, exist_ok=True)
    app.config.html_extra_path.append(str(WRITTEN.parent))
    app.connect("builder-inited", run_examples)
    return {"parallel_read_safe": True}
