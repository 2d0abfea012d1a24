"""A run as a film: the arms, the paths, and how they move, ready for a page."""
