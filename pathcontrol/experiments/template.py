"""The commented experiment file to start from."""

from __future__ import annotations

from importlib import resources


def example_text() -> str:
    """The paper's first experiment as an experiment file, with every option explained."""
    return resources.files("pathcontrol.experiments").joinpath("template.toml").read_text(encoding="utf-8")
