"""The whole path in a browser, on one's own machine."""
