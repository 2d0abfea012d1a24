"""The storage of a run in a file: its data, its robot and its path, without pickle."""
