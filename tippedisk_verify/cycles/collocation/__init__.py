"""Limit cycles and their folds by Fourier collocation in time, without an integrator."""
