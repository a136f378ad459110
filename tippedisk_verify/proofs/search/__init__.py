"""What looks for evidence, in ordinary arithmetic: nothing here is believed."""
