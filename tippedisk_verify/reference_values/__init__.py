"""The reference values: reading, looking up, drawing, checking and exporting them.

- `manifest` finds the data files and compares each with its hash. `store` reads the values.
- `lookup` finds a value by its id. `export` writes values in other formats.
- `entries` defines questions. `truths` computes their answers.
- `draws` and `fresh` make new questions from a seed. `checking` computes published values again.
- `table_rows` has everything that grading needs to know about a question.

`reference_data/make` in a source checkout makes the published values.
"""
