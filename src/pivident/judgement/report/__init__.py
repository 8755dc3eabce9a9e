"""Pages: reports, audits and friction, each one HTML file that needs nothing else."""
