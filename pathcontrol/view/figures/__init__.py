"""Figures for print and screen, in one style."""
