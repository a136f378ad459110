"""The speed of the heteroclinic connection from the saddles' manifolds, without limit cycles.

`omega_h` offers Omega_h to users, by these and by other methods.
"""
