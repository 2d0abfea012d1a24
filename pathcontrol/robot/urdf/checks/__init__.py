"""Checks of a robot description, grouped by kind of fault."""
