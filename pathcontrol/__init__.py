"""Path control of robot manipulators on Pinocchio.

A task is a path q_d(s) and a velocity profile ϑ(s): where, and how fast along it, never when. The public names are
listed in ``__init__.pyi`` and load what they need on first use, so that importing the package costs next to nothing.
"""

import lazy_loader as _lazy

_public, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)


def __getattr__(name):  # type: ignore[no-untyped-def]
    """Return a public name, imported now, or ``__version__``, read from the installed package when asked for."""
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    return _public(name)
