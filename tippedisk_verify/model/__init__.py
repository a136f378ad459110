"""What the tippedisk is: numbers, parameters, equations. Nothing here integrates anything."""
