"""What can be claimed about the paper and about other implementations, and how it is checked."""
