"""From samples to smooth derivatives, noise models and prefilters."""
