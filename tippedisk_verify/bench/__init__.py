"""Run time against error: the `problems`, the `methods` that solve them, the `race` between them, the `overhead`."""
