"""The cases that are numerically hard. Each must give correct digits or a clear refusal; `battery`
lists them.
"""
