"""Limit cycles as fixed points of return maps: shooting, continuation, folds, and a spectral
method.
"""
