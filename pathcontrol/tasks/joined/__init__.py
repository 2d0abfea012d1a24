"""Paths made of several paths in a row."""
