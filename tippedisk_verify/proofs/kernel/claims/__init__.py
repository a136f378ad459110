"""The claims that certificates make, and whether the evidence in a file proves them."""
