"""The samples of a sweep or a tuning: an experiment file with other values for some of its keys."""
