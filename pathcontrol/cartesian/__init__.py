"""Paths of the joints that lead a tool along curves in space."""
