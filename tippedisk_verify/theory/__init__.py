"""What the theory says in closed form. Nothing here integrates; that `flow` agrees with it is evidence."""
