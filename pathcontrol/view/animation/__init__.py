"""The animation of runs: arms, paths and their motion, ready for a page."""
