"""How fast a path is taken: velocity profiles ϑ(s) computed for a path."""
