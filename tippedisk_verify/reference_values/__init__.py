"""The reference values: reading, looking up, drawing, checking and exporting them.

- `manifest` finds the data files and compares each with its hash. `store` reads the values.
- `lookup` finds a value by its id. `export` writes values in other formats.
- `entries` defines what questions are about. `truths` computes their answers.
- `drawn_disks` and `fresh_questions` make new questions from a seed. `checking` computes published
  values again.
- `grading_rules` has the digits required at each level, the scale of an error, and the columns of
  sheets.

An *entry* is what several questions are about, such as a state or a cycle. A *question* asks for
one quantity of an entry. A *case* is an entry whose inputs are read in one way, as decimals or as
doubles. A *reference value* is the true answer to a question, and a *row* is its line in
values.csv.

`reference_data/make` in a source checkout makes the published values.
"""
