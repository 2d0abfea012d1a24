"""Paths given by formulas."""
