"""Page and figures of friction."""
