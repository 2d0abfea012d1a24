"""Smoothing of contours with corners to curves that a tool can follow without stopping."""
