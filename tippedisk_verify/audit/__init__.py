"""The paper's claims: what each states, how it is examined, and the proof that belongs to it."""
