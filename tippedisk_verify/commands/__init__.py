"""The commands, a module for each subject. They import the package when they run;
`tippedisk_verify.cli` assembles them.

- `definition` makes a command of a function and prints its result; `options` has the options that
  several commands take, `jobs` those about processes, which `workers` runs.
- `grading_output` has the options of the grading commands, and writes what they ask for.
- `tables` breaks lines and aligns columns. `help` completes the help of all commands.
"""
