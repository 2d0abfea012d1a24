"""Segments of contours: polylines, arcs and Bézier curves."""
