"""Path control of robot manipulators on Pinocchio.

A task is a path q_d(s) and a velocity profile ϑ(s): where, and how fast along it, never when. The public names are
listed in ``__init__.pyi`` and load what they need on first use, so that importing the package costs next to nothing.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
