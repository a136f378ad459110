"""A limit cycle as a fixed point of a section's return map: Newton's iteration, the cycle's numbers
and their half-widths.
"""
