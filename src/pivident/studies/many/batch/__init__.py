"""Many tasks on worker processes or a cluster: each is computed once, and written once."""
