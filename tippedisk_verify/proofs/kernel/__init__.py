"""What says "proved": enclosures of flows, returns and fixed points, tested by strict comparisons of balls."""
