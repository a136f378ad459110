"""The commands, by subject. `tippedisk_verify.cli` assembles them; each imports what it needs when
it runs.
"""
