"""Linear models from sampled data: continuous and discrete time, with noise models.

Useful without a robot. Polynomials have the highest power first.
"""
