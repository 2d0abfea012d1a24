"""The closest point of a curve to a given point: the global minimum, or the local one downhill from a start."""

from pathcontrol.geometry.closest_point.curve import Curve
from pathcontrol.geometry.closest_point.search import ClosestPoint

__all__ = ["ClosestPoint", "Curve"]
