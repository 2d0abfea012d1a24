"""The analysis of runs and states: metrics, distances, errors, Lyapunov functions.

The public functions are listed in ``__init__.pyi`` and load what they need on first use; they are in
:mod:`pathcontrol` as well.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
