"""The heteroclinic connection: Omega_h and the orbit of the connection."""
