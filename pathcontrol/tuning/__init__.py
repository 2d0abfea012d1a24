"""Tuning: gains for stated objectives within limits, and the cost of the limits."""
