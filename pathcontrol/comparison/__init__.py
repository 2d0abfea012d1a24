"""Comparisons of control laws in the same situation: scenarios, gains that mean the same, measures, one call."""
