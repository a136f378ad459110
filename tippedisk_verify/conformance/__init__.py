"""Grading another implementation in digits, and saying what is wrong with it where that can be told.

`sheet` writes questions and reads answers, `grading` counts digits, `diagnosis` changes a right program until it gives
the answers that fail, `pages` shows the result, `regression` makes a gate of it.
"""
