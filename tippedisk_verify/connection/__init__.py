"""The heteroclinic connection: Omega_h, and cycles close to it."""
