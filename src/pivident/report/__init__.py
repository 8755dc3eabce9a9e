"""One self-contained HTML page about one identification or several methods side by side."""
