"""The tippedisk itself: parameters, friction laws, equations of motion. Nothing here integrates."""
