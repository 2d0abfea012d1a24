"""Velocity profiles ϑ(s) computed for a given path."""
