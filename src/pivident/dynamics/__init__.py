"""The dynamic model that is linear in its parameters: regressor, base parameters, accelerations."""
