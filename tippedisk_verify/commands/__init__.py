"""The commands, a module for each subject. They import the package when they run;
`tippedisk_verify.cli` assembles them.
"""
