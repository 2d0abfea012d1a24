"""Jerk-limited ends of velocity profiles."""
