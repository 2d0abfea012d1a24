"""The import of optional dependencies."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from pathcontrol.errors import MissingExtraError


def load_extra(module: str, extra: str, purpose: str, package: str = "") -> Any:
    """Return a ``module`` that an ``extra`` brings, in the ``package`` of its first name unless another is given.

    Raises:
        MissingExtraError: it is not installed, and is needed for the ``purpose``.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtraError(package or module.partition(".")[0], extra, purpose) from error
