"""What is claimed: one module for each kind of claim, which encloses its numbers and says what is shown of them."""
