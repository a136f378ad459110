"""Where it is hard (`battery`), and random cases without end (`honesty`): digits that hold, or a word why not."""
