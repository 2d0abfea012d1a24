"""The HTML page that shows a film: one file that needs no network."""
