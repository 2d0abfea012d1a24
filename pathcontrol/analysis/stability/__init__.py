"""Stability of closed orbits: Floquet multipliers, their maps over gains, and the largest usable ones."""
