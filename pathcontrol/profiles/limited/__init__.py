"""Velocity profiles within limits on speed and acceleration of joints and tools."""
