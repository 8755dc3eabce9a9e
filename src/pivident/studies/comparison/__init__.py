"""Several identifications side by side: which parameters differ, by how much, and how surely."""
