"""Base parameters in closed form, by rules for grouping."""
