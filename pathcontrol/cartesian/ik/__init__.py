"""Inverse kinematics along a curve: a start posture, continuation, refinement to a joint spline, verification."""
