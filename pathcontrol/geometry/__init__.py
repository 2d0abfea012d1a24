"""Curves and splines in any space: nearest points, arc length, derivatives, boxes."""
