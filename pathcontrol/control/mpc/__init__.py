"""Predictive path following: the law, its optimisation problem, and the path as a spline in CasADi."""
