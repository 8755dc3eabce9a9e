"""From log and robot to a first experiment file, every assumption in it with its reason."""
