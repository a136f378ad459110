"""Where it is hard (`battery`), and random cases without end (`honesty`): each must give digits that hold, or say why not."""
