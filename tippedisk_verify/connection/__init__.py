"""The heteroclinic connection: Omega_h and the orbit of the connection.

`cycles.near_omega_h.heteroclinic_methods` has all four methods for Omega_h: one of them needs limit
cycles.
"""
