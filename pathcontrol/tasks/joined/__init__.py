"""Paths that follow one another."""
