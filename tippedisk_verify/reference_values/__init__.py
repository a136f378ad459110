"""Reference values: read, asked for, drawn anew and checked. `reference_data/make` in a checkout makes them.

`manifest` finds the files and holds each against its hash, `store` reads the values and what they are, `lookup` finds
one, `export` writes them in other forms. `entries` has questions, `truths` computes what they ask;
`draws` and `fresh` make new questions, `checking` computes published values again. `questions` is what grading needs.
"""
