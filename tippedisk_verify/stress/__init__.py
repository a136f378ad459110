"""Cases that are numerically hard: digits that hold, or a word why not. `battery` lists them."""
