"""The theory in closed form and in series.

Nothing here integrates, so its agreement with `flow` is evidence.
"""
