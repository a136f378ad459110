"""Limit cycles next to Omega_h, where the period tends to infinity, and the four methods for
Omega_h.
"""
