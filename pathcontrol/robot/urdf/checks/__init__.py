"""Checks of a robot description, each of one kind of fault."""
