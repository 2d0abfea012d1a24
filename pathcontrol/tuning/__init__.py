"""Gains for stated objectives within limits, and what the limits cost."""
