"""The untrusted search for evidence, in ordinary arithmetic."""
