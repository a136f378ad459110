"""Grading another implementation in digits, and saying what is wrong with it where that can be told.

`sheet` writes questions and reads answers, `grading` counts digits, `alternatives` are models with one mistake each,
`diagnosis` tries them on answers that fail, `pages` shows the result.
"""
