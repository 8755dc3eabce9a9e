"""Trees and serial arms forced on the records of closed mechanisms, and what the verdict says."""
