"""Families of limit cycles: continuation in a coordinate, interpolation between computed cycles,
and folds.
"""
