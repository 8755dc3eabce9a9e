"""Methods that the literature has tried beside LS, IV and PIV: regressions, lines, filters."""
