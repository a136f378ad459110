"""The tippedisk itself: numbers, parameters, equations. Nothing here integrates."""
