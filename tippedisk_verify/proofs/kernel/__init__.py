"""The trusted kernel: enclosures of flows, returns and fixed points, tested by strict
comparisons.
"""
