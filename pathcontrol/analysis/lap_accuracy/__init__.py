"""Accuracy and repeatability of laps of a path, by the criteria of ISO 9283, and the ball bar plot."""
