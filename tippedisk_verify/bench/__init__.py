"""The comparison of run time and error of integrators.

`problems` are integrated by `methods` and `peers`; `measurement` measures them.
"""
