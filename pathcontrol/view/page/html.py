"""One HTML file with everything in it: Meshcat's viewer, the scene, and nothing to fetch."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from string import Template

from pathcontrol.view.bodies.shapes import Color
from pathcontrol.view.film.camera import Camera


def page(title: Sequence[str], legend: Mapping[str, Color], commands: Sequence[bytes], camera: Camera) -> str:
    """The page that plays a scene.

    Args:
        title: what to say in the title line; any text, it is never markup.
        legend: what each colour is.
        commands: the commands of a :class:`pathcontrol.view.film.scene.Scene`.
        camera: where to look from.
    """
    own = resources.files("pathcontrol.view.page")
    viewer = resources.files("meshcat").joinpath("viewer", "dist", "main.min.js").read_text(encoding="utf-8")
    scripts = {"viewer": _embedded(viewer), "player": _embedded(own.joinpath("player.js").read_text("utf-8"))}
    return Template(own.joinpath("template.html").read_text("utf-8")).substitute(
        scripts,
        policy=_policy(list(scripts.values())),
        title=html.escape(" - ".join(title)),
        words="".join(f"<span>{html.escape(word)}</span>" for word in title),
        legend="".join(_entry(name, color) for name, color in legend.items()),
        scene=_scene(commands, camera),
    )


def _embedded(script: str) -> str:
    """A script as it may stand between tags: what would end it can only be inside a string."""
    return re.sub(r"<(?=/script|!--)", r"\\x3c", script, flags=re.IGNORECASE)


def _policy(scripts: Sequence[str]) -> str:
    """A content security policy: these scripts and no others, and nothing from the network."""
    digests = (base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts)
    allowed = " ".join(f"'sha256-{digest}'" for digest in digests)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:; "
        "worker-src blob:; base-uri 'none'; form-action 'none'"
    )


def _scene(commands: Sequence[bytes], camera: Camera) -> str:
    """The scene as JSON of numbers and base64, in which no markup can be."""
    view = {name: getattr(camera, name).tolist() for name in ("target", "direction", "outline")}
    return json.dumps({"camera": view, "commands": [base64.b64encode(c).decode() for c in commands]})


def _entry(name: str, color: Color) -> str:
    rgb = ", ".join(str(round(255 * channel)) for channel in color[:3])
    return f'<span><i style="background: rgba({rgb}, {color[3]:g})"></i>{html.escape(name)}</span>'
