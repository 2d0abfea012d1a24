"""Curves of a tool in space become paths of the joints."""
