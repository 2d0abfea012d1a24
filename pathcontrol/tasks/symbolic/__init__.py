"""Paths written as formulas."""
