"""The commands, by subject; `tippedisk_verify.cli` puts them together. Each imports what it needs when it runs."""
