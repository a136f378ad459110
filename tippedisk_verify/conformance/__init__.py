"""Grading another implementation in digits, and saying what is wrong with it where that can be told.

`sheet` writes questions and reads answers, `grading` counts digits. `alternatives` are models with one mistake each,
`predictions` what they answer, `factors` solves for one free number, `shapes` is what wrong answers have in common
without a model; `diagnosis` tries them on answers that fail. `engine` is to take their place: it changes a right
program until it gives the answers. It serves no command yet. `pages` shows the result, `regression` makes a gate of it.
"""
