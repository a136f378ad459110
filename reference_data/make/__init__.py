"""The program that makes the reference values: ``python reference_data/make`` in a checkout.

The entries are those of values.csv. `recipes` lists the methods that compute each kind. The first
method of a kind is in `tippedisk_verify.reference_values.truths`, the others are in `local` and
`cycles`. `proofs` proves the numbers that can be proved, and `generation` writes the files.
"""
