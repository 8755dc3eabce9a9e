"""What is wrong with an experiment, before anything heavy is computed from it."""
