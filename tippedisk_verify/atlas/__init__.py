"""Which cycles there are: at a speed, along a branch, and over one parameter and the speed."""
