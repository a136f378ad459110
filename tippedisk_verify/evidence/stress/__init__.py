"""Where it is hard: extreme parameters, states, tolerances and speeds, each with the outcome that it must have."""
