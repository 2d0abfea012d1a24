"""Findings about a robot description, and the report that collects them."""

from __future__ import annotations

import reprlib
from dataclasses import asdict, dataclass
from typing import Any, Literal

Level = Literal["error", "warning", "note"]

_REPR = reprlib.Repr()
_REPR.maxstring = 80


@dataclass(frozen=True)
class Finding:
    """A single finding about a robot description.

    Attributes:
        level: ``"error"`` (unusable), ``"warning"`` (probably not meant) or ``"note"`` (good to know).
        code: Short identifier of the kind of finding, such as ``"joint-no-limit"``.
        where: The element concerned, such as ``"joint 'elbow'"``.
        message: One sentence: the value, what was expected, what to try.
    """

    level: Level
    code: str
    where: str
    message: str

    def __str__(self) -> str:
        return f"{self.level}: {self.where}: {self.message} [{self.code}]"


@dataclass(frozen=True)
class UrdfReport:
    """The findings of all checks about one robot description.

    Attributes:
        name: Name of the robot, empty if it could not be read.
        links: Names of the links, in the order of the file.
        joints: Names of the joints that turn or slide, in the order of the file.
        findings: All findings, errors first.
    """

    name: str
    links: tuple[str, ...]
    joints: tuple[str, ...]
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """The findings that make the robot unusable."""
        return tuple(finding for finding in self.findings if finding.level == "error")

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings that were probably not meant."""
        return tuple(finding for finding in self.findings if finding.level == "warning")

    @property
    def ok(self) -> bool:
        """True if there is no error."""
        return not self.errors

    def as_dict(self) -> dict[str, Any]:
        """Return the report as plain values for JSON."""
        return {**asdict(self), "ok": self.ok}


def quote(text: str | None) -> str:
    """Quote a text for a message, on one line and of bounded length."""
    return _REPR.repr(text)


def place(kind: str, name: str | None) -> str:
    """Name a link or joint for a message, such as ``"joint 'elbow'"``."""
    return f"{kind} {quote(name)}"
