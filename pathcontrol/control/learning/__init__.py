"""Feedforward that is learnt lap by lap along a path: the law, and its table over the path parameter."""
