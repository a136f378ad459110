"""Everything that the package needs around its computations, and no mathematics.

- `files`: reading and writing files whole or not at all;
- `cache`: results of earlier runs, kept in files;
- `provenance`: the code, packages and processor behind a result;
- `parallel`: calls spread over processes; `workers`: the processes, here or on a cluster;
- `dialogue`: a conversation with another program over pipes;
- `progress`: messages and the progress bar on standard error;
- `interrupts`: Ctrl-C, without losing what is half written;
- `web`: templates of stand-alone pages.
"""
