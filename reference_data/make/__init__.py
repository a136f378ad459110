"""What makes the reference values: ``python reference_data/make`` in a checkout.

The questions are those of values.csv. `recipes` says which methods answer each kind (the first stands in
`tippedisk_verify.reference_values.truths`, the others in `local` and `cycles`), `proofs` proves what can be proved, and
`generation` writes the files.
"""
