"""How a run is kept in a file: its data, its robot and its path, without pickle."""
