"""The point of a curve nearest to a given point: all over the curve, or downhill from where one was."""

from pathcontrol.geometry.closest_point.curve import Curve
from pathcontrol.geometry.closest_point.search import ClosestPoint

__all__ = ["ClosestPoint", "Curve"]
