"""The heteroclinic connection: Omega_h and the orbit of the connection.

`cycles.heteroclinic_methods` has all four methods for Omega_h: one of them needs limit cycles.
"""
