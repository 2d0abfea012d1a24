"""The tables of an experiment file as pydantic models, derived from the signatures of the classes they are for."""
