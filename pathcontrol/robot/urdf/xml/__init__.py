"""Parsing of the bytes of a URDF file into its elements."""
