"""Run time against error: the `problems`, the `methods` that solve them, the `peers`, the `race` between them."""
