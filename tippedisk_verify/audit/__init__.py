"""The paper's claims: what each says, how it is examined, and which proof goes with it."""
