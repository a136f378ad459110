"""The commands by subject, each with imports at run time; `tippedisk_verify.cli` assembles them."""
