"""Warnings before a simulation begins: likely slips, periods and steps that are too long."""
