"""The paper's claims: their statements, their examinations, and the proofs that belong to them."""
